"""The wide grammar: time on hostile strings, and on the Treebank's commands in scenes of 18 to 22 blocks.

    python -m benchmarks.commands hostile --strings 100000 --out docs/language.json
    python -m benchmarks.commands blocks --data FOLDER --out docs/language.json

Times are CPU time of the process, so that other load counts less. Objects from before the measurement are left out of
garbage collection, as in a server. Exits with 1 if a string raises an exception. The writers of hostile strings also
serve `benchmarks.language fuzz` and `benchmarks.page hostile`.
"""

from __future__ import annotations

import argparse
import gc
import json
import statistics
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator

from benchmarks.store import lines_of, write_section
from benchmarks.treebank import world_of
from benchmarks.treebank_data import read
from language import KINDS, Describer, Instruction, Scene, Tokenizer, Wording, interpret, say
from language.lattice import vocabulary
from language.world import WorldModel
from tools.random_scenes import random_scene

OUTCOMES = ("Plan", "Question", "Refusal", "Answer", "Signal")
LIMIT = 0.05  # seconds of CPU time a hostile string
REPEATS = 3  # of strings that take longer than half of that: the least time counts
SHOWN = 5  # of the slowest strings
BLOCKS = range(18, 23)

Case = tuple[str, str, Scene | WorldModel]  # its kind, the sentence, the scene
_WORDS = Tokenizer.default().vocabulary[2:]
_MARKS = (",", ".", "!", "?", ";", "'", '"', "-", "(", ")", "/", "\\", "\n", "\t", "\x00", "\x1b[2J", "%s", "{0}")
_SCRIPTS = (
    "\u0434\u043e\u0442\u0440\u043e\u043d\u044c\u0441\u044f \u0434\u043e \u043a\u0443\u0431\u0430",  # Russian
    "\u62ff\u8d77\u7ea2\u8272\u7684\u7acb\u65b9\u4f53",  # Chinese
    "\u0627\u0644\u0645\u0643\u0639\u0628 \u0627\u0644\u0623\u062d\u0645\u0631",  # Arabic
    "\u0e25\u0e39\u0e01\u0e1a\u0e32\u0e28\u0e01\u0e4c",  # Thai
    "re\u0430ch the red cub\u0435",  # Cyrillic letters that look Latin
    "\uff52\uff45\uff41\uff43\uff48 the red cube",  # full width
    "\u202ereach the red cube\u202c",  # right to left
    "reach\u00a0the\u2003red\u200bcube",  # unusual spaces
    "\U0001f916 reach the \U0001f7e5 cube \U0001f468\u200d\U0001f469\u200d\U0001f467",  # emoji
    "REACH THE RED CUBE\u0130\u212a\u1e9e",  # letters that grow or change when put in lower case
    "\ud800 reach the \udfff cube",  # lone surrogates
)

Writer = Callable[[Generator, Scene], str]


def good(rng: Generator, scene: Scene) -> str:
    """A sentence that is understood, with random wording."""
    describer = Describer(KINDS)
    named = describer.nameable(scene).nonzero()[0]
    phrase = describer.phrase(scene, int(rng.choice(named)), rng)
    return Wording().say(Instruction(("reach", "press", "grasp", "turn")[rng.integers(4)], phrase), rng)


def truncated(rng: Generator, scene: Scene) -> str:
    """The start or the end of a good sentence."""
    sentence = good(rng, scene)
    at = int(rng.integers(len(sentence) + 1))
    return sentence[:at] if rng.random() < 0.7 else sentence[at:]


def shuffled(rng: Generator, scene: Scene) -> str:
    """The words of a good sentence in random order."""
    words = good(rng, scene).split()
    return " ".join(words[index] for index in rng.permutation(len(words)))


