"""Time to a target success rate, of two training runs side by side: ours and a peer's.

Both sides write their evaluations to a metrics.csv with the columns of `trainers.run.metrics`.
`benchmarks/pick_and_place.py` runs them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from trainers.run.metrics import read_metrics

MAX_RATIO = 1 / 3  # of our seconds over the peer's: the claim that is tested
OUR_OVERRIDES = (
    "task=pick_and_place robot=panda algo=sac total_frames=250_000 logger=[] "
    "eval.interval=20_000 eval.interval_episodes=200"
)
COLUMNS = (
    "frames",
    "eval/success_at_end",
    "eval/confirmed",
    "time/evaluation_wait",
    "time/total",
)  # read from metrics.csv


class Evaluation(NamedTuple):
    """One evaluation of a run.

    seconds leaves out the time of this and all earlier evaluations, wall_seconds includes it. success and confirmed are
    shares of episodes; confirmed: in further episodes, None if the success was below the target.
    """

    seconds: float
    wall_seconds: float
    frames: int
    success: float
    confirmed: float | None


def our_overrides(given: Sequence[str], seed: int) -> list[str]:
    """Return the overrides of our side: OUR_OVERRIDES without the keys that are given, those given, and the seed."""
    keys = {word.split("=")[0] for word in given}
    return [*(word for word in OUR_OVERRIDES.split() if word.split("=")[0] not in keys), *given, f"seed={seed}"]


def read_curve(path: Path) -> list[Evaluation]:
    """Return the evaluations in a metrics.csv, ours or the peer's; [] if there is no file."""
    curve, evaluating = [], 0.0
    for row in read_metrics(path):
        evaluating += row["time/evaluation_wait"]
        total, success = row["time/total"], row["eval/success_at_end"]
        confirmed = row.get("eval/confirmed", success)  # our evaluations are long enough without confirmation
        if math.isfinite(success):
            known = confirmed if math.isfinite(confirmed) else None
            curve.append(Evaluation(total - evaluating, total, int(row["frames"]), success, known))
    return curve


def first_at_target(curve: Iterable[Evaluation], target: float) -> Evaluation | None:
    """Return the first evaluation whose confirmed success reaches the target."""
    return next((each for each in curve if each.confirmed is not None and each.confirmed >= target), None)


def summarize(curve: Sequence[Evaluation], target: float) -> dict[str, Any]:
    """Return one side of a pair: the evaluation that reached the target, the last, the best success; or None each."""
    reached = first_at_target(curve, target)
    return {
        "reached": reached._asdict() if reached else None,
        "last": curve[-1]._asdict() if curve else None,
        "best": max((each.success for each in curve), default=None),
    }


def compare_sides(ours: dict[str, Any], peer: dict[str, Any]) -> dict[str, Any]:
    """Return both sides, and our seconds and frames over the peer's.

    If the peer did not reach the target, the ratio to its last evaluation is an upper bound (`at_most`). The ratios are
    None if we did not reach the target, or the peer was never evaluated.
    """
    mark = peer["reached"] or peer["last"]
    ratio: dict[str, Any] = {"seconds": None, "frames": None}
    if ours["reached"] and mark:
        ratio = {name: ours["reached"][name] / mark[name] for name in ratio}
    return {"ours": ours, "peer": peer, "ours_over_peer": {**ratio, "at_most": peer["reached"] is None}}


def ratio_line(pair: dict[str, Any]) -> str:
    """Return the ratios of one pair, and whether the claim (MAX_RATIO) holds."""
    ratio, name = pair["ours_over_peer"], f"{pair['setting']}, seed {pair['seed']}"
    if ratio["seconds"] is None:
        return f"{name}: nothing to compare"
    sign = "<" if ratio["at_most"] else "="
    verdict = "holds" if ratio["seconds"] <= MAX_RATIO else "not shown" if ratio["at_most"] else "does not hold"
    seconds, frames = f"{sign} {ratio['seconds']:.3f} (seconds)", f"{sign} {ratio['frames']:.3f} (frames)"
    return f"{name}: ours/peer {seconds}, {frames}: {verdict}"


def table(pairs: Sequence[dict[str, Any]], target: float) -> str:
    """Return a Markdown table with a row for each side, then a line for each pair."""
    head = ["peer", "seed", "side", f"seconds to {target:.0%}", "with evaluation", "frames", "best", "frames/s"]
    rows = [_side_row(pair, name) for pair in pairs for name in ("ours", "peer")]
    lines = ["| " + " | ".join(line) + " |" for line in (head, ["---"] * len(head), *rows)]
    return "\n".join([*lines, "", *map(ratio_line, pairs)])


def _side_row(pair: dict[str, Any], name: str) -> list[str]:
    side = pair[name]
    mark, head = side["reached"] or side["last"], [pair["setting"], str(pair["seed"]), name]
    if mark is None:
        return [*head, "never evaluated", "-", "-", "-", "-"]
    numbers = [f"{mark['seconds']:,.0f}", f"{mark['wall_seconds']:,.0f}", f"{mark['frames']:,}"]
    shown = [number if side["reached"] else f"not after {number}" for number in numbers]
    return [*head, *shown, f"{side['best']:.2f}", f"{mark['frames'] / mark['seconds']:,.0f}"]
