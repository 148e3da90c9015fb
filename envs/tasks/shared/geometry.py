"""Distances and straight paths over the table, and places for objects and for a held object."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.errors import ConfigError
from envs.tasks.shared.types import Array, State
from language import Placed, Scene
from language.spacing import keep_apart
from language.spacing import scatter as scatter_places

CLEAR = 0.08  # least distance of other objects from the straight path of an object over the table, metres
AIR = 0.15  # greatest height above the table at which a held object begins, metres
EDGE = 0.005  # metres about the border of a target within which an object counts in part
WAY = 1.7  # width of the path that must be free, in widths of an object: the held object and a margin
TRIES = 20  # places drawn at most for a held object
LAYOUT_TRIES = 200
GROUP = 0.06  # metres from a group's middle to its farthest centres
APART = 0.25  # metres at least between the middles of two groups


def length(vectors: Array) -> Array:
    return np.sqrt((vectors * vectors).sum(-1))


def funnel(offset: Array, height: float | Array, mouth: float, slope: float = 1.0) -> Array:
    """(...,) metres from offset (..., 3) to the origin along a funnel, which approaches from above.

    Horizontal distance plus |z - z*|. z* rises by `slope` with the horizontal distance beyond `mouth`, capped at
    `height`, one for all or (...,).
    """
    beside = length(offset[..., :2])
    wanted = np.clip(slope * (beside - mouth), 0.0, height)
    return beside + np.abs(offset[..., 2] - wanted)


def horizontal(vectors: Array) -> Array:
    """(..., 3) unit vectors of the horizontal parts."""
    flat = vectors * [1.0, 1.0, 0.0]
    return flat / np.maximum(length(flat), 1e-9)[..., None]


def distance_to_segment(places: Array, starts: Array, ends: Array) -> Array:
    """(...,) metres from places to the segments from starts to ends, all (..., 2 or 3)."""
    way, offset = ends - starts, places - starts
    along = (offset * way).sum(-1) / np.maximum((way * way).sum(-1), 1e-9)
    return length(offset - np.clip(along, 0.0, 1.0)[..., None] * way)


def tops_on_the_way(places: Array, which: NDArray[np.bool_], *, starts: Array, ends: Array, size: float) -> Array:
    """(N, M) height of the tops of objects on the straight paths to `ends`, metres; 0 where there are none.

    Args:
        places: (N, K, 3) of objects, metres.
        which: (N, M, K) those that count, for each way.
        starts, ends: (N, 2) and (N, M, 2) of the ways, metres.
        size: width and height of an object, metres.
    """
    beside = distance_to_segment(places[:, None, :, :2], starts[:, None, None], ends[:, :, None])
    return np.where(which & (beside < WAY * size), places[:, None, :, 2] + size / 2, 0.0).max(2)


def paths_are_clear(placed: Placed) -> bool:
    """Return whether no object is within `CLEAR` of the straight path of another one to a target."""
    targets = placed.scene.targets
    places, goals = placed.scene.positions[~targets, :2], placed.scene.positions[targets, :2]
    apart = distance_to_segment(
        places[None, None], places[:, None, None], goals[None, :, None]
    )  # object, target, other
    itself = np.eye(len(places), dtype=bool)[:, None]
    return bool((itself | (apart >= CLEAR)).all())


def share_at_goal(state: State, radius: float) -> Array:
    """(N, K) 1 for objects at a target, 0 for others, and linear within `EDGE` metres of the target's radius."""
    apart = length(state.objects[:, :, None] - state.objects[:, None])
    pairs = state.movable[:, :, None] & state.goals[:, None]
    return np.clip((radius + EDGE - np.where(pairs, apart, np.inf).min(2)) / (2 * EDGE), 0.0, 1.0)


# ---- places for a held object


def lifted(
    scene: Scene,
    referent: int,
    target: int | None,
    *,
    area: Sequence[float],
    size: float,
    spacing: float,
    rng: Generator,
) -> Scene | None:
    """Return the scene with the referent in the air, away from all other objects.

    The place lies on a line from a random place above the table to the target.

    Args:
        scene: the objects.
        referent, target: their numbers; target None: there is none.
        area: x0, x1, y0, y1, metres.
        size: of objects, metres.
        spacing: least distance to other objects, metres.
        rng: of the draws.

    Returns:
        The scene; None if no place was found.
    """
    others = scene.positions[~scene.targets & (np.arange(len(scene)) != referent)]
    for place in places_in_air(area, size, None if target is None else scene.positions[target], rng):
        if (np.linalg.norm((others - place)[:, :2], axis=1) >= spacing).all():
            return with_object_at(scene, referent, place)
    return None


def places_in_air(
    area: Sequence[float], size: float, goal: NDArray[np.float64] | None, rng: Generator
) -> NDArray[np.float64]:
    """Random places above the table or, with a goal, on lines from such places to the goal.

    Args:
        area: x0, x1, y0, y1, metres.
        size: of objects, metres.
        goal: (3,) metres, or None.
        rng: of the draws.

    Returns:
        (TRIES, 3) metres.
    """
    x0, x1, y0, y1 = area
    places = rng.uniform([x0, y0, size / 2], [x1, y1, size / 2 + AIR], (TRIES, 3))
    if goal is not None:
        places += rng.random((TRIES, 1)) * (goal - places)
    return places


def with_object_at(scene: Scene, index: int, place: NDArray[np.float64]) -> Scene:
    """Return the scene with one object at another place (3,)."""
    positions = scene.positions.copy()
    positions[index] = place
    return scene.moved(positions)


# ---- places for the objects of a scene


def scatter(
    rng: Generator, count: int, *, area: Sequence[float], spacing: float, height: float
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
    rng: Generator, count: int, *, area: Sequence[float], spacing: float, height: float
) -> list[tuple[float, float, float]]:
    """`count` places in two groups that stand apart: even numbers in one, odd ones in the other; else as `scatter`."""
    x0, x1, y0, y1 = area
    for _ in range(LAYOUT_TRIES):
        one, other = rng.uniform([x0, y0], [x1, y1], (2, 2)).tolist()
        if math.dist(one, other) < APART:
            continue
        sizes = ((count + 1) // 2, count // 2)
        members = [
            _around(rng, middle, size, area=area, spacing=spacing)
            for middle, size in zip((one, other), sizes, strict=True)
        ]
        if all(members):
            places = [members[k % 2][k // 2] for k in range(count)]
            return [(x, y, height) for x, y in places]
    raise ConfigError(
        f"task.num_objects={count} objects with task.spacing={spacing} do not fit in two groups into "
        f"workspace.object_area={list(area)}"
    )


def _around(
    rng: Generator, middle: Sequence[float], count: int, *, area: Sequence[float], spacing: float
) -> list[tuple[float, float]]:
    """`count` places around a middle; empty if too few of the candidates fit."""
    x0, x1, y0, y1 = area
    drawn = [(middle[0] + dx, middle[1] + dy) for dx, dy in rng.uniform(-GROUP, GROUP, (20 * count, 2)).tolist()]
    inside = [(x, y) for x, y in drawn if x0 <= x <= x1 and y0 <= y <= y1 and math.dist((x, y), middle) <= GROUP]
    places = keep_apart(inside, count, spacing)
    return places if len(places) == count else []
