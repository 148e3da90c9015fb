"""Pick and place: grip the referent from above, carry it over its target, lower and release it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.experts.base import HOVER, OVER, UP, AimingExpert, Array, Expert, Slots, choose_rows
from envs.experts.registry import register_expert

GRASP = 0.012  # metres from the place of a grip or release within which a gripper closes or opens
PRESS = 0.005  # metres that a magnet goes below contact
CARRY = 0.08  # metres above its target at which an object is carried
THERE = 0.03  # metres from its target within which an object counts as placed


class Fetch(Expert):
    """Grips the referent. hover: metres above it at which the gripper travels."""

    hover = HOVER

    def _fetch(self, thing: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Where the gripper goes (N, 3) to take hold of the object, and whether it closes (N,)."""
        grip = thing + self._env.below * UP
        offset = grip - self._env.gripper
        over = np.linalg.norm(offset[:, :2], axis=1) < OVER
        close = over & (np.abs(offset[:, 2]) < GRASP)
        grip[:, 2] += np.where(over, -PRESS * (self._env.below > 0), self.hover)
        return grip, close


@register_expert("pick_and_place", "nl_pick_and_place")
class PlaceExpert(Fetch, AimingExpert):
    """Picks the referent up, and releases it at its target. height: metres above its target at which it is carried."""

    height = CARRY

    def aim(self, referent: Slots, target: Slots) -> tuple[Array, NDArray[np.bool_]]:
        thing, goal = self._place(referent), self._goal(target)
        held = self._env.state.held == referent
        there = ~held & (np.linalg.norm(thing - goal, axis=1) < THERE)
        fetch, close = self._fetch(thing)
        carry, keep = self._carry(thing, goal)
        rise = self._env.gripper + np.where(self._env.fingers_apart, HOVER, 0.0)[:, None] * UP  # else it takes it along
        place = choose_rows(there, rise, choose_rows(held, carry, fetch))
        return place, np.where(held, keep, close) & ~there

    def _goal(self, target: Slots) -> Array:
        """(N, 3) where the referent goes, metres."""
        return self._place(target)

    def _carry(self, thing: Array, goal: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Where the gripper goes (N, 3) with the object that it holds, and whether it keeps it (N,)."""
        offset = goal - thing
        over = np.linalg.norm(offset[:, :2], axis=1) < OVER
        low = thing[:, 2] < goal[:, 2] + self.height / 2
        aim = choose_rows(over | ~low, goal, thing)
        aim[:, 2] = np.where(over, goal[:, 2], goal[:, 2] + self.height)
        keep = ~(over & (np.abs(offset[:, 2]) < GRASP))
        return self._env.gripper + aim - thing, keep
