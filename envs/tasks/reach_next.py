"""Reach after another instruction, which may have left the gripper at an object."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.tasks.nl_reach import NLReach
from envs.tasks.outcome import Outcome
from envs.tasks.types import NOTHING, Array, State


class ReachNext(NLReach):
    """Reach after another instruction. The object at which the gripper begins counts only after the gripper left it."""

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._first = np.full(worlds, NOTHING)  # the slot at which it begins, until it leaves it

    def reset(self, worlds: NDArray[np.int64], state: State) -> None:
        super().reset(worlds, state)
        distances = self._distances(state)[worlds]
        nearest = distances.argmin(1)
        self._first[worlds] = np.where(distances.min(1) <= self.config.success_radius, nearest, NOTHING)

    def _distances(self, state: State) -> Array:
        """With devices, see-through targets do not count: none is a referent, and objects may stand at their places."""
        distances = super()._distances(state)
        return np.where(state.movable, distances, np.inf) if self.config.devices else distances

    def step(self, state: State) -> Outcome:
        distances = self._distances(state)
        stays = (distances.argmin(1) == self._first) & (distances.min(1) <= self.config.success_radius)
        self._first = np.where(stays, self._first, NOTHING)
        self._held_other = np.where(stays, -1, self._held_other)
        return super().step(state)