def misspelt(rng: Generator, scene: Scene) -> str:
    """A good sentence with letters removed or replaced."""
    letters = list(good(rng, scene))
    for _ in range(int(rng.integers(1, 4))):
        letters[rng.integers(len(letters))] = ("", "e", "  ", "\u0301", "xx", "'")[rng.integers(6)]
    return "".join(letters)


def two_in_one(rng: Generator, scene: Scene) -> str:
    """A part of a good sentence, joined to another one."""
    one, other = good(rng, scene), good(rng, scene)
    joint = (" ", ", then ", " and ", ". ", "", " not ", ", no, ", " between ", " that is not ")[rng.integers(9)]
    return one[: int(rng.integers(len(one) + 1))] + joint + other


def salad(rng: Generator, scene: Scene) -> str:
    """Random words of the vocabulary and punctuation marks."""
    choices = (*_WORDS, *_MARKS) if rng.random() < 0.3 else _WORDS
    return " ".join(choices[index] for index in rng.integers(len(choices), size=int(rng.integers(80))))


def characters(rng: Generator, scene: Scene) -> str:
    """Random characters, with control characters and lone surrogates."""
    highest = (0x20, 0x80, 0x300, 0x3000, 0x110000)[rng.integers(5)]
    return "".join(map(chr, rng.integers(highest, size=int(rng.integers(200))).tolist()))


def foreign(rng: Generator, scene: Scene) -> str:
    """Other scripts, and characters that look Latin but are not."""
    words = [_SCRIPTS[index] for index in rng.integers(len(_SCRIPTS), size=int(rng.integers(1, 4)))]
    return " ".join((*words, good(rng, scene)) if rng.random() < 0.5 else words)


def nested(rng: Generator, scene: Scene) -> str:
    """Nested phrases, within the parser's limit of characters and far beyond it."""
    name = say(Describer(KINDS).phrase(scene, int(Describer(KINDS).nameable(scene).argmax()), rng))
    depth = int(rng.choice([10, 40, 80, 90, 400]))
    shapes = (
        f"reach {'the one by ' * depth}{name}",
        f"reach {(name + ' near ') * depth}{name}",
        f"reach {'the one between ' * depth}{name}{(' and ' + name) * depth}",
        "after you " * depth + f"touch {name}",
        " and ".join([f"touch {name}"] * depth),
        f"{'no, ' * depth}{name}",
        f"{'please ' * depth}touch {name}{', please' * depth}",
        f"touch {name}" + "." * depth,
        "(" * depth + f"touch {name}" + ")" * depth,
    )
    return shapes[rng.integers(len(shapes))]


