"""Random places that keep a distance from each other, by rejection sampling."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TypeVar

from numpy.random import Generator

TRIES = 1000
ROUNDING = 1e-9  # metres, tolerance of the spacing for rounding errors

Place = TypeVar("Place", bound=Sequence[float])


def keep_apart(
    candidates: Iterable[Place], count: int, spacing: float, others: Sequence[Sequence[float]] = ()
) -> list[Place]:
    """The first `count` candidates that are apart from each other and from `others`; fewer if too few are.

    Args:
        candidates, others: places (x, y, ...), metres.
        count: of places, at least 1.
        spacing: smallest distance in the table's plane, metres.
    """
    kept: list[Place] = []
    taken = list(others)
    for place in candidates:
        if all(math.hypot(place[0] - other[0], place[1] - other[1]) >= spacing - ROUNDING for other in taken):
            kept.append(place)
            taken.append(place)
            if len(kept) == count:
                break
    return kept


def scatter(rng: Generator, count: int, area: Sequence[float], spacing: float) -> list[tuple[float, float]]:
    """`count` places (x, y) in area (x0, x1, y0, y1), metres, uniform except for the spacing; [] if they do not fit."""
    x0, x1, y0, y1 = area
    for _ in range(TRIES):
        drawn = [(x0 + u * (x1 - x0), y0 + v * (y1 - y0)) for u, v in rng.random((8 * count, 2)).tolist()]
        places = keep_apart(drawn, count, spacing)
        if len(places) == count:
            return places
    return []
