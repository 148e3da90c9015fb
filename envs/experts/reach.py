"""Reach: over the goal, then down on it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.experts.base import HOVER, OVER, AimingExpert, Array, Slots, register_expert
from envs.tasks.reach import reaching_height


@register_expert("reach", "nl_reach", "reach_gesture", "nl_reach_gesture")
class ReachExpert(AimingExpert):
    """Goes over the referent, then down on it. hover: metres above it at which the gripper travels."""

    hover = HOVER

    def aim(self, referent: Slots, target: Slots) -> tuple[Array, NDArray[np.bool_]]:
        return self.over(self._place(referent)), np.zeros(len(referent), bool)

    def over(self, goal: Array) -> Array:
        """Return where each gripper goes (N, 3), metres, over its goal (N, 3) and then down on it."""
        goal = goal.copy()
        beside = np.linalg.norm((goal - self._env.gripper)[:, :2], axis=1)
        height = reaching_height(self._task.config, self._env.config.robot.clearance)
        goal[:, 2] += np.where(beside < OVER, height, self.hover)
        return goal
