"""Experts on a board: a carrier of objects among stacks, and lists of moves that it carries out one after another.

`moves_of` makes moves from the steps of a command that was understood on a board.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from core.errors import ConfigError
from envs.experts.base import UP, Array, Expert, Slots, choose_rows, register_expert
from envs.tasks.board import Rearrange
from envs.tasks.shared.geometry import length, tops_on_the_way
from envs.workspace_env import WorkspaceEnv, gripper_box
from language import LanguageError, Step
from language.verbs import Act
from language.world import BOARD_HEIGHT

MAX_STEPS = 200  # control steps of a move
RISE = 0.03  # metres that the gripper rises from a released object before the next move
HELD_THERE = 0.006  # metres from its place, along each axis, within which a held object has arrived
Cells = Sequence[tuple[float, float]]
TAKEN = (Act.TAKE, Act.HOLD)  # what a step does that only takes its object
LEAST = 0.04  # least height above the table, metres, at which the gripper and its load travel
RETREAT = 0.03  # metres that it rises beyond that from a released object
CLEARANCE = 0.012  # metres over the tops of the stacks on the way
SAG = 0.005  # metres below that height at which it still travels
PRESS = 0.005  # metres that a magnet goes below contact
TOUCH = 0.012  # metres from contact within which the gripper closes
NEAR = 0.03  # metres above its end from which the gripper goes down gently
AT_FLOOR = 0.002  # metres above the lowest height that the gripper may reach
DROP = 0.01  # metres that an object may fall which was taken lower than the gripper can put it down
# Metres that the gripper moves in a control step: over all stacks, between them, and gently. If faster, a panda or an
# xarm7 leaves the vertical by 6 to 14 mm.
FAST, BETWEEN, GENTLY = 0.03, 0.012, 0.008


# ---- carrying one object


@dataclass(frozen=True, kw_only=True)
class Precision:
    """Metres that decide what a carrier does next.

    Attributes:
        over, still_over: beside a place that count as over it, at first and on the way down.
        release: along each axis from its place within which an object is released.
        there: from its place within which an object that is not held counts as put down.
        lift: above the height that clears all stacks, where it moves sideways; it rises towards twice as much.
    """

    over: float = 0.003
    still_over: float = 0.009
    release: float = 0.004
    there: float = 0.006
    lift: float = 0.0


# As lenient as the board allows, for imitation: a policy that misses the expert's move by a tenth still goes on to the
# next phase. With the narrow margins, clones hovered 3 to 5 mm beside objects and below the height of travel.
LENIENT = Precision(over=0.006, still_over=0.01, release=0.007, there=0.01, lift=0.01)


class Carrier:
    """Carries an object of each world to a place among stacks, without memory.

    A gripper moves sideways only above everything on its way, and is straight over an object or place to go down.
    """

    def __init__(self, env: WorkspaceEnv, precision: Precision | None = None) -> None:
        self._env, self._rows, self._size = env, np.arange(len(env.gripper)), env.config.task.object_size
        self._precision = precision or Precision()
        self._floor = float(gripper_box(env.config, env.task)[0, 2])
        self._ceiling = env.config.workspace.gripper_box[-1]

    def act(self, things: Slots, places: Array, release: NDArray[np.bool_] | bool = True) -> Tensor:
        """Return the action (N, A) that brings the objects in slots `things` (N,) to `places` (N, 3), metres.

        release: (N,) whether the object is released there; otherwise the gripper holds it there, in the air.
        """
        env = self._env
        thing, held = env.state.objects[self._rows, things], env.state.held == things
        left = ~held & self.is_put_down(things, places)
        grip = thing + env.grip_depth * UP
        down = choose_rows(held, env.gripper + places - thing, grip - PRESS * (env.grip_depth > 0) * UP)
        tops, clear = self._heights(down, things, held)
        rise = self._at_height(env.commanded_gripper, np.minimum(clear + RETREAT * left, self._ceiling))
        goal = choose_rows(left, rise, self._path(down, rise))
        between = env.gripper[:, 2] - np.where(held, self._size, 0.0) < tops
        goal = self._within(goal, np.where(between, BETWEEN, FAST))
        offset = np.abs(places - thing)
        lowest = (down[:, 2] < self._floor) & (env.gripper[:, 2] < self._floor + AT_FLOOR) & (offset[:, 2] < DROP)
        height = np.where(lowest, 0.0, offset[:, 2])
        placed = held & (np.maximum(offset[:, :2].max(1), height) < self._precision.release) & release
        beside = length((grip - env.gripper)[:, :2])
        touching = (beside < self._precision.still_over) & (np.abs((grip - env.gripper)[:, 2]) < TOUCH)
        return env.towards(goal, np.where(held, ~placed, touching & ~left))

    def is_put_down(self, things: Slots, places: Array) -> NDArray[np.bool_]:
        """(N,) whether things (N,) lie at places (N, 3), metres."""
        offset = np.abs(self._env.state.objects[self._rows, things] - places)
        return (offset.max(1) < self._precision.there) & (self._env.state.held != things)

    def _path(self, aim: Array, rise: Array) -> Array:
        """(N, 3) where grippers go next on their way up to rise (N, 3), over and down to aim (N, 3)."""
        gripper, clear, lift = self._env.gripper, rise[:, 2], self._precision.lift
        beside, high = length((aim - gripper)[:, :2]), gripper[:, 2] > clear - SAG
        over = (beside < self._precision.over) | (~high & (beside < self._precision.still_over))
        slow = np.where(gripper[:, 2] - aim[:, 2] < NEAR, GENTLY, np.inf)
        down = self._at_height(aim, np.maximum(aim[:, 2], gripper[:, 2] - slow))
        sideways, up = self._at_height(aim, clear + lift), self._at_height(rise, clear + 2 * lift)
        return choose_rows(over, down, choose_rows(high, sideways, up))

    def _within(self, goal: Array, step: NDArray[np.float64]) -> Array:
        """(N, 3) points on the way to `goal` (N, 3), at most `step` (N,) metres from the gripper."""
        move = goal - self._env.gripper
        return self._env.gripper + move * np.minimum(1.0, step / np.maximum(length(move), 1e-9))[:, None]

    @staticmethod
    def _at_height(places: Array, height: NDArray[np.float64]) -> Array:
        return np.column_stack((places[:, :2], height))

    def _heights(self, aim: Array, things: Slots, held: NDArray[np.bool_]) -> tuple[Array, Array]:
        """(N,) height of the stacks on the way to `aim`, and (N,) of a gripper that passes over them with its load."""
        state = self._env.state
        others = state.movable.copy()
        others[self._rows, things] = False
        starts, ends = self._env.gripper[:, :2], aim[:, None, :2]
        tops = tops_on_the_way(state.objects, others[:, None], starts=starts, ends=ends, size=self._size)[:, 0]
        load = np.where(held, self._size / 2 + self._env.grip_depth, 0.0)
        least = np.maximum(aim[:, 2] + CLEARANCE, LEAST + load)
        return tops, np.minimum(np.maximum(tops + CLEARANCE + load, least), self._ceiling)


@register_expert("rearrange", "nl_rearrange")
class RearrangeExpert(Expert):
    """Carries the referent to its target, and leaves it there, unless the target is in the air."""

    def __init__(self, env: WorkspaceEnv) -> None:
        super().__init__(env)
        self._carrier = Carrier(env, LENIENT)

    def act(self, referent: Slots, target: Slots) -> Tensor:
        task = self._env.task
        assert isinstance(task, Rearrange)
        return self._carrier.act(referent, self._place(target), ~task.in_the_air)


# ---- lists of moves


@dataclass(frozen=True)
class Move:
    """Brings an object to a place.

    thing: its number among the objects that are shown, as in `InteractiveEnv.scene`. place: (3,) its centre in the end,
    metres. release: whether it is released there; otherwise it stays in the gripper, in the air.
    """

    thing: int
    place: Sequence[float] | NDArray[np.float64]
    release: bool = True


class Places(Protocol):
    """Where objects may be: the cells of a `Grid`, or a table."""

    def place(self, column: float, row: float, level: float) -> NDArray[np.float64]:
        """(3,) the centre of an object there, metres."""
        ...


def moves_of(
    actions: Sequence[Step],
    cells: Cells,
    numbers: Sequence[int],
    grid: Places,
    *,
    hold: float = BOARD_HEIGHT - 1,
) -> list[Move]:
    """Return the moves that carry out the steps of a command.

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
    return list(_moves(without_takes(actions), dict(enumerate(cells)), numbers, grid, hold=hold))


