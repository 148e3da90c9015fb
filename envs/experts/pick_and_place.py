"""Experts that grip from above: grasp, lift, place, stack, unstack, rotate, sort and hand over."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from envs.experts.base import (
    HOVER,
    OVER,
    UP,
    AimingExpert,
    Array,
    Expert,
    Slots,
    choose_rows,
    height_share,
    register_expert,
)
from envs.tasks.hand_over import HandOver
from envs.tasks.shared.geometry import length
from envs.tasks.sort import Sort
from envs.tasks.stack import Unstack
from language import LIFTED

GRASP = 0.012  # metres from the place of a grip or release within which a gripper closes or opens
PRESS = 0.005  # metres that a magnet goes below contact
CARRY = 0.08  # metres above its target at which an object is carried
THERE = 0.03  # metres from its target within which an object counts as placed
MORE = 0.03  # metres beyond what success requires
SINK = 0.02  # metres that it goes down in a control step with the object; if faster, joint control leaves the path
ANGLE = math.radians(70)  # to which it turns the gripper
GENTLY = 0.012  # metres that it moves up or down in a control step beside an object that it does not hold, or puts down
ENOUGH = math.radians(60)  # from which on it puts the object down
CLEAR = 0.07  # metres over the palm at which an empty gripper passes


class Fetch(Expert):
    """Grips the referent. hover: metres above it at which the gripper travels."""

    hover: float | NDArray[np.float64] = HOVER

    def _fetch(self, thing: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return where the gripper goes (N, 3) to take hold of the object, and whether it closes (N,)."""
        grip = thing + self._env.grip_depth * UP
        offset = grip - self._env.gripper
        beside = length(offset[:, :2])
        close = (beside < OVER) & (np.abs(offset[:, 2]) < GRASP)
        press = PRESS * (self._env.grip_depth > 0)
        grip[:, 2] += (self.hover + press) * height_share(beside) - press
        return grip, close


# ---- holding


@register_expert("nl_grasp")
class GraspExpert(Fetch, AimingExpert):
    """Grips the referent, and stays."""

    def aim(self, referent: Slots, target: Slots) -> tuple[Array, NDArray[np.bool_]]:
        held = self._env.state.held == referent
        place, close = self._fetch(self._place(referent))
        return choose_rows(held, self._keep(), place), held | close

    def _keep(self) -> Array:
        """Return where the gripper goes (N, 3) with the held object."""
        return self._env.gripper


@register_expert("nl_lift")
class LiftExpert(GraspExpert):
    """Grips the referent, and raises it. more: metres that it is lifted beyond what success requires on the table."""

    more = MORE

    def _keep(self) -> Array:
        place = self._env.gripper
        place[:, 2] = self._task.config.object_size / 2 + self._env.grip_depth + LIFTED + self.more
        return place


# ---- placing


@register_expert("pick_and_place", "nl_pick_and_place")
class PlaceExpert(Fetch, AimingExpert):
    """Picks the referent up, and releases it at its target. height: metres above its target at which it is carried."""

    height = CARRY

    def aim(self, referent: Slots, target: Slots) -> tuple[Array, NDArray[np.bool_]]:
        thing, goal = self._place(referent), self._goal(target)
        held = self._env.state.held == referent
        there = ~held & (length(thing - goal) < THERE)
        fetch, close = self._fetch(thing)
        carry, keep = self._carry(thing, goal)
        rise = self._env.gripper + np.where(self._env.fingers_apart, HOVER, 0.0)[:, None] * UP  # else the object rises
        place = choose_rows(there, rise, choose_rows(held, carry, fetch))
        return place, np.where(held, keep, close) & ~there

    def _goal(self, target: Slots) -> Array:
        """(N, 3) where the referent goes, metres."""
        return self._place(target)

    def _carry(self, thing: Array, goal: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return where the gripper goes (N, 3) with the object that it holds, and whether it keeps it (N,)."""
        offset, height = goal - thing, self._height(thing, goal)
        aim = choose_rows(thing[:, 2] < height - self._travel(goal) / 2, thing, goal)
        aim[:, 2] = height
        keep = (length(offset[:, :2]) > OVER) | (np.abs(offset[:, 2]) > GRASP)
        return self._env.gripper + aim - thing, keep

    def _height(self, thing: Array, goal: Array) -> NDArray[np.float64]:
        """(N,) metres above the table at which the object is carried: it falls with the distance from the goal."""
        return goal[:, 2] + self._travel(goal) * height_share(length((goal - thing)[:, :2]))

    def _travel(self, goal: Array) -> NDArray[np.float64]:
        """(N,) metres above its goal (N, 3) at which an object is carried far from it."""
        return np.full(len(goal), self.height)


@register_expert("nl_stack")
class StackExpert(PlaceExpert):
    """Picks the referent up, and releases it on top of the target."""

    def _goal(self, target: Slots) -> Array:
        return self._place(target) + self._task.config.object_size * UP

    def _carry(self, thing: Array, goal: Array) -> tuple[Array, NDArray[np.bool_]]:
        place, keep = super()._carry(thing, goal)
        place[:, 2] = np.maximum(place[:, 2], self._env.gripper[:, 2] - SINK)
        return place, keep


@register_expert("nl_unstack")
class UnstackExpert(StackExpert):
    """Picks the referent up, and releases it where the table is free."""

    def aim(self, referent: Slots, target: Slots) -> tuple[Array, NDArray[np.bool_]]:
        return super().aim(referent, referent)

    def _goal(self, target: Slots) -> Array:
        assert isinstance(self._task, Unstack)
        return self._task.free_places()[self._rows, target]


@register_expert("nl_sort")
class SortExpert(StackExpert):
    """Picks the referent up, and releases it at its spot."""

    height = 0.11  # higher than elsewhere: it sets out sideways halfway up, and there are up to four other objects

    def _goal(self, target: Slots) -> Array:
        assert isinstance(self._task, Sort)
        return self._task.goal_places(self._env.state)


@register_expert("nl_hand_over")
class HandOverExpert(StackExpert):
    """Picks the referent up, and releases it on the palm. least_hover: metres above objects at which it travels."""

    least_hover = HOVER

    def aim(self, referent: Slots, target: Slots) -> tuple[Array, NDArray[np.bool_]]:
        over = self._place(target)[:, 2] + CLEAR - self._place(referent)[:, 2]
        self.hover = np.maximum(self.least_hover, over)
        return super().aim(referent, target)

    def _goal(self, target: Slots) -> Array:
        assert isinstance(self._task, HandOver)
        return self._task.on_palm(self._place(target))


# ---- turning


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
        """Return where the gripper goes (N, 3) with the object that it holds, and whether it keeps it (N,)."""
        place = self._env.gripper
        place[:, 2] += np.where(turned, np.maximum(rest - thing[:, 2], -GENTLY), rest + CARRY - thing[:, 2])
        # The object may have slipped upwards in the fingers, which then come down to the table first.
        low = np.minimum(thing[:, 2], self._env.gripper[:, 2] - self._env.grip_depth) < rest + GRASP / 2
        return place, ~(turned & low)
