"""Lift: grip an object, raise it, and hold it there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.tasks.grasp import Grasp
from envs.tasks.registry import register_task
from envs.tasks.types import Array, State
from language import LIFTED


@register_task("nl_lift", verb="lift")
class Lift(Grasp):
    """ "lift the red cube".

    Success: the referent is held `LIFTED` metres above where it stood, for `hold_steps` steps.
    Potentials: approach, grasp, and height (metres above where it stood, up to that).
    """

    potentials = ("approach", "grasp", "height")

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._stood = np.zeros(worlds)  # metres above the table

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        super()._reset_memory(worlds, state)
        taken = state.held == state.referent  # an episode that begins with the object held
        stood = np.where(taken, self.config.object_size / 2, self._referent(state)[:, 2])
        self._stood[worlds] = stood[worlds]

    @property
    def memory(self) -> NDArray[np.float64]:
        """(N, 1) how high the referent stood."""
        return np.clip(self._stood, 0.0, 1.0)[:, None]

    def _height(self, state: State) -> Array:
        return self._referent(state)[:, 2] - self._stood

    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        return super()._at_goal(state) & (self._height(state) >= LIFTED)

    def _potentials(self, state: State) -> dict[str, Array]:
        return super()._potentials(state) | {"height": np.clip(self._height(state), 0.0, LIFTED)}
