"""Push: down behind the object as seen from its target, and on along the line between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from envs.experts.base import HOVER, UP, Array, Expert, Slots, choose_rows
from envs.experts.registry import register_expert
from envs.tasks.geometry import horizontal, length
from envs.workspace_env import WorkspaceEnv

TOOL = 0.025  # metres from the gripper's centre to the side that pushes
FREE = 0.008  # metres between it and the object as it goes down
ASIDE = 0.01  # metres beside the line at which it goes back for another try
CLEAR = 0.02  # metres further away, at which it may go up
FAR = 0.06  # metres behind where it touches the object, within which it goes on pushing
SINK = 0.02  # metres that it goes down in a control step
STEER = 0.4  # share of the lateral error that each step corrects
STEP = 0.012  # metres that it pushes in a control step; if faster, the object slides on
THERE = 0.025  # metres from its target within which an object is left alone
FINE = 0.042  # ... if it would take another try to push it nearer
# How high above the table a gripper pushes, metres: jaco's fingers spread wider than an object, and pass over it.
HEIGHTS = {"jaco": 0.043}
HEIGHT = 0.025


class Pusher(Expert):
    """Moves through the air to a place behind an object, and pushes it."""

    def __init__(self, env: WorkspaceEnv) -> None:
        super().__init__(env)
        self._over = env.config.robot.name in HEIGHTS  # whether parts of the gripper extend beyond the object
        self._height = HEIGHTS.get(env.config.robot.name, HEIGHT)
        self._apart = env.config.task.object_size / 2 + TOOL  # metres between the centres as they touch

    def _push(self, thing: Array, way: Array, step: float = STEP) -> Array:
        """Where the gripper goes (N, 3) to push the object `step` metres along `way`, a unit vector (N, 3)."""
        pushing, aside = self._pushing(thing, way)
        onward = self._env.gripper - STEER * aside + step * way
        onward[:, 2] = self._height
        return choose_rows(pushing, onward, self._around(thing, way))

    def _pushing(self, thing: Array, way: Array) -> tuple[NDArray[np.bool_], Array]:
        """Whether the gripper is low behind the object (N,), and how far beside the line (N, 3)."""
        offset = (self._env.gripper - thing) * [1.0, 1.0, 0.0]
        along = (offset * way).sum(1)
        aside = offset - along[:, None] * way
        behind = (along < 2 * FREE - self._apart) & (along > -FAR - self._apart) & (length(aside) < ASIDE)
        return behind & (self._env.gripper[:, 2] < self._height + FREE), aside

    def _around(self, thing: Array, way: Array) -> Array:
        """Where the gripper goes (N, 3): back, up, over, and down behind the object."""
        start = thing - (self._apart + FREE) * way
        gripper = self._env.gripper
        high = gripper[:, 2] > HOVER - 0.02
        over = length((start - gripper)[:, :2]) < np.where(high, 0.005, 0.015)
        start[:, 2] = np.where(over, np.maximum(self._height, gripper[:, 2] - SINK), HOVER)
        return choose_rows(over | high, start, self._back(thing, -horizontal(gripper - thing)))

    def _back(self, thing: Array, way: Array) -> Array:
        """Where the gripper goes (N, 3) from the object that it touches: back, and then up.

        A gripper that rises at once would lift the object. One with parts beyond the object rises at once all the same,
        since going back would drag it.
        """
        near = (length((self._env.gripper - thing)[:, :2]) < self._apart + CLEAR) & (not self._over)
        high = self._env.gripper[:, 2] > HOVER - 0.04
        return self._env.gripper + choose_rows(near & ~high, -HOVER * way, HOVER * UP)


@register_expert("push", "nl_push")
class PushExpert(Pusher):
    """Pushes the referent to its target."""

    def act(self, referent: Slots, target: Slots) -> Tensor:
        thing, goal = self._place(referent), self._place(target)
        way = horizontal(goal - thing)
        pushing, _ = self._pushing(thing, way)
        there = length((goal - thing)[:, :2]) < np.where(pushing, THERE, FINE)
        return self._env.towards(choose_rows(there, self._env.gripper, self._push(thing, way)))
