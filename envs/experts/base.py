"""What scripted experts have in common: they are told which object is meant and where it is to go, and see all else.

Few keep anything in mind: what they do follows from what is now.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torch import Tensor

from envs.workspace_env import WorkspaceEnv

Array = NDArray[np.float64]
Slots = NDArray[np.int64]

HOVER = 0.10  # metres above a place at which a gripper travels, so that nothing is pushed aside
OVER = 0.015  # metres beside a place that count as over it
UP = np.array([0.0, 0.0, 1.0])


class Expert(ABC):
    """Call it like a policy: it sets "action" (N, A), and knows from the environment what is meant."""

    def __init__(self, env: WorkspaceEnv) -> None:
        self._env, self._rows = env, np.arange(len(env.gripper))

    def __call__(self, tensordict: TensorDictBase) -> TensorDictBase:
        state = self._env.state
        return tensordict.set("action", self.act(state.referent, state.target))

    @abstractmethod
    def act(self, referent: Slots, target: Slots) -> Tensor:
        """The action (N, A) for each world's referent and target (N,); a target that is the referent is none."""

    def _place(self, slots: Slots) -> Array:
        """(N, 3) where the objects of these slots (N,) are, metres."""
        return self._env.state.objects[self._rows, slots]


def either(which: NDArray[np.bool_], these: Array, those: Array) -> Array:
    """(N, 3) these where which (N,), else those."""
    return np.where(which[:, None], these, those)
