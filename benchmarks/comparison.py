"""A matrix of rows as a whole: which of its columns, such as algorithms, is better over all its lines?

By rliable (Agarwal et al., 2021, https://arxiv.org/abs/2108.13264): the interquartile mean over all runs, performance
profiles (the share of runs above a success) and the probability that a run of one column is better than one of another
on the same line. Intervals are 95 % percentiles of a bootstrap that is stratified by line. Only lines count on which
every column has a stored run of every seed: others would compare different tasks.

rliable 1.2.0 needs arch < 8 and pandas < 3, which `pip install -e ".[bench]"` installs.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.row_book import digest_of
from core.system import import_optional

Array = NDArray[np.float64]
Values = Mapping[str, Mapping[str, list[float]]]  # by column and line, those of the stored seeds
LEVELS = (0.5, 0.9, 0.95, 0.97, 0.99)  # of the performance profiles
RESAMPLES = 2000
DIGITS = 4  # of what is stored


def compare(values: Values, seeds: int, former: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return what `results.json` has of a comparison.

    Args:
        values: what is stored; an entry, perhaps empty, for each line of each column.
        seeds: of each run.
        former: the entry of the last writing; it is returned if it is of the same values.

    Raises:
        ConfigError: rliable is needed and not installed.
    """
    columns = list(values)
    every = dict.fromkeys(line for column in columns for line in values[column])
    lines = [line for line in every if all(len(values[column].get(line, ())) == seeds for column in columns)]
    scores = {column: np.array([values[column][line] for line in lines]).T for column in columns}
    code = digest_of(json.dumps([lines, {name: each.tolist() for name, each in scores.items()}]).encode())
    if former and former["values"] == code:
        return dict(former)
    about = {"values": code, "columns": columns, "lines": lines, "of": len(every), "seeds": seeds}
    return about | (statistics(scores) if lines else {})


def statistics(scores: Mapping[str, Array]) -> dict[str, Any]:
    """Return each statistic by column as [value, low, high].

    Args:
        scores: by column, (S, L) of S seeds on L lines.

    Raises:
        ConfigError: rliable is not installed.
    """
    names = ("rliable.library", "rliable.metrics")
    library, metrics = import_optional(*names, extra="bench", what="comparisons of algorithms")

    def measures(runs: Array) -> Array:
        """(1 + levels,) of runs (S, L): the interquartile mean, and the performance profile."""
        return np.array([metrics.aggregate_iqm(runs), *(np.mean(runs > level) for level in LEVELS)])

    pairs = {f"{one} {other}": (scores[one], scores[other]) for one, other in combinations(scores, 2)}
    np.random.seed(0)  # noqa: NPY002  rliable draws from this generator, whatever `random_state` it is given
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # of arch, about that argument
        found = library.get_interval_estimates(dict(scores), measures, reps=RESAMPLES)
        better = library.get_interval_estimates(pairs, probability_of_improvement, reps=RESAMPLES)
    by_column = {name: _rounded(found[0][name], found[1][name]) for name in scores}
    improvement: dict[str, dict[str, list[float]]] = {name: {} for name in scores}
    for pair in pairs:
        one, other = pair.split()
        value, low, high = _rounded(better[0][pair], better[1][pair])[0]
        improvement[one][other] = [value, low, high]
        improvement[other][one] = [round(1 - each, DIGITS) for each in (value, high, low)]
    return {
        "interquartile_mean": {name: rows[0] for name, rows in by_column.items()},
        "profile": {name: dict(zip(map(str, LEVELS), rows[1:], strict=True)) for name, rows in by_column.items()},
        "improvement": improvement,
    }


def probability_of_improvement(one: Array, other: Array) -> float:
    """Return the probability that a run of `one` (S, L) is better than one of `other` (R, L) on the same line.

    A tie counts half. `rliable.metrics.probability_of_improvement` gives the same, and takes 100 times as long.
    """
    return float(np.mean((one[:, None] > other) + 0.5 * (one[:, None] == other)))


def _rounded(values: Any, bounds: Array) -> list[list[float]]:
    """Return [value, low, high] of each of the values. bounds: (2, values)."""
    return np.round([np.ravel(values), *bounds], DIGITS).T.tolist()


def comparison_table(entry: Mapping[str, Any], mark: str) -> list[list[str]]:
    """Return the table of an entry of `compare`, head first. mark: for figures of older code."""
    columns, lines = entry["columns"], entry["lines"]
    share = f"{len(lines)} of {entry['of']}, {entry['seeds']} seeds"
    if not lines:
        return [[share], ["not run"]]

    def row(label: str, cells: Mapping[str, list[float]]) -> list[str]:
        shown = ("{:.3f} ({:.3f}-{:.3f})".format(*cells[name]) + mark if name in cells else "" for name in columns)
        return [label, *shown]

    body = [row("interquartile mean (95 %)", entry["interquartile_mean"])]
    for level in map(str, LEVELS):
        body.append(row(f"runs above {level}", {name: entry["profile"][name][level] for name in columns}))
    for other in columns:
        over = {name: better[other] for name, better in entry["improvement"].items() if other in better}
        body.append(row(f"better than {other}", over))
    return [[share, *columns], *body]
