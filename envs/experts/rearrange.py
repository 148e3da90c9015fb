"""Rearrange: straight up out of the stacks, over everything on the way, and straight down again."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from envs.experts.base import UP, Array, Expert, Slots, choose_rows
from envs.experts.registry import register_expert
from envs.tasks.geometry import distance_to_segment, length
from envs.workspace_env import WorkspaceEnv

LEAST = 0.04  # metres above the table at which it travels at least, and what it holds
RETREAT = 0.03  # metres that it goes up beyond that from what it has left
CLEARANCE = 0.012  # metres over the tops of the stacks on the way
SAG = 0.005  # metres below that height at which it still travels
OVER, STILL_OVER = 0.003, 0.009  # metres beside a place that count as over it, at first and on the way down
PRESS = 0.005  # metres that a magnet goes below contact
TOUCH = 0.012  # metres from contact within which the gripper closes
NEAR = 0.03  # metres above its end from which the gripper goes down gently
# Metres that the gripper moves in a control step: over all stacks, between them, and gently. Faster, a panda or an
# xarm7 leaves the vertical by 6 to 14 mm.
FAST, BETWEEN, GENTLY = 0.03, 0.012, 0.008
RELEASE = 0.004  # metres along each axis from its place within which an object is released
THERE = 0.006  # metres from its place within which what is not held counts as put down
WAY = 1.7  # width of the way that must be free, in objects: with what is held, and some room


class Carrier:
    """Carries an object of each world to a place among stacks, without memory.

    A gripper moves sideways only above everything on its way, and is straight over an object or place to go down.
    """

    def __init__(self, env: WorkspaceEnv) -> None:
        self._env, self._rows, self._size = env, np.arange(len(env.gripper)), env.config.task.object_size
        self._ceiling = env.config.workspace.gripper_box[-1]

    def act(self, things: Slots, places: Array, release: NDArray[np.bool_] | bool = True) -> Tensor:
        """The action (N, A) that brings things (N,), slots, to places (N, 3), metres.

        release: (N,) whether it is left there. What is not released is held there, in the air.
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
        placed = held & (offset.max(1) < RELEASE) & release
        beside = length((grip - env.gripper)[:, :2])
        touching = (beside < STILL_OVER) & (np.abs((grip - env.gripper)[:, 2]) < TOUCH)
        return env.towards(goal, np.where(held, ~placed, touching & ~left))

    def is_put_down(self, things: Slots, places: Array) -> NDArray[np.bool_]:
        """(N,) whether things (N,) lie at places (N, 3), metres."""
        offset = np.abs(self._env.state.objects[self._rows, things] - places)
        return (offset.max(1) < THERE) & (self._env.state.held != things)

    def _path(self, aim: Array, rise: Array) -> Array:
        """(N, 3) where grippers go next on their way up to rise (N, 3), over and down to aim (N, 3)."""
        gripper, clear = self._env.gripper, rise[:, 2]
        beside, high = length((aim - gripper)[:, :2]), gripper[:, 2] > clear - SAG
        over = (beside < OVER) | (~high & (beside < STILL_OVER))
        slow = np.where(gripper[:, 2] - aim[:, 2] < NEAR, GENTLY, np.inf)
        down = self._at_height(aim, np.maximum(aim[:, 2], gripper[:, 2] - slow))
        sideways = self._at_height(aim, clear)
        return choose_rows(over, down, choose_rows(high, sideways, rise))

    def _within(self, goal: Array, step: NDArray[np.float64]) -> Array:
        """(N, 3) on the way to goal (N, 3), step (N,) metres from the gripper at most."""
        move = goal - self._env.gripper
        return self._env.gripper + move * np.minimum(1.0, step / np.maximum(length(move), 1e-9))[:, None]

    @staticmethod
    def _at_height(places: Array, height: NDArray[np.float64]) -> Array:
        return np.column_stack((places[:, :2], height))

    def _heights(self, aim: Array, things: Slots, held: NDArray[np.bool_]) -> tuple[Array, Array]:
        """(N,) height of the stacks on the way to aim, and of the gripper that passes over them with what it holds."""
        state = self._env.state
        others = state.movable.copy()
        others[self._rows, things] = False
        ends = self._env.gripper[:, None, :2], aim[:, None, :2]
        on_the_way = others & (distance_to_segment(state.objects[..., :2], *ends) < WAY * self._size)
        tops = np.where(on_the_way, state.objects[..., 2] + self._size / 2, 0.0).max(1)
        load = np.where(held, self._size / 2 + self._env.below, 0.0)
        least = np.maximum(aim[:, 2] + CLEARANCE, LEAST + load)
        return tops, np.minimum(np.maximum(tops + CLEARANCE + load, least), self._ceiling)


@register_expert("rearrange", "nl_rearrange")
class RearrangeExpert(Expert):
    """Carries the referent to its target, and leaves it there."""

    def __init__(self, env: WorkspaceEnv) -> None:
        super().__init__(env)
        self._carrier = Carrier(env)

    def act(self, referent: Slots, target: Slots) -> Tensor:
        return self._carrier.act(referent, self._place(target))
