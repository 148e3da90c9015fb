"""The language: round trip of generated sentences, speed, and robustness against hostile strings.

    python -m benchmarks.language round_trip --scenes 1000 --sampled 1000000 --workers 2 --out docs/language.json
    taskset -c 0 python -m benchmarks.language speed --out docs/language.json
    taskset -c 0 python -m benchmarks.language fuzz --strings 100000 --out docs/language.json

Each command prints a table and, with `--out`, replaces its own section of the JSON file. The same seed gives the same
scenes, sentences and strings, for any number of workers.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Iterable
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator

from benchmarks.commands import WRITERS
from benchmarks.store import lines_of, write_section
from language import (
    DEFAULT_KINDS,
    KINDS,
    VERBS,
    Chain,
    Command,
    Describer,
    Instruction,
    LanguageError,
    NothingFits,
    NotUnderstood,
    ObjectPhrase,
    Scene,
    SeveralFit,
    Wording,
    count,
    parse,
    say,
)
from language.generator import ReferringExpressions
from language.splits import Split
from tools.random_scenes import random_scene

SENTENCES_PER_SCENE = 250  # of `nested_sentences`
MAX_SHOWN = 5  # failures that are reported in full
MAX_MESSAGE = 1000  # characters of an error message
SLOW = 0.005  # seconds: slower strings are timed again
REPEATS = 5  # of each timing, of which the median is reported
ERRORS = (NotUnderstood, NothingFits, SeveralFit)
STATIC_VERBS = [name for name, verb in VERBS.items() if not verb.moves]  # these leave the scene as it is
MOVING_VERBS = [name for name, verb in VERBS.items() if verb.moves and verb.takes_goal]

Pair = tuple[int | None, int | None]  # init and goal


class Generated(NamedTuple):
    """A generated sentence, the command that it says, and the objects of each step."""

    sentence: str
    meaning: Command
    steps: list[Pair]


class Tally(NamedTuple):
    """The number of sentences tried, and a line for each failure."""

    tried: int
    wrong: list[str]


def _small_scene(rng: Generator, counts: tuple[int, int] = (2, 8)) -> Scene:
    """Returns a random scene of counts[0] to counts[1] objects."""
    return random_scene(int(rng.integers(counts[0], counts[1] + 1)), rng)


def every_sentence(seed: int) -> Tally:
    """Says and parses every sentence with at most one relation about one scene."""
    scene = _small_scene(np.random.default_rng([seed, 1]))
    expressions = ReferringExpressions(scene, Split(), redundant=True)
    kinds = [kind for kind in KINDS if kind != "nested"]
    generated = (
        Generated(say(instruction), instruction, [(None, index)])
        for kind in kinds
        for index in range(len(scene))
        for instruction in (Instruction("reach", phrase) for phrase in expressions.all(kind, index))
    )
    return check(scene, generated)


def nested_sentences(job: tuple[int, int]) -> Tally:
    """Says and parses random sentences about one scene: two or three relations, goals, chains and synonyms."""
    seed, number = job
    rng = np.random.default_rng([seed, 2])
    while True:
        scene = _small_scene(rng)
        expressions = ReferringExpressions(scene, Split(), redundant=True)
        if expressions.nameable_nested(2).sum() > 1:
            return check(scene, (_nested_sentence(expressions, rng) for _ in range(number)))


def _nested_sentence(expressions: ReferringExpressions, rng: Generator) -> Generated:
    steps = [_nested_step(expressions, rng, still=True) for _ in range(int(rng.integers(2)))]
    steps.append(_nested_step(expressions, rng, still=False))
    command = steps[0][0] if len(steps) == 1 else Chain(tuple(step for step, _ in steps))
    sentence = say(command) if rng.random() < 0.5 else Wording().say(command, rng)
    return Generated(sentence, command, [objects for _, objects in steps])


def _nested_step(expressions: ReferringExpressions, rng: Generator, still: bool) -> tuple[Instruction, Pair]:
    """An instruction and its objects. still: with a verb that leaves the scene as it is, so that a step may follow."""
    depth = 3 if rng.random() < 0.5 and expressions.nameable_nested(3).sum() > 1 else 2
    named = expressions.nameable_nested(depth)
    real = np.flatnonzero(named & ~expressions.scene.targets)
    init = int(rng.choice(real if len(real) else np.flatnonzero(named)))
    phrase = expressions.draw_nested(depth, init, rng)
    if still or not len(real) or rng.random() < 0.5:
        return Instruction(STATIC_VERBS[rng.integers(len(STATIC_VERBS))], phrase), (None, init)
    goal = int(rng.choice(np.setdiff1d(np.flatnonzero(named), init)))
    on_target = expressions.scene.targets[goal]  # nothing can be put on or in a target
    verbs = [name for name in MOVING_VERBS if not (on_target and VERBS[name].goal_is_real)]
    return Instruction(verbs[rng.integers(len(verbs))], phrase, expressions.draw_nested(depth, goal, rng)), (init, goal)


def check(scene: Scene, generated: Iterable[Generated]) -> Tally:
    """Parses each sentence and compares the command and the objects with those it was generated from."""
    tried, wrong = 0, []
    for each in generated:
        tried += 1
        try:
            understood = parse(each.sentence, scene)
        except LanguageError as error:
            wrong.append(f"{each.sentence!r}: {error}")
            continue
        if understood.meaning != each.meaning:
            wrong.append(f"{each.sentence!r} is understood as '{understood.meaning}'")
        elif [(step.init, step.goal) for step in understood.steps] != each.steps:
            wrong.append(f"{each.sentence!r} is found as {understood.steps}, generated for {each.steps}")
    return Tally(tried, wrong)


def round_trip(args: argparse.Namespace) -> dict[str, Any]:
    """Checks that parse(say(x)) == x, and that parsing finds the objects for which x was generated."""
    result: dict[str, Any] = {"scenes": args.scenes, "workers": args.workers, "seed": args.seed}
    first = args.seed * 10**9  # different seeds have different scenes
    starts = range(0, args.sampled, SENTENCES_PER_SCENE)
    jobs = [(first + i, min(SENTENCES_PER_SCENE, args.sampled - start)) for i, start in enumerate(starts)]
    with get_context("spawn").Pool(args.workers) as pool:
        for name, tallies in (
            ("up_to_depth_1", pool.imap_unordered(every_sentence, range(first, first + args.scenes), chunksize=4)),
            ("deeper", pool.imap_unordered(nested_sentences, jobs, chunksize=4)),
        ):
            start = time.perf_counter()
            tried, wrong = 0, []
            for tally in tallies:
                tried += tally.tried
                wrong += tally.wrong
            seconds = round(time.perf_counter() - start, 1)
            result[name] = {"tried": tried, "wrong": len(wrong), "seconds": seconds, "first_wrong": wrong[:MAX_SHOWN]}
    return result


def speed(args: argparse.Namespace) -> dict[str, Any]:
    """Sentences a second of CPU time with 6 objects, on one core, after imports and with the grammar built."""
    rng = np.random.default_rng(args.seed)
    scenes = [_small_scene(rng, (6, 6)) for _ in range(args.speed_scenes)]
    describer = Describer(KINDS)
    made = [
        (scene, Instruction("reach", describer.phrase(scene, int(index), rng)))
        for scene in scenes
        for index in np.flatnonzero(describer.nameable(scene))
    ]
    sentences = [(say(instruction), scene) for scene, instruction in made]
    parse("reach the cube")
    result: dict[str, Any] = {"objects": 6, "sentences": len(sentences), "seed": args.seed}
    result["say"] = _rate(lambda: [say(instruction) for _, instruction in made])
    result["parse"] = _rate(lambda: [parse(sentence) for sentence, _ in sentences])
    result["parse_and_ground"] = _rate(lambda: [parse(sentence, scene) for sentence, scene in sentences])
    for name, kinds in (("reset", DEFAULT_KINDS), ("reset_all_kinds", KINDS)):
        result[name] = _rate(lambda kinds=kinds: [_reset(Describer(kinds), scene, rng) for scene in scenes])  # type: ignore[misc]
    start = time.process_time()
    result["count_log10"] = {str(depth): round(math.log10(count(depth)), 1) for depth in range(4)}
    result["count_seconds"] = round(time.process_time() - start, 4)
    return result


def _reset(describer: Describer, scene: Scene, rng: Generator) -> Instruction | None:
    """The language part of a reset: finds the nameable objects and describes one of them."""
    named = np.flatnonzero(describer.nameable(scene))
    return describer.describe(scene, int(rng.choice(named)), rng) if len(named) else None


def _rate(work: Callable[[], list[Any]]) -> float:
    """Items a second of CPU time, the median of REPEATS timings."""
    rates = []
    for _ in range(REPEATS):
        start = time.process_time()
        number = len(work())
        rates.append(number / (time.process_time() - start))
    return round(sorted(rates)[REPEATS // 2])


def fuzz(args: argparse.Namespace) -> dict[str, Any]:
    """Parses random, truncated, shuffled and hostile strings against a scene, every second one as a correction."""
    rng = np.random.default_rng(args.seed)
    scenes = [_small_scene(rng, (6, 6)) for _ in range(100)]
    previous = Instruction("reach", ObjectPhrase("cube", "red"))
    parse("reach the cube")
    outcomes = dict.fromkeys(("understood", *(error.__name__ for error in ERRORS), "other"), 0)
    slowest: tuple[float, str] = (0.0, "")
    others: list[str] = []
    for number in range(args.strings):
        writer = WRITERS[number % len(WRITERS)]
        scene = scenes[number % len(scenes)]
        text = writer(rng, scene)
        outcome, seconds = _timed(text, scene, previous if number % 2 else None)
        slowest = max(slowest, (seconds * 1e3, f"{writer.__name__}: {text[:80]!r}"))
        if outcome not in outcomes:
            others.append(f"{outcome} at {text[:200]!r}")
        outcomes[outcome if outcome in outcomes else "other"] += 1
    return {
        "strings": args.strings,
        "seed": args.seed,
        "slowest_ms": round(slowest[0], 2),
        "slowest": slowest[1],
        "share": {name: round(number / max(args.strings, 1), 4) for name, number in outcomes.items()},
        "other_exceptions": others[:MAX_SHOWN],
    }


def _timed(text: str, scene: Scene, previous: Command | None) -> tuple[str, float]:
    """The outcome of a string, and CPU seconds. A slow string is timed up to three times, against other load."""
    best = float("inf")
    for _ in range(3):
        start = time.process_time()
        outcome = _outcome(text, scene, previous)
        best = min(best, time.process_time() - start)
        if best < SLOW:
            break
    return outcome, best


def _outcome(text: str, scene: Scene, previous: Command | None) -> str:
    """The outcome of a string: "understood", or the exception's name, with its message if it is not one of ERRORS."""
    try:
        parse(text, scene, previous=previous)
    except ERRORS as error:
        too_long = len(str(error)) > MAX_MESSAGE
        return f"a message of {len(str(error))} characters" if too_long else type(error).__name__
    except Exception as error:  # any other exception is a defect, and is counted
        return repr(error)[:300]
    return "understood"


