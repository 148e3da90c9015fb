"""Lengths and ways over the table, and where a held object can be."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from envs.tasks.types import Array, State
from language import Placed, Scene

CLEAR = 0.08  # metres between other objects and the way that one takes over the table
AIR = 0.15  # metres above the table that a held object begins at most
EDGE = 0.005  # metres about the border of a target in which an object lies there in part
TRIES = 20  # to put a held object where no other one is


def length(vectors: Array) -> Array:
    return np.sqrt((vectors * vectors).sum(-1))


def funnel(offset: Array, height: float, mouth: float) -> Array:
    """(...,) metres to go from offset (..., 3) to the origin, from above, so that nothing on the way is pushed aside.

    Metres beside it, and metres from the height that is wanted there: a metre for each metre further beside than
    `mouth`, up to `height`.
    """
    beside = length(offset[..., :2])
    wanted = np.clip(beside - mouth, 0.0, height)
    return beside + np.abs(offset[..., 2] - wanted)


def horizontal(vectors: Array) -> Array:
    """(..., 3) unit vectors in the same direction over the table."""
    flat = vectors * [1.0, 1.0, 0.0]
    return flat / np.maximum(length(flat), 1e-9)[..., None]


def beside(places: Array, starts: Array, ends: Array) -> Array:
    """Metres from places to the straight ways from starts to ends, all (..., 2 or 3)."""
    way, offset = ends - starts, places - starts
    along = (offset * way).sum(-1) / np.maximum((way * way).sum(-1), 1e-9)
    return length(offset - np.clip(along, 0.0, 1.0)[..., None] * way)


def clear_ways(placed: Placed) -> bool:
    """Whether each real object could go straight to each target, no other one within `CLEAR` of its way."""
    targets = placed.scene.targets
    places, goals = placed.scene.positions[~targets, :2], placed.scene.positions[targets, :2]
    apart = beside(places[None, None], places[:, None, None], goals[None, :, None])  # object, target, other
    itself = np.eye(len(places), dtype=bool)[:, None]
    return bool((itself | (apart >= CLEAR)).all())


def lying(state: State, radius: float) -> Array:
    """(N, K) whether objects lie at a target: 0 or 1, or between them within `EDGE` of its radius, metres."""
    apart = length(state.objects[:, :, None] - state.objects[:, None])
    pairs = state.movable[:, :, None] & state.goals[:, None]
    return np.clip((radius + EDGE - np.where(pairs, apart, np.inf).min(2)) / (2 * EDGE), 0.0, 1.0)


def lifted(
    scene: Scene, referent: int, target: int | None, area: Sequence[float], size: float, spacing: float, rng: Generator
) -> Scene | None:
    """The scene with the referent in the air where no other object is; None where no place was found.

    That is somewhere on a line from over the table to its target: some of the way is left, or little.
    area: x0, x1, y0, y1. size: of objects. All in metres.
    """
    x0, x1, y0, y1 = area
    rest = size / 2
    others = scene.positions[~scene.targets & (np.arange(len(scene)) != referent)]
    places = rng.uniform([x0, y0, rest], [x1, y1, rest + AIR], (TRIES, 3))
    if target is not None:
        places += rng.random((TRIES, 1)) * (scene.positions[target] - places)
    for place in places:
        if (np.linalg.norm((others - place)[:, :2], axis=1) >= spacing).all():
            return put(scene, referent, place)
    return None


def put(scene: Scene, index: int, place: NDArray[np.float64]) -> Scene:
    """The scene with one object at another place (3,)."""
    positions = scene.positions.copy()
    positions[index] = place
    return scene.moved(positions)
