"""Carries out a list of moves in one world: which object goes where, and whether it is left there.

`moves_of` makes them from the steps of a command that was understood on a board.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from conf.schema import ConfigError
from envs.experts.rearrange import Carrier
from envs.workspace_env import WorkspaceEnv
from language import LanguageError
from language.commands import Action
from language.commands.world import BOARD_HEIGHT

MAX_STEPS = 200  # control steps of a move
RISE = 0.03  # metres that the gripper rises from a released object before the next move
HELD_THERE = 0.006  # metres from its place, along each axis, within which a held object has arrived
Cells = Sequence[tuple[float, float]]
CARRIED = ("place", "push")  # kinds of steps that bring an object to a place


@dataclass(frozen=True)
class Move:
    """Brings an object to a place.

    thing: its number among the objects that are shown, as in `InteractiveEnv.scene`. place: (3,) its centre in the end,
    metres. release: whether it is released there; otherwise it stays in the gripper, in the air.
    """

    thing: int
    place: Sequence[float] | NDArray[np.float64]
    release: bool = True


def without_takes(actions: Sequence[Action]) -> list[Action]:
    """The steps without each "take" whose object the next step places, since placing includes taking."""
    following = [*actions[1:], None]
    return [
        action
        for action, after in zip(actions, following, strict=True)
        if not (action.kind == "take" and after and after.kind in CARRIED and after.object == action.object)
    ]


class Places(Protocol):
    """Where objects may be: the cells of a `Grid`, or a table."""

    def place(self, column: float, row: float, level: float) -> NDArray[np.float64]:
        """(3,) the centre of an object there, metres."""
        ...


def moves_of(
    actions: Sequence[Action], cells: Cells, numbers: Sequence[int], grid: Places, hold: float = BOARD_HEIGHT - 1
) -> list[Move]:
    """The moves that carry out the steps of a command.

    An object that is taken and not placed by the next step is held over where it stood.

    Args:
        actions: the steps; places are in cells, or whatever `grid` takes.
        cells: column and row of each object that a step may name, before the first step.
        numbers: for each of these objects, its number among the objects that are shown.
        grid: the board's cells, or another kind of places.
        hold: the level at which an object is held; on a board, the highest one.

    Raises:
        LanguageError: for a step that moves nothing on a board, such as "press".
    """
    return list(_moves(without_takes(actions), dict(enumerate(cells)), numbers, grid, hold))


def _moves(
    actions: Sequence[Action],
    cells: dict[int, tuple[float, float]],
    numbers: Sequence[int],
    grid: Places,
    hold: float,
) -> Iterator[Move]:
    for action in actions:
        if action.kind == "nothing":
            continue
        if action.object is None or action.kind not in (*CARRIED, "take"):
            raise LanguageError(f"'{action.kind}' moves nothing on a board: say what to take, or where to put it")
        if action.kind == "take":
            over = grid.place(*cells[action.object], hold)
            yield Move(int(numbers[action.object]), over, release=False)
        else:
            assert action.position is not None
            cells[action.object] = action.position
            yield Move(int(numbers[action.object]), grid.place(*action.position, action.bottom or 0.0))


class MoveRunner:
    """Gives the actions that carry out moves one after another in world 0 of an environment with one world.

    A move that is not done after `max_steps` control steps is given up, and so are those after it.

    done: for each move that has been tried, whether it was carried out.

    Raises:
        ConfigError: for an environment of several worlds, or whose task does not grip.
    """

    def __init__(self, env: WorkspaceEnv, moves: Iterable[Move], max_steps: int = MAX_STEPS) -> None:
        if len(env.gripper) != 1 or not env.task.grips:
            raise ConfigError(f"task.name={env.config.task.name}: moves need one world, and a task that grips")
        self._env, self._moves, self._carrier = env, list(moves), Carrier(env)
        self._max_steps, self._steps = max_steps, 0
        self.done: list[bool] = []

    def __call__(self) -> Tensor | None:
        """The next action (1, A); None once all moves are done, or one was given up."""
        while len(self.done) < len(self._moves) and all(self.done):
            move = self._moves[len(self.done)]
            if self._is_done(move):
                self.done.append(True)
            elif self._steps >= self._max_steps:
                self.done.append(False)
            else:
                self._steps += 1
                return self._carrier.act(*self._where(move), np.array([move.release]))
            self._steps = 0
        return None

    def _where(self, move: Move) -> tuple[np.ndarray, np.ndarray]:
        """(1,) the slot of the object, and (1, 3) its place."""
        slot = np.flatnonzero(self._env.state.shown[0])[move.thing]
        return np.array([slot]), np.array([move.place], np.float64)

    def _is_done(self, move: Move) -> bool:
        (slots, places), state = self._where(move), self._env.state
        thing = state.objects[0, slots[0]]
        if not move.release:
            return bool(state.held[0] == slots[0] and np.abs(thing - places[0]).max() < HELD_THERE)
        height = self._env.gripper[0, 2] - self._env.below - thing[2]
        return bool(self._carrier.is_put_down(slots, places)[0]) and height > RISE


def carry_out(
    env: WorkspaceEnv,
    moves: Iterable[Move],
    max_steps: int = MAX_STEPS,
    watch: Callable[[TensorDictBase], None] | None = None,
) -> list[bool]:
    """Carries out moves in the only world of an environment whose episode has begun.

    Args:
        env: with one world and a task that grips, such as `rearrange`. Ends of its episode are ignored.
        moves: in their order.
        max_steps: control steps after which a move is given up, with those that follow.
        watch: is called after every control step with what the environment returned.

    Returns:
        Whether each move was carried out, up to the first one that was not.

    Raises:
        ConfigError: for an environment of several worlds, or whose task does not grip.
    """
    runner = MoveRunner(env, moves, max_steps)
    while (action := runner()) is not None:
        after = env.step(TensorDict({"action": action}, env.batch_size))["next"]
        if watch is not None:
            watch(after)
    return runner.done
