"""The rows of the observation `objects`: one for each slot, with the attributes of the object in it.

The columns in their order:

1. position (m) and quaternion (x, y, z, w);
2. RGBA (A of a target: 0.5), shape one-hot, size (m) and role (1: target), constant during an episode;
3. where the task moves objects: the offset from the gripper, clipped at `NEAR`, and again at `CLOSE`;
4. the task's own `columns`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from envs.tasks import Task
from language import COLORS, DEVICES, NOUNS, SEE_THROUGH, SHAPES, Scene, color_name, color_table

Array = NDArray[np.float64]
NEAR, CLOSE = 0.2, 0.04  # metres at which offsets are clipped: grasping needs the finer scale
OBJECT_WIDTH = 3 + 4 + 4 + len(SHAPES) + 1 + 1
COLOR = slice(7, 10)  # red, green, blue
ATTRIBUTES = slice(7, OBJECT_WIDTH)  # constant during an episode: colour, shape, size, role
OFFSET = slice(OBJECT_WIDTH, OBJECT_WIDTH + 6)  # the offsets from the gripper, if any
COLUMNS = slice(OFFSET.stop, None)  # the task's own columns, if any
FACING = slice(OFFSET.stop, OFFSET.stop + 2)  # of devices: where they face
MAX_SIZE = 0.2  # metres
# Each noun's row in a table of one-hots: among shapes alone, or among devices alone. The last row is 0.
_NONE = len(SHAPES)
_SHAPE = np.array([SHAPES.index(noun) if noun in SHAPES else _NONE for noun in NOUNS])
_DEVICE = np.array([DEVICES.index(noun) if noun in DEVICES else _NONE for noun in NOUNS])
_ONE_HOTS = np.eye(_NONE + 1, _NONE)
_COLORS = color_table()


def row_bounds(task: Task, low: Array, high: Array) -> tuple[list, list]:
    """Return the least and greatest values of a row, in parts to concatenate.

    Args:
        task: of the rows.
        low, high: (3,) bounds of positions, metres.
    """
    rest = OBJECT_WIDTH - 7 - 2
    least: list = [low, -np.ones(4), np.zeros(rest), [0.0, 0.0]]
    greatest: list = [high, np.ones(4), np.ones(rest), [MAX_SIZE, 1.0]]
    if task.traits.moves:
        limit = np.repeat((NEAR, CLOSE), 3)
        least += [-limit, [column.low for column in task.columns]]
        greatest += [limit, [column.high for column in task.columns]]
    return least, greatest


def column_names(task: Task) -> list[str]:
    """Return a name for each column of a task's rows."""
    kinds = DEVICES if task.traits.operates else SHAPES
    axes = ("x", "y", "z")
    names = [*axes, *(f"quaternion {axis}" for axis in (*axes, "w")), "red", "green", "blue", "alpha"]
    names += [*(kinds[i] if i < len(kinds) else "no shape" for i in range(len(SHAPES))), "size", "target"]
    if task.traits.moves:
        names += [f"{axis} from the gripper, at most {limit} m" for limit in (NEAR, CLOSE) for axis in axes]
        names += [column.name for column in task.columns]
    return names


def attributes(scene: Scene) -> Array:
    """(K, OBJECT_WIDTH - 7) the part of each object's row that is constant during an episode."""
    alone = not (_DEVICE[scene.nouns] == _NONE).any()
    return attribute_rows(scene.nouns, scene.colors, sizes=scene.sizes, targets=scene.targets, devices=alone)


def attribute_rows(
    nouns: NDArray[np.int64],
    colors: NDArray[np.int64],
    *,
    sizes: Array,
    targets: NDArray[np.bool_],
    devices: bool = False,
) -> Array:
    """(K, OBJECT_WIDTH - 7) as `attributes`, from numbers of nouns and colours (K,), sizes (K,), metres, and targets
    (K,). devices: whether all objects are devices."""
    kinds = _ONE_HOTS[_DEVICE[nouns] if devices else _SHAPE[nouns]]
    painted = _COLORS[colors]
    painted[targets, 3] = SEE_THROUGH
    return np.concatenate((painted, kinds, sizes[:, None], targets[:, None]), axis=1)


def static_rows(scene: Scene, yaw: Array | None) -> Array:
    """(K, OBJECT_WIDTH) the rows of objects that rest where the scene has them. yaw: (K,) radians; None: 0."""
    half = (np.zeros(len(scene)) if yaw is None else yaw) / 2
    quaternions = np.stack((np.zeros_like(half), np.zeros_like(half), np.sin(half), np.cos(half)), axis=1)
    return np.concatenate((scene.positions, quaternions, attributes(scene)), axis=1)


def nouns_of_rows(rows: NDArray, devices: bool = False, fixtures: Sequence[str] = ()) -> NDArray[np.int64]:
    """(K,) indices into `language.NOUNS` of the objects that rows (K, D) describe.

    Args:
        rows: (K, D).
        devices: whether all objects are devices.
        fixtures: the nouns that the first of the task's own columns mark.
    """
    nouns: tuple[str, ...] = DEVICES if devices else SHAPES
    kinds = rows[:, 11 : 11 + len(nouns)]
    if fixtures:
        marks = rows[:, COLUMNS.start : COLUMNS.start + len(fixtures)]
        nouns, kinds = (*SHAPES, *fixtures), np.concatenate((kinds, marks), axis=1)
    return np.array([list(NOUNS).index(noun) for noun in nouns])[kinds.argmax(1)]


def scene_of_rows(rows: NDArray, viewpoint: str = "robot", nouns: NDArray[np.int64] | None = None) -> Scene:
    """Return the scene that rows (K, D) describe: the inverse of `static_rows`. nouns: (K,); None: the rows' shapes."""
    return Scene.from_arrays(
        nouns=nouns_of_rows(rows) if nouns is None else nouns,
        colors=[list(COLORS).index(color_name(color)) for color in rows[:, 7:11]],
        positions=rows[:, :3],
        size=rows[:, OBJECT_WIDTH - 2],
        targets=rows[:, OBJECT_WIDTH - 1] > 0.5,
        viewpoint=viewpoint,
    )


def offsets(positions: Array, origin: Array) -> Array:
    """(..., 6) metres from `origin` to positions, both (..., 3): twice, since each copy is clipped on its own."""
    offset = positions - origin
    return np.concatenate((offset, offset), axis=-1)