def _moves(
    actions: Sequence[Step],
    cells: dict[int, tuple[float, float]],
    numbers: Sequence[int],
    grid: Places,
    *,
    hold: float,
) -> Iterator[Move]:
    for action in actions:
        if not (action.takes or action.carries):
            raise LanguageError(f"'{action.verb}' moves nothing on a board: say what to take, or where to put it")
        if action.place is None:
            over = grid.place(*cells[action.object], hold)
            yield Move(int(numbers[action.object]), over, release=False)
        else:
            cells[action.object] = action.place
            yield Move(int(numbers[action.object]), grid.place(*action.place, action.bottom or 0.0))


def without_takes(actions: Sequence[Step]) -> list[Step]:
    """Return the steps without each that only takes what the next step places, since placing includes taking."""
    following = [*actions[1:], None]
    return [
        action
        for action, after in zip(actions, following, strict=True)
        if not (action.act in TAKEN and after and after.carries and after.object == action.object)
    ]


class MoveRunner:
    """Gives the actions that carry out moves one after another in world 0 of an environment with one world.

    A move that is not done after `max_steps` control steps is given up, and so are those after it.

    done: for each move that has been tried, whether it was carried out.

    Raises:
        ConfigError: for an environment of several worlds, or whose task does not grip.
    """

    def __init__(self, env: WorkspaceEnv, moves: Iterable[Move], max_steps: int = MAX_STEPS) -> None:
        if len(env.gripper) != 1 or not env.task.traits.grips:
            raise ConfigError(f"task.name={env.config.task.name}: moves need one world, and a task that grips")
        self._env, self._moves, self._carrier = env, list(moves), Carrier(env)
        self._max_steps, self._steps = max_steps, 0
        self.done: list[bool] = []

    def __call__(self) -> Tensor | None:
        """Return the next action (1, A); None once all moves are done, or one was given up."""
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
        height = self._env.gripper[0, 2] - self._env.grip_depth - thing[2]
        return bool(self._carrier.is_put_down(slots, places)[0]) and height > RISE


def carry_out(
    env: WorkspaceEnv,
    moves: Iterable[Move],
    max_steps: int = MAX_STEPS,
    watch: Callable[[TensorDictBase], None] | None = None,
) -> list[bool]:
    """Carry out moves in the only world of an environment whose episode has begun.

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
