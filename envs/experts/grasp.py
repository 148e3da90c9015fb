"""Grasp and lift: grip the referent, hold it, and raise it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.experts.base import AimingExpert, Array, Slots, choose_rows
from envs.experts.place import Fetch
from envs.experts.registry import register_expert
from language import LIFTED

MORE = 0.03  # metres beyond what success requires


@register_expert("nl_grasp")
class GraspExpert(Fetch, AimingExpert):
    """Grips the referent, and stays."""

    def aim(self, referent: Slots, target: Slots) -> tuple[Array, NDArray[np.bool_]]:
        held = self._env.state.held == referent
        place, close = self._fetch(self._place(referent))
        return choose_rows(held, self._keep(), place), held | close

    def _keep(self) -> Array:
        """Where the gripper goes (N, 3) with the held object."""
        return self._env.gripper


@register_expert("nl_lift")
class LiftExpert(GraspExpert):
    """Grips the referent, and raises it. more: metres that it is lifted beyond what success requires on the table."""

    more = MORE

    def _keep(self) -> Array:
        place = self._env.gripper
        place[:, 2] = self._task.config.object_size / 2 + self._env.below + LIFTED + self.more
        return place