def long(rng: Generator, scene: Scene) -> str:
    """A repeated word, letter or sentence: just within the limit, beyond it, and 1 MB long."""
    length = 1_000_000 if rng.random() < 0.01 else int(rng.choice([999, 1000, 1001, 5000]))
    piece = ("a", "reach ", "the ", " ", "\u0301", "'", "a'", ",", "and ", "\U0001f600", good(rng, scene) + " ")
    begin = "reach the " if rng.random() < 0.5 else ""
    chosen = piece[rng.integers(len(piece))]
    return (begin + chosen * (length // len(chosen) + 1))[:length]


def code(rng: Generator, scene: Scene) -> str:
    """Strings that programs write: JSON, templates, SQL, HTML, escapes and token names."""
    sentence = good(rng, scene)
    shapes = (
        json.dumps({"instruction": sentence, "n": [1, 2]}),
        f'"{sentence}"',
        f"reach the {'{object}'} {'{goal}'}",
        f"'; DROP TABLE scenes; -- {sentence}",
        f"<b>{sentence}</b>",
        f"{sentence}\x00{sentence}",
        "".join(f"\\u{ord(letter):04x}" for letter in sentence),
        "VERB_REACH __ANON_0 $END <unk> <pad>",
    )
    return shapes[rng.integers(len(shapes))]


WRITERS: tuple[Writer, ...] = (
    good,
    truncated,
    shuffled,
    misspelt,
    two_in_one,
    salad,
    characters,
    foreign,
    nested,
    long,
    code,
)


def wide_salad(rng: Generator, scene: Scene) -> str:
    """Random words of the wide lexicon, most of which begin or join phrases."""
    words = sorted(vocabulary())
    often = ("and", "the", "red", "cube", "on", "of", "left", "block", "between", "put", "nearest", "then", "not")
    drawn = [rng.choice(often) if rng.random() < 0.5 else rng.choice(words) for _ in range(int(rng.integers(60)))]
    return " ".join(map(str, drawn))


def hostile_cases(number: int, seed: int) -> Iterator[Case]:
    """Yields hostile strings, each with a scene of six objects."""
    rng = np.random.default_rng(seed)
    scenes = [random_scene(6, rng) for _ in range(100)]
    writers: tuple[Callable[[Generator, Scene], str], ...] = (*WRITERS, wide_salad)
    for index in range(number):
        writer, scene = writers[index % len(writers)], scenes[index % len(scenes)]
        yield writer.__name__, writer(rng, scene), scene


def block_cases(folder: Path) -> Iterator[Case]:
    """Yields the Treebank's commands of the developing part, each in its scene, which has about 20 blocks."""
    for item in read(folder, "develop").items:
        if item.before is not None and len(item.before.blocks) in BLOCKS:
            yield "command", item.text, world_of(item.before)


def measured(cases: Iterator[Case]) -> dict[str, Any]:
    """Returns CPU times and outcomes of `interpret`."""
    times: list[tuple[float, str]] = []
    outcomes: Counter[str] = Counter()
    raised = []
    interpret("take the cube", Scene([]))
    gc.collect()
    gc.freeze()
    for kind, text, scene in cases:
        outcome, seconds = _timed(text, scene)
        outcomes[outcome if outcome in OUTCOMES else "exception"] += 1
        if outcome not in OUTCOMES:
            raised.append(f"{outcome} at {text[:200]!r}")
        times.append((1000 * seconds, f"{kind}: {text[:200]!r}"))
    times.sort(reverse=True)
    return {
        "strings": len(times),
        "median_ms": round(statistics.median(each[0] for each in times), 2),
        "worst_ms": round(times[0][0], 1),
        "slower_than_50_ms": sum(each[0] > 1000 * LIMIT for each in times),
        "outcomes": dict(outcomes),
        "slowest": [f"{each[0]:.1f} ms, {each[1]}" for each in times[:SHOWN]],
        "exceptions": raised[:SHOWN],
    }


def _timed(text: str, scene: Scene | WorldModel) -> tuple[str, float]:
    """Returns the kind of outcome, or the exception, and the seconds of CPU time."""
    best = float("inf")
    outcome = ""
    for _ in range(REPEATS):
        start = time.process_time()
        try:
            outcome = type(interpret(text, scene)).__name__
        except Exception as error:  # any exception is a defect, and is counted
            outcome = repr(error)[:300]
        best = min(best, time.process_time() - start)
        if best < LIMIT / 2:
            break
    return outcome, best


def main() -> None:
    """Measures one thing and prints its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("hostile", "blocks"))
    parser.add_argument("--strings", type=int, default=100_000, help="hostile: strings")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--data", type=Path, help="blocks: folder with commands.txt and configuration.txt")
    parser.add_argument("--out", type=Path, metavar="FILE.json", help="file that receives the result")
    args = parser.parse_args()
    if args.what == "blocks" and args.data is None:
        parser.error("blocks needs --data")
    cases = hostile_cases(args.strings, args.seed) if args.what == "hostile" else block_cases(args.data)
    result = measured(cases)
    for name, value in lines_of(result):
        print(f"{name:32} {value}")
    if args.out:
        write_section(args.out, "benchmarks.commands", f"interpret_{args.what}", result)
    sys.exit(bool(result["exceptions"]))


if __name__ == "__main__":
    main()
