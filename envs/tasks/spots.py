"""Spots at a marked place, for the objects that are brought to it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from envs.tasks.free_places import LEVEL, ways_to
from envs.tasks.geometry import length
from envs.tasks.types import Array

SORTED = 0.13  # metres beside a marked place within which an object counts as brought to it
ASIDE = 0.1  # metres from a marked place to the spots around it
ANGLES = np.radians([90, 270, 30, 150, 210, 330])  # of them, from x
SPOTS = np.concatenate((np.zeros((1, 2)), ASIDE * np.stack((np.cos(ANGLES), np.sin(ANGLES)), axis=1)))
APART = 0.09  # metres between the middle of a free spot and all other objects
OUTSIDE = 100.0  # ... for which it is worth to lie where objects may stand


class Spots:
    """The middle of a marked place, and six spots around it.

    Args:
        area: x0, x1, y0, y1 of the objects' centres, metres.
        size: of an object, metres.
    """

    def __init__(self, area: Sequence[float], size: float) -> None:
        self._low, self._high = np.reshape(area, (2, 2)).T
        self._height = size / 2

    def inside(self, marks: Array) -> NDArray[np.bool_]:
        """(..., 7) which spots at marked places lie where objects may stand. marks: (..., 2 or more) metres."""
        spots = marks[..., None, :2] + SPOTS
        return np.all((spots >= self._low) & (spots <= self._high), axis=-1)

    def free(self, objects: Array, real: NDArray[np.bool_], marks: Array) -> Array:
        """(N, K, 3) for each object, the middle if it is free of all others, else the nearest spot that is; metres.

        objects: (N, K, 3) metres. real: (N, K), what stands there. marks: (N, 3) metres.
        """
        spots = marks[:, None, :2] + SPOTS
        ways = ways_to(spots, objects, real, APART) + OUTSIDE * ~self.inside(marks)[:, None]
        ways[..., 0] -= ASIDE  # by which another spot is nearer, at most
        best = spots[np.arange(len(spots))[:, None], ways.argmin(2)]
        return np.concatenate((best, np.full((*best.shape[:2], 1), self._height)), axis=2)


def is_sorted(places: Array, marks: Array, size: float) -> NDArray[np.bool_]:
    """(...) whether objects of this size lie on the table at a marked place. places, marks: (..., 3); metres."""
    level = places[..., 2] < size / 2 + LEVEL
    return level & (length((places - marks)[..., :2]) <= SORTED)
