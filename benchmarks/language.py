"""What the language holds, measured: round trip, speed, and whatever people may type.

    python -m benchmarks.language round_trip --scenes 1000 --sampled 1000000 --workers 2 --out docs/language.json
    taskset -c 0 python -m benchmarks.language speed --out docs/language.json
    taskset -c 0 python -m benchmarks.language fuzz --strings 100000 --out docs/language.json

Each prints a table and, with `--out`, puts its own section into the JSON file and leaves the others. The same seed
gives the same scenes, sentences and strings, however many workers share them.
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

from benchmarks.hostile import WRITERS
from benchmarks.results import rows, write_section
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

PER_SCENE = 250  # deeper sentences that are drawn of one scene
SHOWN = 5  # failures that are told in full
LONGEST_MESSAGE = 1000  # characters that a person may be asked to read
SLOW = 0.005  # seconds
REPEATS = 5  # of each timing; the median counts
ERRORS = (NotUnderstood, NothingFits, SeveralFit)
STILL = [name for name, task in VERBS.items() if not task.moves]  # what leaves the scene as it is described
GOING = [name for name, task in VERBS.items() if task.moves and task.takes_goal]

Pair = tuple[int | None, int | None]  # init and goal


class Said(NamedTuple):
    """A sentence, what it was made from, and the objects it was made for."""

    sentence: str
    meaning: Command
    steps: list[Pair]


class Tally(NamedTuple):
    """How many sentences were tried, and each that failed, told."""

    tried: int
    wrong: list[str]


def _small_scene(rng: Generator, counts: tuple[int, int] = (2, 8)) -> Scene:
    """Returns a random scene of counts[0] to counts[1] objects."""
    return random_scene(int(rng.integers(counts[0], counts[1] + 1)), rng)


def every_sentence(seed: int) -> Tally:
    """Each sentence of at most one relation about one scene, said and understood."""
    scene = _small_scene(np.random.default_rng([seed, 1]))
    expressions = ReferringExpressions(scene, Split(), redundant=True)
    kinds = [kind for kind in KINDS if kind != "nested"]
    said = (
        Said(say(instruction), instruction, [(None, index)])
        for kind in kinds
        for index in range(len(scene))
        for instruction in (Instruction("reach", phrase) for phrase in expressions.all(kind, index))
    )
    return check(scene, said)


def deeper_sentences(job: tuple[int, int]) -> Tally:
    """So many drawn sentences of two and three relations about one scene: goals, chains, other words."""
    seed, number = job
    rng = np.random.default_rng([seed, 2])
    while True:
        scene = _small_scene(rng)
        expressions = ReferringExpressions(scene, Split(), redundant=True)
        if expressions.nameable_nested(2).sum() > 1:
            return check(scene, (_deeper(expressions, rng) for _ in range(number)))


def _deeper(expressions: ReferringExpressions, rng: Generator) -> Said:
    steps = [_deep_step(expressions, rng, still=True) for _ in range(int(rng.integers(2)))]
    steps.append(_deep_step(expressions, rng, still=False))
    command = steps[0][0] if len(steps) == 1 else Chain(tuple(step for step, _ in steps))
    sentence = say(command) if rng.random() < 0.5 else Wording().say(command, rng)
    return Said(sentence, command, [objects for _, objects in steps])


def _deep_step(expressions: ReferringExpressions, rng: Generator, still: bool) -> tuple[Instruction, Pair]:
    """An instruction with its objects; a still one leaves the scene as it is, so that more may follow."""
    depth = 3 if rng.random() < 0.5 and expressions.nameable_nested(3).sum() > 1 else 2
    named = expressions.nameable_nested(depth)
    real = np.flatnonzero(named & ~expressions.scene.targets)
    init = int(rng.choice(real if len(real) else np.flatnonzero(named)))
    phrase = expressions.draw_nested(depth, init, rng)
    if still or not len(real) or rng.random() < 0.5:
        return Instruction(STILL[rng.integers(len(STILL))], phrase), (None, init)
    goal = int(rng.choice(np.setdiff1d(np.flatnonzero(named), init)))
    task = GOING[rng.integers(len(GOING))]
    return Instruction(task, phrase, expressions.draw_nested(depth, goal, rng)), (init, goal)


def check(scene: Scene, said: Iterable[Said]) -> Tally:
    """Whether each sentence is understood as what it was made from, and as the objects it was made for."""
    tried, wrong = 0, []
    for each in said:
        tried += 1
        try:
            understood = parse(each.sentence, scene)
        except LanguageError as error:
            wrong.append(f"{each.sentence!r}: {error}")
            continue
        if understood.meaning != each.meaning:
            wrong.append(f"{each.sentence!r} is understood as '{understood.meaning}'")
        elif [(step.init, step.goal) for step in understood.steps] != each.steps:
            wrong.append(f"{each.sentence!r} is found as {understood.steps}, made for {each.steps}")
    return Tally(tried, wrong)


def round_trip(args: argparse.Namespace) -> dict[str, Any]:
    """parse(say(x)) == x, and x is found to be about the objects that it was generated for."""
    result: dict[str, Any] = {"scenes": args.scenes, "workers": args.workers, "seed": args.seed}
    first = args.seed * 10**9  # so that no two seeds share a scene
    batches = [PER_SCENE] * (args.sampled // PER_SCENE) + [args.sampled % PER_SCENE] * bool(args.sampled % PER_SCENE)
    jobs = [(first + index, number) for index, number in enumerate(batches)]
    with get_context("spawn").Pool(args.workers) as pool:
        for name, tallies in (
            ("up_to_depth_1", pool.imap_unordered(every_sentence, range(first, first + args.scenes), chunksize=4)),
            ("deeper", pool.imap_unordered(deeper_sentences, jobs, chunksize=4)),
        ):
            start = time.perf_counter()
            tried, wrong = 0, []
            for tally in tallies:
                tried += tally.tried
                wrong += tally.wrong
            seconds = round(time.perf_counter() - start, 1)
            result[name] = {"tried": tried, "wrong": len(wrong), "seconds": seconds, "first_wrong": wrong[:SHOWN]}
    return result


def speed(args: argparse.Namespace) -> dict[str, Any]:
    """Sentences a second with 6 objects, on one core, once everything is imported and the grammar is built."""
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
    start = time.perf_counter()
    result["count_log10"] = {str(depth): round(math.log10(count(depth)), 1) for depth in range(4)}
    result["count_seconds"] = round(time.perf_counter() - start, 4)
    return result


def _reset(describer: Describer, scene: Scene, rng: Generator) -> Instruction | None:
    """What an environment does at each reset: who can be named, and a sentence for one of them."""
    named = np.flatnonzero(describer.nameable(scene))
    return describer.describe(scene, int(rng.choice(named)), rng) if len(named) else None


def _rate(work: Callable[[], list[Any]]) -> float:
    """Things a second, the median of several goes."""
    rates = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        number = len(work())
        rates.append(number / (time.perf_counter() - start))
    return round(sorted(rates)[REPEATS // 2])


def fuzz(args: argparse.Namespace) -> dict[str, Any]:
    """Random, truncated, shuffled and hostile strings, each parsed against a scene, some as corrections."""
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
        "other_exceptions": others[:SHOWN],
    }


def _timed(text: str, scene: Scene, previous: Command | None) -> tuple[str, float]:
    """What became of the string, and in how many seconds; what seems slow is timed twice more, for the neighbours."""
    best = float("inf")
    for _ in range(3):
        start = time.perf_counter()
        outcome = _outcome(text, scene, previous)
        best = min(best, time.perf_counter() - start)
        if best < SLOW:
            break
    return outcome, best


def _outcome(text: str, scene: Scene, previous: Command | None) -> str:
    """What became of the string: "understood", or the exception's name, with its words where it is none of ours."""
    try:
        parse(text, scene, previous=previous)
    except ERRORS as error:
        too_long = len(str(error)) > LONGEST_MESSAGE
        return f"a message of {len(str(error))} characters" if too_long else type(error).__name__
    except Exception as error:  # whatever it is, it must not come: that is what is measured
        return repr(error)[:300]
    return "understood"


