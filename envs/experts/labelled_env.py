"""An environment that observes the actions of the task's scripted expert, as labels for imitation."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torchrl.data import Bounded

from envs.experts.base import expert
from envs.workspace_env import WorkspaceEnv

LABEL = ("privileged", "expert_action")


class LabelledEnv(WorkspaceEnv):
    """Also observes privileged/expert_action (N, A): the expert's action in each state, whoever acts.

    The expert knows the simulation's state, also with perception=camera.

    Raises:
        ConfigError: the environment cannot be built, or the task has no expert.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._expert = expert(self, privileged=True)

    def _make_specs(self) -> None:
        super()._make_specs()
        spec = self.observation_spec
        spec[LABEL] = Bounded(-1, 1, shape=self.action_spec.shape, dtype=torch.float32)
        self.observation_spec = spec

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        return self._with_label(super()._step(tensordict))

    def _begin_episodes(self, worlds: NDArray[np.int64]) -> TensorDictBase:
        return self._with_label(super()._begin_episodes(worlds))

    def _with_label(self, observed: TensorDictBase) -> TensorDictBase:
        action = self._expert(observed.empty())["action"]
        return observed.set(LABEL, action.clamp(-1.0, 1.0))