def failed(section: str, result: dict[str, Any]) -> bool:
    """Whether a check failed. Speed is reported only."""
    if section == "round_trip":
        return bool(result["up_to_depth_1"]["wrong"] or result["deeper"]["wrong"])
    return section == "fuzz" and bool(result["other_exceptions"])


def main() -> None:
    """Measures one thing and prints its table. Exits with 1 if a check failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("round_trip", "speed", "fuzz"))
    parser.add_argument("--scenes", type=int, default=1000, help="round_trip: scenes with every sentence")
    parser.add_argument("--sampled", type=int, default=1_000_000, help="round_trip: nested sentences")
    parser.add_argument("--workers", type=int, default=1, help="round_trip: processes")
    parser.add_argument("--speed-scenes", type=int, default=500, help="speed: scenes of 6 objects")
    parser.add_argument("--strings", type=int, default=100_000, help="fuzz: strings")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, metavar="FILE.json", help="file that receives the result")
    args = parser.parse_args()
    result = {"round_trip": round_trip, "speed": speed, "fuzz": fuzz}[args.what](args)
    for name, value in lines_of(result):
        print(f"{name:32} {value}")
    if args.out:
        write_section(args.out, "benchmarks.language", args.what, result)
    sys.exit(failed(args.what, result))


if __name__ == "__main__":
    main()
