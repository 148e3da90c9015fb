"""What several seeds of one configuration came to: interquartile mean, bootstrap interval, time to success."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from trainers.sweeps.runs import Run

RESAMPLES = 10_000
LEVELS = (0.5, 0.9, 0.95)  # success ratios to be reached


def iqm(scores: np.ndarray) -> np.ndarray:
    """Interquartile mean over the last axis: without the lowest and the highest quarter, rounded down.

    Of fewer than four scores none is left out. As in rliable, Agarwal et al. 2021 (arXiv:2108.13264).
    """
    cut = scores.shape[-1] // 4
    return np.sort(scores, -1)[..., cut : scores.shape[-1] - cut].mean(-1)


def bootstrap(strata: Sequence[Sequence[float]], seed: int = 0) -> tuple[float, float]:
    """95 % percentile interval of the interquartile mean of all scores.

    strata: the scores of each configuration, one a seed; seeds are drawn again within each. Tells what other seeds
    would give, not how many episodes each was judged on.
    """
    rng = np.random.default_rng(seed)
    drawn = [np.asarray(scores)[rng.integers(len(scores), size=(RESAMPLES, len(scores)))] for scores in strata]
    low, high = np.percentile(iqm(np.concatenate(drawn, axis=1)), [2.5, 97.5])
    return float(low), float(high)


def reached(evaluated: Sequence[Mapping[str, float]], level: float) -> tuple[float, float]:
    """Frames and seconds at the first evaluation in which success was at least `level`; infinite where it never was.

    evaluated: rows of metrics.csv, in order.
    """
    for row in evaluated:
        if row["eval/success_at_end"] >= level:
            return row["frames"], row["time/total"]
    return math.inf, math.inf


def kept(run: Run) -> float:
    """Success at the end over the best success along the way, NaN where it never had any."""
    best = max((row["eval/success_at_end"] for row in run.evaluated), default=0.0)
    return result(run)["success_at_end"] / best if best else math.nan


def result(run: Run) -> dict[str, Any]:
    """A finished run's eval.json."""
    assert run.result is not None
    return run.result


@dataclass(frozen=True)
class Score:
    """Finished runs of one configuration.

    frames, seconds: to each of `LEVELS`, median over seeds; infinite where it was never reached.
    """

    seeds: int
    success: float  # interquartile mean
    interval: tuple[float, float]
    worst: Run
    wrong: float  # share of episodes that ended at the wrong object, mean over seeds
    kept: float  # of the seed that kept least of its best
    frames: tuple[float, ...]
    seconds: tuple[float, ...]


def score(runs: Sequence[Run]) -> Score:
    """runs: finished, at least one."""
    success = [result(run)["success_at_end"] for run in runs]
    times = np.median([[reached(run.evaluated, level) for level in LEVELS] for run in runs], axis=0)
    return Score(
        seeds=len(runs),
        success=float(iqm(np.array(success))),
        interval=bootstrap([success]),
        worst=min(runs, key=lambda run: result(run)["success_at_end"]),
        wrong=float(np.mean([result(run)["wrong_object"] for run in runs])),
        kept=min((kept(run) for run in runs), key=lambda share: math.inf if math.isnan(share) else share),
        frames=tuple(times[:, 0]),
        seconds=tuple(times[:, 1]),
    )
