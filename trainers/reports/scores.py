"""Statistics over the seeds of a configuration: interquartile mean, bootstrap interval, time to a success rate."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from trainers.sweeps.runs import RunRecord

RESAMPLES = 10_000
LEVELS = (0.5, 0.9, 0.95)  # success rates whose first evaluation is reported


def iqm(scores: np.ndarray) -> np.ndarray:
    """Interquartile mean over the last axis: the lowest and the highest quarter, rounded down, are left out.

    Of fewer than four scores none is left out. As in rliable, Agarwal et al. 2021 (arXiv:2108.13264).
    """
    cut = scores.shape[-1] // 4
    return np.sort(scores, -1)[..., cut : scores.shape[-1] - cut].mean(-1)


def bootstrap(strata: Sequence[Sequence[float]], seed: int = 0) -> tuple[float, float]:
    """95 % percentile interval of the interquartile mean of all scores, by stratified bootstrap over seeds.

    The interval covers the variation between seeds, not the sampling error of each seed's episodes.

    Args:
        strata: the scores of each configuration, one a seed; seeds are resampled within each configuration.
        seed: of the resampling.
    """
    rng = np.random.default_rng(seed)
    drawn = [np.asarray(scores)[rng.integers(len(scores), size=(RESAMPLES, len(scores)))] for scores in strata]
    low, high = np.percentile(iqm(np.concatenate(drawn, axis=1)), [2.5, 97.5])
    return float(low), float(high)


def time_to_level(evaluations: Sequence[Mapping[str, float]], level: float) -> tuple[float, float]:
    """Return frames and seconds at the first evaluation with success of at least `level`; infinite without one.

    Args:
        evaluations: rows of metrics.csv, in order.
        level: in [0, 1].
    """
    for row in evaluations:
        if row["eval/success_at_end"] >= level:
            known = row.get("time/evaluated", math.nan)  # earlier versions have not measured it
            return row["frames"], row["time/total"] if math.isnan(known) else known
    return math.inf, math.inf


def final_over_best(run: RunRecord) -> float:
    """Final success over the best success of the evaluations during training; NaN if that is 0."""
    best = max((row["eval/success_at_end"] for row in run.evaluations), default=0.0)
    return result_of(run)["success_at_end"] / best if best else math.nan


def result_of(run: RunRecord) -> dict[str, Any]:
    """Return a finished run's eval.json. Raises ValueError if the run has not finished."""
    if run.result is None:
        raise ValueError(f"{run.folder} has not finished: it has no eval.json")
    return run.result


@dataclass(frozen=True)
class Score:
    """Statistics over the finished runs of one configuration.

    success: interquartile mean of the final success rates. interval: its 95 % bootstrap interval. worst: the run with
    the lowest final success. wrong_object: share of the final episodes, mean over seeds. disturbed: share of
    the successful final episodes, maximum over seeds; None if no run measured it. final_over_best: minimum over
    seeds. frames, seconds: to each of `LEVELS`, median over seeds; infinite if a level was never reached.
    """

    seeds: int
    success: float
    interval: tuple[float, float]
    worst: RunRecord
    wrong_object: float
    disturbed: float | None
    final_over_best: float
    frames: tuple[float, ...]
    seconds: tuple[float, ...]


def score(runs: Sequence[RunRecord]) -> Score:
    """Return the statistics over at least one finished run of a configuration."""
    success = [result_of(run)["success_at_end"] for run in runs]
    times = np.median([[time_to_level(run.evaluations, level) for level in LEVELS] for run in runs], axis=0)
    ratios = [final_over_best(run) for run in runs]
    return Score(
        seeds=len(runs),
        success=float(iqm(np.array(success))),
        interval=bootstrap([success]),
        worst=min(runs, key=lambda run: result_of(run)["success_at_end"]),
        wrong_object=float(np.mean([result_of(run)["wrong_object"] for run in runs])),
        disturbed=max(_measured(runs, "disturbed"), default=None),
        final_over_best=min(ratios, key=lambda ratio: math.inf if math.isnan(ratio) else ratio),
        frames=tuple(times[:, 0]),
        seconds=tuple(times[:, 1]),
    )


def _measured(runs: Sequence[RunRecord], name: str) -> list[float]:
    """This value of each run that has it: older versions measured less."""
    return [value for run in runs if (value := result_of(run).get(name)) is not None]
