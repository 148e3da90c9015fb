"""Commands on a board with stacks: the world that words are about, the dialogue, and the subtasks of its steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from demo.dialogue import MAX_CHARACTERS, Dialogue, Interpretation, PointedObjects, of_outcome
from demo.planning import Planner, Subtask
from envs.experts.board import moves_of
from envs.interactive.interactive_env import InteractiveEnv
from envs.tasks.board import Grid
from language import Scene, commands
from language.commands.naming import name
from language.commands.world import BOARD_HEIGHT, FLAT, World, board

HIDDEN = -5.0  # metres: the height of a see-through object that marks no place


def grid_of(env: InteractiveEnv) -> Grid:
    """The cells of the board."""
    return Grid(env.config.workspace.object_area, env.config.task.spacing, env.config.task.object_size)


def movable(env: InteractiveEnv) -> NDArray[np.int64]:
    """The numbers in `env.scene()` of the objects that words are about: all but see-through ones."""
    return np.flatnonzero(~env.scene().targets)


def world_of(env: InteractiveEnv) -> World:
    """The board as the language sees it; its things are the movable objects in their order."""
    scene, numbers = env.scene(), movable(env)
    cells = grid_of(env).cells(scene.positions[numbers])
    cells[:, 2] = np.minimum(cells[:, 2], BOARD_HEIGHT - 1)
    slots = np.flatnonzero(env.state.shown[0])[numbers]
    held = next(iter(np.flatnonzero(slots == env.state.held[0]).tolist()), None)
    kinds = env.shapes()
    blocks = [(kinds[i], scene[i].color, *map(int, cell)) for i, cell in zip(numbers, cells, strict=True)]
    return board(blocks, held, viewpoint=scene.viewpoint)


def object_names(env: InteractiveEnv) -> list[str]:
    """The name of each object in `env.scene()`."""
    world, names = world_of(env), ["the see-through object"] * len(env.scene())
    for thing, number in enumerate(movable(env)):
        names[number] = name(world, thing)
    return names


def example(env: InteractiveEnv) -> str:
    """A sentence that is possible on this board, about things whose names fit no other."""
    world = world_of(env)
    kinds = [(thing.color, thing.kind) for thing in world.things]
    free = [
        i for i, above in enumerate(world.above) if above is None and i != world.held and kinds.count(kinds[i]) == 1
    ]
    flat = [i for i in free if world.things[i].kind in FLAT]
    if len(flat) > 1:
        return f"put {name(world, flat[0])} on {name(world, flat[1])}"
    return f"put {name(world, free[0])} in the back left corner" if free else "take the leftmost block"


class BoardDialogue(Dialogue):
    """A dialogue about the objects on a board. Interpretations number objects as `env.scene()` does."""

    def __init__(self, env: InteractiveEnv) -> None:
        super().__init__()
        self._env = env

    def preview(self, sentence: str, scene: Scene, pointed: PointedObjects) -> Interpretation:
        return self._answer(sentence, replace(self._commands, history=[*self._commands.history]))

    def hear(self, sentence: str, scene: Scene, pointed: PointedObjects) -> Interpretation:
        return self._answer(sentence, self._commands)

    def _answer(self, sentence: str, dialogue: commands.Dialogue) -> Interpretation:
        outcome = dialogue.answer(sentence[:MAX_CHARACTERS], world_of(self._env))
        message = getattr(outcome, "text", "")
        if isinstance(outcome, commands.Refusal) and outcome.reason == "syntax":
            message += f" (for example: {example(self._env)})"
        found = of_outcome(outcome, Interpretation(outcome.sentence, None, message))
        numbers = movable(self._env).tolist()
        actions = tuple(_renumbered(action, numbers) for action in found.actions)
        return replace(found, actions=actions, candidates=tuple(numbers[i] for i in found.candidates))


def _renumbered(action: commands.Action, numbers: Sequence[int]) -> commands.Action:
    thing = None if action.object is None else numbers[action.object]
    return replace(action, object=thing, on=None if action.on is None else numbers[action.on])


def plan(actions: Sequence[commands.Action], env: InteractiveEnv, planner: Planner | None = None) -> list[Subtask]:
    """A subtask for each object that is taken or brought to a place.

    Args:
        actions: the steps of a command.
        env: on a board.
        planner: chooses the words for a policy; None: no policy drives.

    Raises:
        LanguageError: a step moves nothing.
    """
    scene, grid = env.scene(), grid_of(env)
    cells = [(float(x), float(y)) for x, y, _ in grid.cells(scene.positions)]
    marker = next(iter(np.flatnonzero(scene.targets).tolist()), None)
    subtasks = []
    for move in moves_of(actions, cells, range(len(scene)), grid):
        target = marker if move.release else None
        sentence = "" if planner is None or target is None else planner.policy_sentence(None, move.thing, target)
        subtasks.append(Subtask(sentence, move.thing, target, move))
    return subtasks


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
