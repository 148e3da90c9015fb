"""A scripted expert: it reads the privileged goal, so it shows that a task can be done, and how well."""

from __future__ import annotations

import numpy as np
from tensordict import TensorDictBase

from envs.workspace_env import WorkspaceEnv

HOVER = 0.10  # metres above the goal until the gripper is over it, so that nothing is pushed aside
TOUCH = 0.03  # metres above the goal's centre at the end: on top of it
OVER = 0.02  # metres beside the goal that count as over it


class ReachExpert:
    """Goes over the goal, then down on it, in every control mode. Call it like a policy: it sets "action" (N, A)."""

    def __init__(self, env: WorkspaceEnv) -> None:
        self._env = env

    def __call__(self, tensordict: TensorDictBase) -> TensorDictBase:
        goal = tensordict["privileged", "goal"].numpy().astype(np.float64)
        beside = np.linalg.norm((goal - self._env.gripper)[:, :2], axis=1)
        goal[:, 2] += np.where(beside < OVER, TOUCH, HOVER)
        return tensordict.set("action", self._env.towards(goal))
