"""The commands that strangers wrote for a block-stacking arm: the Robot Commands Treebank.

    python -m benchmarks.treebank --data FOLDER

FOLDER has `commands.txt` and `configuration.txt`. Each command is interpreted in the scene before, carried out
virtually and compared with the scene after: which block went where, and what the gripper holds. `--part develop` and
`--part held_out` divide the scenes by a fixed seed: the grammar was developed on the first.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from collections import Counter
from collections.abc import Iterable
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

from benchmarks.store import write_section
from benchmarks.treebank_data import PARTS, BoardState, TreebankSentence, read
from language.outcomes import Plan, Question, Refusal
from language.settling import interpret_alone
from language.world import WorldModel, board

RESULTS = ("right", "wrong", "asked", "refused")


class Judged(NamedTuple):
    """The result of a command: one of RESULTS, why, its kind, its seconds of CPU time, and a line about it."""

    result: str
    reason: str
    kind: str
    seconds: float
    line: str


def world_of(before: BoardState) -> WorldModel:
    """Returns a board's world. Its front is where the arm faces: "front" and "top" are the far side."""
    held = None
    if before.closed:
        held = next((i for i, block in enumerate(before.blocks) if block[:3] == before.arm), None)
    blocks = [(shape, color, x, y, z) for x, y, z, color, shape in before.blocks]
    return board(blocks, held, front="far")


def judged(task: tuple[TreebankSentence, bool]) -> Judged:
    """Returns the result of one command. task: the command, and whether the scene helps to choose the reading."""
    item, scene_chooses = task
    try:
        return _judged(item, scene_chooses)
    except Exception as error:  # a defect in one command must not hide the result of the others
        return Judged("refused", "exception", "exception", 0.0, f"{type(error).__name__}: {error}")


def _judged(item: TreebankSentence, scene_chooses: bool) -> Judged:
    if item.before is None or item.after is None:
        return Judged("refused", "no scene", "no scene", 0.0, "the configuration has no such scene")
    started = time.process_time()
    outcome = interpret_alone(item.text, world_of(item.before), scene_chooses)
    seconds = time.process_time() - started
    kind = "drop" if item.before.closed else "take" if item.after.closed else "move"
    if isinstance(outcome, Plan):
        right = _reached(outcome, item.before, item.after)
        steps = ", ".join(f"{a.verb} {_block(item.before, a.object)} {a.place or ''}" for a in outcome.steps)
        return Judged("right" if right else "wrong", "understood", kind, seconds, steps)
    if isinstance(outcome, Question):
        return Judged("asked", "several things" if outcome.candidates else "open", kind, seconds, outcome.text)
    assert isinstance(outcome, Refusal)
    return Judged("refused", outcome.reason, kind, seconds, outcome.text)


def _block(before: BoardState, index: int | None) -> str:
    return "" if index is None else " ".join(map(str, before.blocks[index]))


def _reached(outcome: Plan, before: BoardState, after: BoardState) -> bool:
    """Returns whether the virtual result is the scene after; where the arm holds a block makes no difference."""
    assert outcome.result is not None
    held = outcome.result.held
    if (held is not None) != after.closed:
        return False
    things = enumerate(outcome.result.things)
    blocks = {(int(t.x), int(t.y), int(t.bottom), t.color, t.kind) for i, t in things if i != held}
    if held is None:
        return blocks == set(after.blocks)
    lifted = [block for block in after.blocks if block[:3] == after.arm]
    return blocks == set(after.blocks) - set(lifted[:1]) and [b[3:] for b in lifted] == [before.blocks[held][3:]]


def main() -> int:
    """Prints the results by kind and reason."""
    options = _arguments().parse_args()
    try:
        data = read(options.data, options.part)
    except OSError as error:
        print(f"error: --data {options.data}: {error}", file=sys.stderr)
        return 2
    tasks = [(item, not options.no_scene) for item in data.items]
    results = list(_judge_all(tasks, options.jobs))
    if options.errors:
        _print_errors(data.items, results)
    _print_table(results)
    if options.out is not None:
        _write(options.out, options.part + ("_without_scene" if options.no_scene else ""), results)
    if data.unreadable:
        print(
            f"{len(data.unreadable)} lines could not be read, the first: {data.unreadable[0][:80]!r}", file=sys.stderr
        )
    if options.json:
        counts = Counter(result.result for result in results)
        print(json.dumps({**{name: counts[name] for name in RESULTS}, "total": len(results)}))
    return 0


def _write(path: Path, section: str, results: list[Judged]) -> None:
    """Replaces one section of the JSON file."""
    times = sorted(1000 * result.seconds for result in results) or [0.0]
    counts = Counter(result.result for result in results)
    sizes = {**{name: counts[name] for name in RESULTS}, "total": len(results)}
    figures = {"counts": sizes, "median_ms": round(statistics.median(times), 1), "worst_ms": round(times[-1], 1)}
    write_section(path, "benchmarks.treebank", section, figures)


def _judge_all(tasks: list[tuple[TreebankSentence, bool]], jobs: int) -> Iterable[Judged]:
    if jobs <= 1:
        return map(judged, tasks)
    with get_context("fork").Pool(jobs) as pool:
        return pool.map(judged, tasks, chunksize=16)


def _print_errors(items: list[TreebankSentence], results: list[Judged]) -> None:
    for item, result in zip(items, results, strict=True):
        if result.result != "right":
            print(f"{result.result} ({result.reason})\t{item.number}\tscene {item.scene}\t{item.text}\n\t{result.line}")


def _print_table(results: list[Judged]) -> None:
    print(f"{'':24}{'right':>8}{'wrong':>8}{'asked':>8}{'refused':>8}{'total':>8}")
    kinds = sorted({result.kind for result in results})
    for kind in [*kinds, "all"]:
        counts = Counter(result.result for result in results if kind in ("all", result.kind))
        total = counts.total()
        print(f"{kind:24}" + "".join(f"{counts[name]:8}" for name in RESULTS) + f"{total:8}")
    total = max(len(results), 1)
    share = Counter(result.result for result in results)
    print(f"{'percent':24}" + "".join(f"{100 * share[name] / total:8.2f}" for name in RESULTS))
    reasons = Counter((result.result, result.reason) for result in results if result.result in ("asked", "refused"))
    for (result, reason), number in reasons.most_common():
        print(f"{result + ': ' + reason:24}{number:8}")
    times = sorted(1000 * result.seconds for result in results) or [0.0]
    print(f"{'CPU milliseconds':24}median {statistics.median(times):.1f}, worst {times[-1]:.1f}")


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--data", type=Path, required=True, help="folder with commands.txt and configuration.txt")
    parser.add_argument("--part", choices=PARTS, default="all", help="which scenes (all)")
    parser.add_argument("--errors", action="store_true", help="list the commands that are not right")
    parser.add_argument("--no-scene", action="store_true", help="choose the reading without the scene's help")
    parser.add_argument("--jobs", type=int, default=1, help="processes (1)")
    parser.add_argument("--out", type=Path, help="JSON file whose section of this part is replaced")
    parser.add_argument("--json", action="store_true", help="print the counts as JSON on the last line")
    return parser


if __name__ == "__main__":
    sys.exit(main())
