"""Reach: over the goal, then down on it."""

from __future__ import annotations

import numpy as np
from torch import Tensor

from envs.experts.base import HOVER, OVER, Array, Expert, Slots
from envs.experts.registry import register_expert
from envs.tasks.reach import reaching_height


@register_expert("reach", "nl_reach", "reach_gesture", "nl_reach_gesture")
class ReachExpert(Expert):
    """Goes over the referent, then down on it."""

    def act(self, referent: Slots, target: Slots) -> Tensor:
        return self.towards(self._place(referent))

    def towards(self, goal: Array) -> Tensor:
        """The action (N, A) that brings each gripper over its goal (N, 3), metres, and then down on it."""
        goal = goal.copy()
        beside = np.linalg.norm((goal - self._env.gripper)[:, :2], axis=1)
        config = self._env.config
        goal[:, 2] += np.where(beside < OVER, reaching_height(config.task, config.robot.clearance), HOVER)
        return self._env.towards(goal)
