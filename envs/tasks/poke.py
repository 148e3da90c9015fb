"""Poke: a short touch that moves an object a little."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.tasks.geometry import length
from envs.tasks.manipulation import Manipulation
from envs.tasks.registry import register_task
from envs.tasks.types import Array, State

MOVED = 0.02  # least displacement in metres: more than an arm that brushes past causes
PUSHED = 0.12  # greatest displacement in metres: beyond it, the object has been pushed
AWAY = 0.1  # metres between the centres of gripper and object at success: 5 cm from contact


@register_task("poke", verb="poke")
class Poke(Manipulation):
    """ "poke the red cube".

    Success: the referent lies, at rest, between `MOVED` and `PUSHED` from where it stood, and the gripper is `AWAY`
    from it, for `hold_steps` steps. It fails where the object is displaced by more than `PUSHED`.
    Potentials: approach (metres from gripper to object, negative; 0 once it has been moved), touch (the share of
    `MOVED` by which it is displaced) and withdraw (once it has been moved, the share of `AWAY` that the gripper is from
    it).
    """

    fails = True
    potentials = ("approach", "touch", "withdraw")

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._displaced = np.zeros(worlds)  # metres

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        self._displaced[worlds] = 0.0

    @property
    def memory(self) -> NDArray[np.float64]:
        """(N, 1) the share of `PUSHED` by which the referent is displaced."""
        return np.minimum(self._displaced / PUSHED, 1.0)[:, None]

    def _update_memory(self, state: State) -> None:
        self._displaced = length(self._referent(state) - self._begun[self._rows, state.referent])

    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        place = self._referent(state)
        moved = (self._displaced >= MOVED) & (self._displaced <= PUSHED)
        return moved & (length(place - state.gripper) >= AWAY) & (self._still >= 1)

    def _failed(self, state: State) -> NDArray[np.bool_]:
        return self._displaced > PUSHED

    def _potentials(self, state: State) -> dict[str, Array]:
        apart = length(self._referent(state) - state.gripper)
        moved = self._displaced >= MOVED
        return {
            "approach": np.where(moved, 0.0, -apart),
            "touch": np.minimum(self._displaced / MOVED, 1.0),
            "withdraw": np.where(moved, np.minimum(apart / AWAY, 1.0), 0.0),
        }
