"""Statistics of the features of a LeRobot dataset, for each episode and over all episodes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
SAMPLED_IMAGES, PIXEL_STRIDE = 20, 4  # of an episode: enough for the statistics of its colours

Stats = dict[str, NDArray[np.float64]]  # minimum, maximum, mean, ... of one feature, and the count


def of_values(values: NDArray) -> Stats:
    """Statistics of a feature's values (T, n), for each of its n numbers."""
    values = values.astype(np.float64)
    out = {"min": values.min(0), "max": values.max(0), "mean": values.mean(0), "std": values.std(0)}
    out["count"] = np.array([len(values)])
    return out | {name: np.quantile(values, share, axis=0) for name, share in QUANTILES.items()}


def of_images(images: Sequence[NDArray[np.uint8]]) -> Stats:
    """Statistics of each colour channel, (3, 1, 1), in [0, 1]. images: (H, W, 3) each."""
    chosen = np.unique(np.linspace(0, len(images) - 1, SAMPLED_IMAGES).astype(int))
    pixels = np.stack([images[i][::PIXEL_STRIDE, ::PIXEL_STRIDE] for i in chosen]).reshape(-1, 3) / 255.0
    colours = {name: value.reshape(3, 1, 1) for name, value in of_values(pixels).items() if name != "count"}
    return colours | {"count": np.array([len(chosen)])}


def merge(one: Stats | None, other: Stats) -> Stats:
    """Statistics over the values of two sets. Quantiles are weighted means of both, as in LeRobot itself."""
    if one is None:
        return other
    counts = one["count"][0], other["count"][0]
    total = sum(counts)

    def mean(name: str) -> NDArray[np.float64]:
        return (counts[0] * one[name] + counts[1] * other[name]) / total

    means = mean("mean")
    variance = sum(
        count * (each["std"] ** 2 + (each["mean"] - means) ** 2)
        for count, each in zip(counts, (one, other), strict=True)
    )
    return {
        "min": np.minimum(one["min"], other["min"]),
        "max": np.maximum(one["max"], other["max"]),
        "mean": means,
        "std": np.sqrt(variance / total),
        "count": np.array([total]),
        **{name: mean(name) for name in QUANTILES},
    }


def as_lists(stats: Stats) -> dict[str, Any]:
    """The statistics as lists of numbers."""
    return {name: value.tolist() for name, value in stats.items()}
