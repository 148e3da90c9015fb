"""Where the table is free: for tasks that take an object away from where it is, and put it down on the table."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from envs.tasks.shared.geometry import length
from envs.tasks.shared.types import Array, Column, EpisodeSpec, State

APART = 0.12  # metres between the middle of a free place and all other objects
BESIDE = 1.3  # widths between two objects that stand apart
LEVEL = 0.01  # metres above the table up to which an object stands on it
FREE = 0.3  # metres at which the observed offset to a free place is clipped
CLOSE = 0.04  # metres at which a second copy of that offset is clipped, as of the offsets from the gripper
GRID = (4, 9)  # places along x and y that are considered
WORST = 10.0  # a metre of missing clearance counts like this many metres of way
FREE_COLUMNS = (
    Column("metres along x to where the table is free for it", -FREE, FREE),
    Column("metres along y to where the table is free for it", -FREE, FREE),
)
FINE_COLUMNS = tuple(
    Column(f"metres along {axis} to where the table is free for it, clipped at {limit:g}", -limit, limit)
    for limit in (FREE, CLOSE)
    for axis in "xyz"
)


class FreeTable:
    """Places of a table in a grid, and for each object one that was free as the instruction was given.

    Attributes:
        places: (N, K, 3) where the table was free for each object, metres.

    Args:
        area: x0, x1, y0, y1 of the objects' centres, metres.
        size: of an object, metres.
        worlds, slots: N and K.
    """

    def __init__(self, area: Sequence[float], size: float, worlds: int, slots: int) -> None:
        x0, x1, y0, y1 = area
        xs, ys = (np.linspace(low, high, count) for low, high, count in zip((x0, y0), (x1, y1), GRID, strict=True))
        self._grid = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
        self._size = size
        self.places = np.zeros((worlds, slots, 3))

    def nearest(self, objects: Array, shown: NDArray[np.bool_]) -> Array:
        """(N, K, 3) for each object, a place near it that is free of all others, metres.

        objects: (N, K, 3) positions, metres. shown: (N, K) which slots hold an object.
        """
        best = self._grid[ways_to(self._grid, objects, shown, APART).argmin(2)]
        return np.concatenate((best, np.full((*best.shape[:2], 1), self._size / 2)), axis=2)

    def note(self, worlds: NDArray[np.int64], state: State) -> None:
        """Find the places anew in these worlds, where an instruction begins."""
        self.places[worlds] = self.nearest(state.objects[worlds], state.shown[worlds])

    def offsets(self, state: State) -> Array:
        """(N, K, 3) metres from each object to its place."""
        return self.places - state.objects

    def described(self, episode: EpisodeSpec) -> Array:
        """(K, 3) metres from each object to where the table is free for it, as the episode begins."""
        places = episode.scene.positions
        return self.nearest(places[None], np.ones((1, len(places)), bool))[0] - places

    def stands(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether the referents stand on the table, beside all other objects."""
        heights = state.objects[np.arange(len(state.referent)), state.referent, 2]
        return (heights < self._size / 2 + LEVEL) & stands_apart(state, state.shown, self._size)


def ways_to(places: Array, objects: Array, real: NDArray[np.bool_], clearance: float) -> Array:
    """Return the ways of objects to places; one that other objects leave no room at counts as further away.

    Args:
        places: (P, 2), or (N, P, 2) for each world, metres.
        objects: (N, K, 3) positions, metres.
        real: (N, K) which slots hold an object that needs room.
        clearance: metres between a place and all other objects, with which there is room.

    Returns:
        (N, K, P) metres, `WORST` more for each metre that is lacking.
    """
    slots = np.arange(objects.shape[1])
    apart = length(places[..., :, None, :] - objects[:, None, :, :2])  # world, place, object
    others = real[:, None] & (slots != slots[:, None])  # world, object, other
    clear = np.where(others[:, :, None], apart[:, None], np.inf).min(3)  # world, object, place
    return apart.transpose(0, 2, 1) + WORST * np.maximum(clearance - clear, 0.0)


def stands_apart(state: State, real: NDArray[np.bool_], size: float) -> NDArray[np.bool_]:
    """(N,) whether the referents stand apart from all other objects. real: (N, K) which count. size: metres."""
    rows = np.arange(len(real))
    others = real.copy()
    others[rows, state.referent] = False
    place = state.objects[rows, state.referent]
    apart = length((state.objects - place[:, None])[..., :2]).min(1, where=others, initial=np.inf)
    return apart >= BESIDE * size
