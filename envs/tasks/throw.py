"""Throw: release an object in the air, so that it lands and comes to rest near its target."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.tasks.geometry import length
from envs.tasks.manipulation import Manipulation
from envs.tasks.registry import register_task
from envs.tasks.types import NOTHING, Array, State

SHORT = 0.15  # least horizontal distance in metres from the target at the release
HIGH = 0.03  # least height above the table in metres at the release
LANDED = 0.1  # metres from the target within which the object must come to rest


@register_task("throw", verb="throw")
class Throw(Manipulation):
    """ "throw the red cube to the same position as the transparent blue cube".

    Success: the referent, released in the air (`HIGH`) and at least `SHORT` from its target, lies within `LANDED` of
    it, at rest, for `hold_steps` steps. If it is gripped again, it no longer counts as thrown.
    Potentials: approach (metres from gripper to object, negative; 0 while it is held or thrown), grasp (1 while it is
    held or thrown), lift (1 while it is held in the air or thrown), transport (metres over the table from object to
    where it counts as landed, negative) and release (1 while it is thrown).
    """

    grips = True
    lag = 3  # an arm is fastest early in a control step, and nearly at rest at its beginning
    potentials = ("approach", "grasp", "lift", "transport", "release")

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._thrown = np.zeros(worlds, bool)
        self._carried = np.zeros((worlds, 3))  # where the object was last held

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        self._thrown[worlds] = False
        self._carried[worlds] = self._held_at(state)[worlds]

    @property
    def memory(self) -> NDArray[np.float64]:
        """(N, 1) whether the referent has been thrown."""
        return self._thrown[:, None].astype(np.float64)

    def _held_at(self, state: State) -> Array:
        """(N, 3) where the referent is held; NaN where it is not."""
        return np.where((state.held == state.referent)[:, None], self._referent(state), np.nan)

    def _update_memory(self, state: State) -> None:
        held = state.held == state.referent
        short = length((self._goal(state) - self._carried)[:, :2]) >= SHORT
        released = ~held & short & (self._carried[:, 2] - self.config.object_size / 2 >= HIGH)
        self._thrown = ~held & (self._thrown | released)
        self._carried = self._held_at(state)

    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        return self._thrown & (self._left(state) == 0) & (self._still >= 1) & (state.held == NOTHING)

    def _left(self, state: State) -> Array:
        """(N,) metres over the table to where the referent counts as landed."""
        return np.maximum(length((self._goal(state) - self._referent(state))[:, :2]) - LANDED, 0.0)

    def _potentials(self, state: State) -> dict[str, Array]:
        place, held = self._referent(state), state.held == state.referent
        has = held | self._thrown
        up = place[:, 2] - self.config.object_size / 2 >= HIGH
        return {
            "approach": np.where(has, 0.0, -length(place - state.gripper)),
            "grasp": has.astype(np.float64),
            "lift": ((held & up) | self._thrown).astype(np.float64),
            "transport": -self._left(state),
            "release": self._thrown.astype(np.float64),
        }
