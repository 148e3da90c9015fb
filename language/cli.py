"""The command line `python -m language`: `main` parses the arguments and runs one of the commands."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np

from language.answers import CommandLine, as_text, error_as_text, grounded
from language.describing import plain_name
from language.errors import LanguageError
from language.generator import KINDS, MAX_DEPTH, ReferringExpressions
from language.hearing import Recogniser, read_sound
from language.lexicon import count
from language.sampling import Sample, sample
from language.scene_file import NamedScene, as_entries, read_scene
from language.speech_grammar import speech_grammar
from language.splits import Split
from language.understanding import understand
from language.viewpoint import VIEWPOINTS, whose_left
from language.wording import Wording

INVALID_INPUT = 2  # exit code for a sentence that cannot be used, and for wrong arguments

_ABOUT = "Instructions about objects on a table: parses sentences, names objects, counts and samples sentences."
_EXAMPLES = """\
examples:
  python -m language parse "reach the red cube" --scene scene.yaml --json
  python -m language parse "reach this" --scene scene.yaml --pointed a
  python -m language parse - --scene scene.yaml < sentences.txt
  python -m language describe --scene scene.yaml --all
  python -m language sample --n 5 --steps 3 --varied
  python -m language hear said.wav --scene scene.yaml
  python -m language count

scene.yaml is a list of objects; positions and sizes are in metres, x away from the robot, y to its left, z up:
  - {id: a, noun: cube, color: red, position: [0.5, 0.1, 0.0]}
  - {id: b, noun: sphere, color: blue, position: [0.4, 0.0, 0.0], size: 0.04}
  - {id: t, noun: cube, color: red, position: [0.6, -0.2, 0.0], role: target}

