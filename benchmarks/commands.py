"""The wide grammar: time on hostile strings, and on the Treebank's commands in scenes of 18 to 22 blocks.

    python -m benchmarks.commands hostile --strings 100000 --out docs/language.json
    python -m benchmarks.commands blocks --data FOLDER --out docs/language.json

Times are CPU time of the process, so that other load counts less. Objects from before the measurement are left out of
garbage collection, as in a server. Exits with 1 if a string raises an exception.
"""

from __future__ import annotations

import argparse
import gc
import statistics
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator

from benchmarks.hostile import WRITERS
from benchmarks.results import rows, write_section
from benchmarks.treebank import world_of
from benchmarks.treebank_data import read
from language import Scene, interpret
from language.lattice import vocabulary
from language.world import WorldModel
from tools.random_scenes import random_scene

KINDS = ("Plan", "Question", "Refusal", "Answer", "Signal")  # of outcomes
LIMIT = 0.05  # seconds of CPU time a hostile string
REPEATS = 3  # of strings that take longer than half of that: the least time counts
SHOWN = 5  # of the slowest strings
BLOCKS = range(18, 23)

Case = tuple[str, str, Scene | WorldModel]  # its kind, the sentence, the scene


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
        outcomes[outcome if outcome in KINDS else "exception"] += 1
        if outcome not in KINDS:
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
    for name, value in rows(result):
        print(f"{name:32} {value}")
    if args.out:
        write_section(args.out, "benchmarks.commands", f"interpret_{args.what}", result)
    sys.exit(bool(result["exceptions"]))


if __name__ == "__main__":
    main()
