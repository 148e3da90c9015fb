"""Rearrange: straight up out of the stacks, over everything on the way, and straight down again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from envs.experts.base import UP, Array, Expert, Slots, choose_rows
from envs.experts.registry import register_expert
from envs.tasks.geometry import length, tops_on_the_way
from envs.tasks.rearrange import Rearrange
from envs.workspace_env import WorkspaceEnv

LEAST = 0.04  # least height above the table, metres, at which the gripper and its load travel
RETREAT = 0.03  # metres that it rises beyond that from a released object
CLEARANCE = 0.012  # metres over the tops of the stacks on the way
SAG = 0.005  # metres below that height at which it still travels
PRESS = 0.005  # metres that a magnet goes below contact
TOUCH = 0.012  # metres from contact within which the gripper closes
NEAR = 0.03  # metres above its end from which the gripper goes down gently
# Metres that the gripper moves in a control step: over all stacks, between them, and gently. If faster, a panda or an
# xarm7 leaves the vertical by 6 to 14 mm.
FAST, BETWEEN, GENTLY = 0.03, 0.012, 0.008


@dataclass(frozen=True)
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
        self._ceiling = env.config.workspace.gripper_box[-1]

    def act(self, things: Slots, places: Array, release: NDArray[np.bool_] | bool = True) -> Tensor:
        """The action (N, A) that brings the objects in slots `things` (N,) to `places` (N, 3), metres.

        release: (N,) whether the object is released there; otherwise the gripper holds it there, in the air.
        """
        env = self._env
        thing, held = env.state.objects[self._rows, things], env.state.held == things
        left = ~held & self.is_put_down(things, places)
        grip = thing + env.below * UP
        down = choose_rows(held, env.gripper + places - thing, grip - PRESS * (env.below > 0) * UP)
        tops, clear = self._heights(down, things, held)
        rise = self._at_height(env.commanded_gripper, np.minimum(clear + RETREAT * left, self._ceiling))
        goal = choose_rows(left, rise, self._path(down, rise))
        between = env.gripper[:, 2] - np.where(held, self._size, 0.0) < tops
        goal = self._within(goal, np.where(between, BETWEEN, FAST))
        offset = np.abs(places - thing)
        placed = held & (offset.max(1) < self._precision.release) & release
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
        ways = self._env.gripper[:, :2], aim[:, None, :2]
        tops = tops_on_the_way(state.objects, others[:, None], *ways, self._size)[:, 0]
        load = np.where(held, self._size / 2 + self._env.below, 0.0)
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
