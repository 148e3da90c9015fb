"""Grasp: grip an object and hold it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.tasks.geometry import length
from envs.tasks.manipulation import Manipulation
from envs.tasks.registry import register_task
from envs.tasks.types import NOTHING, Array, State


@register_task("nl_grasp", verb="grasp")
class Grasp(Manipulation):
    """ "grasp the red cube".

    Success: the referent is held for `hold_steps` steps. Another object taken and held for as long is the wrong object.
    Potentials: approach (metres from gripper to object, negative; 0 while it is held) and grasp (1 while it is held).
    """

    grips = True
    potentials: tuple[str, ...] = ("approach", "grasp")

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._other = np.zeros(worlds, np.int64)  # control steps that another object has been held
        self._before = np.full(worlds, NOTHING)  # the object held at the beginning, until it is released

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        self._other[worlds] = 0
        self._before[worlds] = state.held[worlds]

    def _update_memory(self, state: State) -> None:
        self._before = np.where(state.held == self._before, self._before, NOTHING)
        other = (state.held != NOTHING) & (state.held != state.referent) & (state.held != self._before)
        self._other = np.where(other, self._other + 1, 0)

    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        return state.held == state.referent

    def _disturbed(self, state: State) -> NDArray[np.bool_]:
        return super()._disturbed(state) | (self._other >= self.config.success_steps)

    def _potentials(self, state: State) -> dict[str, Array]:
        held = state.held == state.referent
        apart = length(self._referent(state) - state.gripper)
        return {"approach": np.where(held, 0.0, -apart), "grasp": held.astype(np.float64)}
