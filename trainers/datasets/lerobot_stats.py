"""What a LeRobot dataset tells of its numbers, an episode at a time and altogether."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
LOOKED_AT, EVERY = 20, 4  # pictures of an episode, and pixels along each side, that are enough to know their colours

Stats = dict[str, NDArray[np.float64]]  # least, greatest, mean and so on of one feature, and the count


def of_values(values: NDArray) -> Stats:
    """Of a feature's values (T, n), for each of its n numbers."""
    values = values.astype(np.float64)
    out = {"min": values.min(0), "max": values.max(0), "mean": values.mean(0), "std": values.std(0)}
    out["count"] = np.array([len(values)])
    return out | {name: np.quantile(values, share, axis=0) for name, share in QUANTILES.items()}


def of_pictures(pictures: Sequence[NDArray[np.uint8]]) -> Stats:
    """For each colour, (3, 1, 1), in [0, 1]."""
    chosen = np.unique(np.linspace(0, len(pictures) - 1, LOOKED_AT).astype(int))
    pixels = np.stack([pictures[i][::EVERY, ::EVERY] for i in chosen]).reshape(-1, 3) / 255.0
    colours = {name: value.reshape(3, 1, 1) for name, value in of_values(pixels).items() if name != "count"}
    return colours | {"count": np.array([len(chosen)])}


def together(one: Stats | None, other: Stats) -> Stats:
    """Of two stretches' values together. Quantiles are weighted means of theirs, as LeRobot's own are."""
    if one is None:
        return other
    counts = one["count"][0], other["count"][0]
    whole = sum(counts)

    def mean(name: str) -> NDArray[np.float64]:
        return (counts[0] * one[name] + counts[1] * other[name]) / whole

    means = mean("mean")
    variance = sum(
        count * (each["std"] ** 2 + (each["mean"] - means) ** 2)
        for count, each in zip(counts, (one, other), strict=True)
    )
    return {
        "min": np.minimum(one["min"], other["min"]),
        "max": np.maximum(one["max"], other["max"]),
        "mean": means,
        "std": np.sqrt(variance / whole),
        "count": np.array([whole]),
        **{name: mean(name) for name in QUANTILES},
    }


def plain(stats: Stats) -> dict[str, Any]:
    """Lists of numbers."""
    return {name: value.tolist() for name, value in stats.items()}
