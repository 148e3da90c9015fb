"""Pick and rotate: pick an object up, turn it, and put it down again."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from envs.tasks.geometry import length
from envs.tasks.manipulation import Manipulation
from envs.tasks.pick_and_place import LIFT
from envs.tasks.registry import register_task
from envs.tasks.types import NOTHING, Array, State

TURNED = math.radians(45)  # about the vertical
UPRIGHT = 0.97  # cosine of the angle by which it may lean: 14 degrees
DOWN = 0.01  # metres above the table at which it counts as put down


@register_task("pick_and_rotate", verb="pick_and_rotate")
class PickAndRotate(Manipulation):
    """ "pick the red cube and rotate it".

    Success: the referent has been picked up and stands on the table again, turned about the vertical by `TURNED` or
    more from its initial yaw, released and at rest, for `hold_steps` steps.
    Potentials: approach (metres from gripper to object, negative; 0 while it is held or done), grasp (1 while it is
    held or done), lift (1 once it has been picked up), turn (the share of `TURNED`) and release (1 while it is done:
    picked up, turned, put down and released).
    """

    grips = True
    turns = True
    potentials = ("approach", "grasp", "lift", "turn", "release")

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._picked = np.zeros(worlds, bool)
        self._stood = np.zeros(worlds)  # radians about the vertical

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        self._picked[worlds] = self._in_the_air(state)[worlds]
        self._stood[worlds] = yaw(self._turns(state))[worlds]

    @property
    def memory(self) -> NDArray[np.float64]:
        """(N, 3) whether the referent has been picked up, and sine and cosine of its first yaw, scaled to [0, 1]."""
        angle = self._stood
        return np.stack((self._picked, (1 + np.sin(angle)) / 2, (1 + np.cos(angle)) / 2), axis=1)

    def _turns(self, state: State) -> Array:
        """(N, 4) the referents' quaternions."""
        return state.quaternions[self._rows, state.referent]

    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        return self._done(state) & (self._still >= 1)

    def _update_memory(self, state: State) -> None:
        self._picked |= self._in_the_air(state)

    def _in_the_air(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether the referent is held above the table."""
        return (state.held == state.referent) & (self._height(state) >= LIFT)

    def _height(self, state: State) -> Array:
        return self._referent(state)[:, 2] - self.config.object_size / 2

    def _turned(self, state: State) -> Array:
        """(N,) radians from how the referent stood, at most pi."""
        apart = yaw(self._turns(state)) - self._stood
        return np.abs((apart + np.pi) % (2 * np.pi) - np.pi)

    def _done(self, state: State) -> NDArray[np.bool_]:
        x, y = self._turns(state)[:, :2].T
        stands = (1 - 2 * (x * x + y * y) >= UPRIGHT) & (self._height(state) <= DOWN)
        return self._picked & stands & (self._turned(state) >= TURNED) & (state.held == NOTHING)

    def _potentials(self, state: State) -> dict[str, Array]:
        done = self._done(state)
        has = (state.held == state.referent) | done
        return {
            "approach": np.where(has, 0.0, -length(self._referent(state) - state.gripper)),
            "grasp": has.astype(np.float64),
            "lift": self._picked.astype(np.float64),
            "turn": np.minimum(self._turned(state) / TURNED, 1.0),
            "release": done.astype(np.float64),
        }


def yaw(turns: Array) -> Array:
    """(N,) radians about the vertical of quaternions (N, 4)."""
    x, y, z, w = turns.T
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
