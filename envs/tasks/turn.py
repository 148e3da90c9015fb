"""Turn: push a wheel round by the peg on it, either way."""

from __future__ import annotations

import numpy as np

from envs.sim.devices import facing
from envs.tasks.geometry import length
from envs.tasks.operate import Operate
from envs.tasks.registry import register_task
from envs.tasks.types import Array, State

BESIDE = 0.035  # metres from a wheel's peg to the middle of a gripper that is about to push it


@register_task("turn", verb="turn")
class TurnWheel(Operate):
    """ "turn the green wheel". It stays where it is left."""

    noun = "wheel"

    def _measure(self, state: State) -> Array:
        ahead = facing(state.quaternions)
        return np.arctan2(ahead[..., 1], ahead[..., 0])

    def travel(self, state: State) -> Array:
        gone = self._measure(state) - self._zero
        around = np.arctan2(np.sin(gone), np.cos(gone))
        return np.clip(np.where(state.shown, around / self._way, 0.0), -1.0, 1.0)

    def _from(self, state: State, place: Array) -> Array:
        """The nearer side of the peg."""
        out = facing(state.quaternions[self._rows, state.referent])
        along = BESIDE * np.stack((-out[:, 1], out[:, 0], np.zeros(len(out))), axis=1)
        nearer = length(place + along - state.gripper) < length(place - along - state.gripper)
        return np.where(nearer[:, None], place + along, place - along)
