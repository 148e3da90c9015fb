"""A board with stacks: the world that words are about, and the object that marks a place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from envs.interactive.interactive_env import InteractiveEnv
from envs.tasks.board import Grid
from language import WorldModel, board
from language.talk import name
from language.world import BOARD_HEIGHT, FLAT

HIDDEN = -5.0  # metres: the height of a see-through object that marks no place


def grid_of(env: InteractiveEnv) -> Grid:
    """The cells of the board."""
    return Grid(env.config.workspace.object_area, env.config.task.spacing, env.config.task.object_size)


def movable(env: InteractiveEnv) -> NDArray[np.int64]:
    """The numbers in `env.scene()` of the objects that words are about: all but see-through ones."""
    return np.flatnonzero(~env.scene().targets)


def world_of(env: InteractiveEnv, viewpoint: str | None = None) -> WorldModel:
    """The board as the language sees it; its things are the movable objects in their order.

    viewpoint: of left and right; None: the task's.
    """
    scene, numbers = env.scene(), movable(env)
    cells = grid_of(env).cells(scene.positions[numbers])
    cells[:, 2] = np.minimum(cells[:, 2], BOARD_HEIGHT - 1)
    slots = np.flatnonzero(env.sight.state.shown[0])[numbers]
    held = next(iter(np.flatnonzero(slots == env.sight.state.held[0]).tolist()), None)
    kinds = env.shapes()
    blocks = [(kinds[i], scene[i].color, *map(int, cell)) for i, cell in zip(numbers, cells, strict=True)]
    return board(blocks, held, viewpoint=viewpoint or scene.viewpoint)


def object_names(env: InteractiveEnv, viewpoint: str) -> list[str]:
    """The name of each object in `env.scene()`, from this viewpoint."""
    world, names = world_of(env, viewpoint), ["the see-through object"] * len(env.scene())
    for thing, number in enumerate(movable(env)):
        names[number] = name(world, thing)
    return names


def example(env: InteractiveEnv, viewpoint: str) -> str:
    """A sentence that is possible on this board, about things whose names fit no other, from this viewpoint."""
    world = world_of(env, viewpoint)
    kinds = [(thing.color, thing.kind) for thing in world.things]
    free = [
        i for i, above in enumerate(world.above) if above is None and i != world.held and kinds.count(kinds[i]) == 1
    ]
    flat = [i for i in free if world.things[i].kind in FLAT]
    if len(flat) > 1:
        return f"put {name(world, flat[0])} on {name(world, flat[1])}"
    return f"put {name(world, free[0])} in the back left corner" if free else "take the leftmost block"


def mark(env: InteractiveEnv, place: Sequence[float] | NDArray[np.float64] | None) -> None:
    """Shows a see-through object at a place, metres; None: hides it. Tables keep theirs."""
    if not env.task.traits.stacks:
        return
    scene = env.scene()
    for number in np.flatnonzero(scene.targets).tolist():
        env.put_object(number, (*scene.positions[number, :2], HIDDEN) if place is None else tuple(place))


def free_place(env: InteractiveEnv, index: int, x: float, y: float) -> tuple[float, float, float]:
    """The place of an object in the cell nearest to x, y, on top of what stands there; all in metres."""
    grid, world = grid_of(env), world_of(env)
    column, row, _ = grid.cells(np.array([[x, y, 0.0]]))[0].tolist()
    thing = int(np.flatnonzero(movable(env) == index)[0])
    return tuple(grid.place(column, row, len(world.column(column, row, thing))).tolist())