exit codes: 0 success; 2 a sentence that cannot be used, a wrong scene or wrong arguments; 130 interrupted."""


class _Parser(argparse.ArgumentParser):
    """Report errors in the arguments in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(INVALID_INPUT, f"error: {message}; see {self.prog} --help\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and returns its exit code. arguments: None: those of the process."""
    options = _arguments().parse_args(arguments)
    try:
        return options.command(options)
    except LanguageError as error:
        print(f"error: {error}", file=sys.stderr)
        return INVALID_INPUT


def _arguments() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="python -m language",
        description=_ABOUT,
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    commands = parser.add_subparsers(title="commands", metavar="command", required=True)
    _add_parse(_command(commands, "parse", parse_command, "the steps that a sentence asks for, or its error"))
    _add_describe(_command(commands, "describe", describe_command, "a name for each object of a scene"))
    _command(commands, "count", count_command, f"the number of sentences by depth, 0 to {MAX_DEPTH}")
    _add_hear(_command(commands, "hear", hear_command, "the words of a spoken sentence, from a WAV file"))
    _add_sample(_command(commands, "sample", sample_command, "random sentences"))
    return parser


def _command(commands, name: str, run: Callable[[argparse.Namespace], int], about: str) -> argparse.ArgumentParser:
    parser = commands.add_parser(name, help=about, description=about.capitalize() + ".", allow_abbrev=False)
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.set_defaults(command=run)
    return parser


def _add_scene(parser: argparse.ArgumentParser, required: bool = False) -> None:
    parser.add_argument("--scene", metavar="FILE", required=required, help="the scene, a YAML file")
    parser.add_argument(
        "--viewpoint", choices=list(VIEWPOINTS), help="from where left and right are seen; default: robot"
    )


def _add_parse(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "sentence", help='in quotes; "-": read sentences from standard input, one a line, and print JSON lines'
    )
    _add_scene(parser)
    parser.add_argument(
        "--pointed", metavar="ID", action="append", default=[], help="the object of a gesture; repeat for each gesture"
    )


def _add_describe(parser: argparse.ArgumentParser) -> None:
    _add_scene(parser, required=True)
    parser.add_argument(
        "--all", action="store_true", help="every phrase that names the object alone, with at most one relation"
    )


def _add_hear(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("sound", type=Path, help="WAV file: one channel of 16 bits at 16 kHz, 15 seconds at most")
    _add_scene(parser, required=True)


def _add_sample(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--n", type=_integer(1), default=20, help="number of sentences (20)")
    parser.add_argument("--seed", type=_integer(0), default=0, help="random seed (0)")
    _add_scene(parser)
    parser.add_argument(
        "--depth", type=_integer(0, MAX_DEPTH), help=f"nested relations in each phrase, 0 to {MAX_DEPTH}"
    )
    parser.add_argument("--steps", type=_integer(1, 10), default=1, help="steps of each instruction, 1 to 10 (1)")
    parser.add_argument("--varied", action="store_true", help="draw synonyms at random instead of the standard words")


def _integer(low: int, high: float = math.inf) -> Callable[[str], int]:
    """Return an argparse type for whole numbers from low to high."""

    def read(text: str) -> int:
        wanted = f"a whole number from {low} to {high}" if high < math.inf else f"a whole number of at least {low}"
        if not text.isdecimal() or len(text) > 18 or not low <= int(text) <= high:
            raise argparse.ArgumentTypeError(f"{text[:40]!r} must be {wanted}")
        return int(text)

    return read


def parse_command(options: argparse.Namespace) -> int:
    """Parse one sentence, or those of standard input."""
    named = _scene(options)
    if options.pointed and named is None:
        raise LanguageError("--pointed needs --scene: a gesture singles out an object")
    dialogue = CommandLine(named, [named.index(name) for name in options.pointed] if named else [])
    if options.sentence == "-":
        return _parse_lines(dialogue, sys.stdin)
    answer = dialogue.answer(options.sentence)
    if options.json:
        _print_json(answer)
    elif "error" in answer:
        print(error_as_text(answer, options.sentence), file=sys.stderr)
    else:
        print(as_text(answer, dialogue.previous))
    if named is not None and not options.json:
        print(whose_left(named.scene.viewpoint), file=sys.stderr if "error" in answer else sys.stdout)
    return INVALID_INPUT if "error" in answer else 0


def _parse_lines(dialogue: CommandLine, lines: Iterable[str]) -> int:
    status = 0
    for line in lines:
        if line.strip():
            answer = dialogue.answer(line.rstrip("\r\n"))
            _print_json(answer)
            status = INVALID_INPUT if "error" in answer else status
    return status


def describe_command(options: argparse.Namespace) -> int:
    """Print each object's id with its simplest name, or with all of its names."""
    named = _scene(options)
    assert named is not None
    if not options.json:
        print(whose_left(named.scene.viewpoint), file=sys.stderr)
    expressions = ReferringExpressions(named.scene, Split())
    found = (_names(index, name, expressions, options.all) for index, name in enumerate(named.ids))
    if options.json:
        _print_json(list(found))
        return 0
    width = max(map(len, named.ids))
    for thing in found:
        print(f"{thing['id']:{width}}  {thing['name'] or '(no phrase distinguishes it from the others)'}")
        for phrase in thing.get("phrases", ()):
            print(f"{'':{width}}    {phrase}")
    return 0


def _names(index: int, name: str, expressions: ReferringExpressions, every: bool) -> dict:
    try:
        found: dict = {"id": name, "name": str(plain_name(index, expressions))}
    except LanguageError:
        found = {"id": name, "name": None}
    if every:
        kinds = [kind for kind in KINDS if kind != "nested"]  # there are too many of them to list
        found["phrases"] = [str(phrase) for kind in kinds for phrase in expressions.all(kind, index)]
    return found


def hear_command(options: argparse.Namespace) -> int:
    """Print the words of a sound, among what can be said in a scene."""
    named = _scene(options)
    assert named is not None
    words = Recogniser().hear(read_sound(options.sound), speech_grammar(named.scene))
    if options.json:
        _print_json({"heard": words})
    else:
        print(words)
    return 0


def count_command(options: argparse.Namespace) -> int:
    """Print the number of different one-step sentences by depth, exact and as a power of ten."""
    counted = [(depth, count(depth)) for depth in range(MAX_DEPTH + 1)]
    if options.json:
        _print_json([{"depth": depth, "sentences": n, "log10": round(math.log10(n), 2)} for depth, n in counted])
        return 0
    for depth, n in counted:
        print(f"depth {depth}: {n:,}, about 10^{math.log10(n):.1f}")
    return 0


def sample_command(options: argparse.Namespace) -> int:
    """Print random sentences, one a line; as JSON with their steps and, if it was sampled, their scene."""
    named = _scene(options)
    rng = np.random.default_rng(options.seed)
    wording = Wording() if options.varied else None
    scene = named.scene if named else None
    for drawn in sample(options.n, rng, scene, options.depth, options.steps, wording):
        if options.json:
            _print_json(_sampled(drawn, named))
        else:
            print(drawn.sentence)
    return 0


def _sampled(drawn: Sample, named: NamedScene | None) -> dict:
    around = named or NamedScene(drawn.scene, tuple(f"o{index}" for index in range(len(drawn.scene))))
    answer = {"sentence": drawn.sentence, **grounded(understand(drawn.command, drawn.scene), around)}
    return answer if named else answer | {"scene": as_entries(around)}


def _scene(options: argparse.Namespace) -> NamedScene | None:
    if options.scene is not None:
        return read_scene(options.scene, options.viewpoint or "robot")
    if options.viewpoint is not None:
        raise LanguageError("--viewpoint needs --scene: without a scene, left and right make no difference")
    return None


def _print_json(answer: object) -> None:
    print(json.dumps(answer), flush=True)  # flushed, since the program at the other end of a pipe waits for the answer
