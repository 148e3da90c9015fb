"""Pick and rotate: pick the referent up, turn it, put it down and release it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from envs.experts.base import UP, Array, Slots, choose_rows
from envs.experts.place import CARRY, GRASP, Fetch
from envs.experts.registry import register_expert

ANGLE = math.radians(70)  # to which it turns the gripper
GENTLY = 0.012  # metres that it moves up or down in a control step beside an object that it does not hold, or puts down
ENOUGH = math.radians(60)  # from which on it puts the object down


@register_expert("pick_and_rotate")
class RotateExpert(Fetch):
    """Grips with the gripper's yaw at rest, so that the yaw then equals the rotation of the object."""

    def act(self, referent: Slots, target: Slots) -> Tensor:
        env, thing = self._env, self._place(referent)
        held = env.state.held == referent
        turned = env.yaw > ENOUGH
        rest = env.config.task.object_size / 2
        done = turned & ~held & (thing[:, 2] < rest + GRASP)
        fetch, close = self._fetch(thing)
        carry, keep = self._carry(thing, turned, rest)
        rise = env.gripper + np.where(env.fingers_apart, GENTLY, 0.0)[:, None] * UP
        place = choose_rows(done, rise, choose_rows(held, carry, fetch))
        yaw = np.where(held | done, ANGLE, 0.0)
        return env.towards(place, np.where(held, keep, close) & ~done, yaw)

    def _carry(self, thing: Array, turned: NDArray[np.bool_], rest: float) -> tuple[Array, NDArray[np.bool_]]:
        """Where the gripper goes (N, 3) with the object that it holds, and whether it keeps it (N,)."""
        place = self._env.gripper
        place[:, 2] += np.where(turned, np.maximum(rest - thing[:, 2], -GENTLY), rest + CARRY - thing[:, 2])
        # The object may have slipped upwards in the fingers, which then come down to the table first.
        low = np.minimum(thing[:, 2], self._env.gripper[:, 2] - self._env.below) < rest + GRASP / 2
        return place, ~(turned & low)