def failed(section: str, result: dict[str, Any]) -> bool:
    """Whether anything happened that never may. How fast it went is for the reader to judge."""
    if section == "round_trip":
        return bool(result["up_to_depth_1"]["wrong"] or result["deeper"]["wrong"])
    return section == "fuzz" and bool(result["other_exceptions"])


def main() -> None:
    """Measure one thing, print its table, and exit with 1 where a sentence was lost or a string broke something."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("round_trip", "speed", "fuzz"))
    parser.add_argument("--scenes", type=int, default=1000, help="round_trip: scenes of which every sentence is said")
    parser.add_argument("--sampled", type=int, default=1_000_000, help="round_trip: deeper sentences drawn")
    parser.add_argument("--workers", type=int, default=1, help="round_trip: processes that share the work")
    parser.add_argument("--speed-scenes", type=int, default=500, help="speed: scenes of 6 objects, all of them named")
    parser.add_argument("--strings", type=int, default=100_000, help="fuzz: strings tried")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, metavar="FILE.json", help="put the result into this file")
    args = parser.parse_args()
    result = {"round_trip": round_trip, "speed": speed, "fuzz": fuzz}[args.what](args)
    for name, value in rows(result):
        print(f"{name:32} {value}")
    if args.out:
        write_section(args.out, "benchmarks.language", args.what, result)
    sys.exit(failed(args.what, result))


if __name__ == "__main__":
    main()
