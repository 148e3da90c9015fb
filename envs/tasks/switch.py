"""Switch: push a lever over, from its one end to the other."""

from __future__ import annotations

import numpy as np

from envs.sim.devices import facing
from envs.tasks.operate import Operate
from envs.tasks.registry import register_task
from envs.tasks.types import Array, State

BEHIND = 0.035  # metres from a lever's knob to the middle of a gripper that is about to push it


@register_task("switch", verb="switch")
class SwitchLever(Operate):
    """ "switch the blue lever". It stays where it is left."""

    noun = "lever"

    def _measure(self, state: State) -> Array:
        """How far they lean to where they face."""
        x, y, z, w = np.moveaxis(state.quaternions, -1, 0)
        return np.arctan2(2 * (y * w - x * z), 1 - 2 * (x * x + y * y))

    def _from(self, state: State, place: Array) -> Array:
        ahead = facing(state.quaternions[self._rows, state.referent])
        return place - BEHIND * np.column_stack((ahead, np.zeros(len(ahead))))
