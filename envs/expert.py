"""Scripted experts. One reads the privileged goal, so it shows that a task can be done, and how well; the other
reads the sentence with the parser, so it shows what understanding every word would come to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torch import Tensor

from envs.observation import seen_scene
from envs.workspace_env import WorkspaceEnv
from language import parse

HOVER = 0.10  # metres above the goal until the gripper is over it, so that nothing is pushed aside
TOUCH = 0.03  # metres above the goal's centre at the end: on top of it
OVER = 0.02  # metres beside the goal that count as over it


class ReachExpert:
    """Goes over the goal, then down on it, in every control mode. Call it like a policy: it sets "action" (N, A)."""

    def __init__(self, env: WorkspaceEnv) -> None:
        self._env = env

    def __call__(self, tensordict: TensorDictBase) -> TensorDictBase:
        return tensordict.set("action", self.towards(tensordict["privileged", "goal"].numpy().astype(np.float64)))

    def towards(self, goal: NDArray[np.float64]) -> Tensor:
        """The action (N, A) that brings each gripper over its goal (N, 3), metres, and then down on it."""
        goal = goal.copy()
        beside = np.linalg.norm((goal - self._env.gripper)[:, :2], axis=1)
        goal[:, 2] += np.where(beside < OVER, TOUCH, HOVER)
        return self._env.towards(goal)


class Oracle:
    """Parses each sentence in the scene it was said in, and goes where it says. It reads nothing privileged."""

    def __init__(self, env: WorkspaceEnv) -> None:
        self._env, self._expert = env, ReachExpert(env)
        self._slots = np.zeros(len(env.gripper), np.int64)

    def __call__(self, tensordict: TensorDictBase) -> TensorDictBase:
        objects, shown = tensordict["objects"].numpy(), tensordict["objects_mask"].numpy()
        for world in np.flatnonzero(self._env.elapsed == 0).tolist():
            self._slots[world] = self._understood(self._env.sentence(world), objects[world], shown[world])
        goal = objects[np.arange(len(objects)), self._slots, :3].astype(np.float64)
        return tensordict.set("action", self._expert.towards(goal))

    def _understood(self, sentence: str, objects: NDArray, shown: NDArray[np.bool_]) -> int:
        understood = parse(sentence, seen_scene(objects[shown], self._env.config.task.viewpoint))
        return int(np.flatnonzero(shown)[understood.steps[-1].goal])
