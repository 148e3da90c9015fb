"""Random places of objects at reset."""

from __future__ import annotations

import math
from collections.abc import Sequence

from numpy.random import Generator

from conf.schema import ConfigError
from language.spacing import keep_apart
from language.spacing import scatter as scatter_places

TRIES = 200
GROUP = 0.06  # metres from a group's middle to its farthest centres
APART = 0.25  # metres at least between the middles of two groups


def scatter(
    rng: Generator, count: int, area: Sequence[float], spacing: float, height: float
) -> list[tuple[float, float, float]]:
    """`count` places in area (x0, x1, y0, y1), no two centres nearer than spacing; metres.

    Raises ConfigError if the area is too small.
    """
    places = scatter_places(rng, count, area, spacing)
    if places:
        return [(x, y, height) for x, y in places]
    raise ConfigError(
        f"task.num_objects={count} objects with task.spacing={spacing} do not fit workspace.object_area={list(area)}"
    )


def groups(
    rng: Generator, count: int, area: Sequence[float], spacing: float, height: float
) -> list[tuple[float, float, float]]:
    """`count` places in two groups that stand apart: even numbers in one, odd ones in the other; else as `scatter`."""
    x0, x1, y0, y1 = area
    for _ in range(TRIES):
        one, other = rng.uniform([x0, y0], [x1, y1], (2, 2)).tolist()
        if math.dist(one, other) < APART:
            continue
        sizes = ((count + 1) // 2, count // 2)
        members = [_around(rng, middle, size, area, spacing) for middle, size in zip((one, other), sizes, strict=True)]
        if all(members):
            places = [members[k % 2][k // 2] for k in range(count)]
            return [(x, y, height) for x, y in places]
    raise ConfigError(
        f"task.num_objects={count} objects with task.spacing={spacing} do not fit in two groups into "
        f"workspace.object_area={list(area)}"
    )


def _around(
    rng: Generator, middle: Sequence[float], count: int, area: Sequence[float], spacing: float
) -> list[tuple[float, float]]:
    """`count` places around a middle; empty if too few of the candidates fit."""
    x0, x1, y0, y1 = area
    drawn = [(middle[0] + dx, middle[1] + dy) for dx, dy in rng.uniform(-GROUP, GROUP, (20 * count, 2)).tolist()]
    inside = [(x, y) for x, y in drawn if x0 <= x <= x1 and y0 <= y <= y1 and math.dist((x, y), middle) <= GROUP]
    places = keep_apart(inside, count, spacing)
    return places if len(places) == count else []
