"""Pick and place: grip the referent from above, carry it over its target, lower and release it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.experts.base import HOVER, OVER, UP, AimingExpert, Array, Expert, Slots, choose_rows, height_share
from envs.experts.registry import register_expert
from envs.tasks.geometry import length

GRASP = 0.012  # metres from the place of a grip or release within which a gripper closes or opens
PRESS = 0.005  # metres that a magnet goes below contact
CARRY = 0.08  # metres above its target at which an object is carried
THERE = 0.03  # metres from its target within which an object counts as placed


class Fetch(Expert):
    """Grips the referent. hover: metres above it at which the gripper travels."""

    hover: float | NDArray[np.float64] = HOVER

    def _fetch(self, thing: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Where the gripper goes (N, 3) to take hold of the object, and whether it closes (N,)."""
        grip = thing + self._env.below * UP
        offset = grip - self._env.gripper
        beside = length(offset[:, :2])
        close = (beside < OVER) & (np.abs(offset[:, 2]) < GRASP)
        press = PRESS * (self._env.below > 0)
        grip[:, 2] += (self.hover + press) * height_share(beside) - press
        return grip, close


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
        """Where the gripper goes (N, 3) with the object that it holds, and whether it keeps it (N,)."""
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
