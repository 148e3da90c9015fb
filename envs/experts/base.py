"""The base class of scripted experts, and the table that they enter by decorator.

Experts know the referent, the target and the simulation's state; with perception=camera, where things are as cameras
see them. Most have no memory: their action follows from the present state.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torch import Tensor

from core.errors import ConfigError
from envs.tasks import State, Task
from envs.workspace_env import WorkspaceEnv

Array = NDArray[np.float64]
Slots = NDArray[np.int64]
HOVER = 0.10  # metres above a place at which a gripper travels, so that it pushes nothing aside
OVER = 0.015  # metres beside a place that count as over it
FULL_HEIGHT = 0.04  # metres beside a place from which on a gripper is at its full height above it
UP = np.array([0.0, 0.0, 1.0])
ExpertClass = TypeVar("ExpertClass", bound="type[Expert]")


class Expert(ABC):
    """A callable like a policy: it writes "action" (N, A), and reads referent and target from the environment."""

    def __init__(self, env: WorkspaceEnv, task: Task | None = None) -> None:
        """task: what it carries out; None: the environment's."""
        self._env, self._rows = env, np.arange(len(env.gripper))
        self._task = env.task if task is None else task

    def __call__(self, tensordict: TensorDictBase) -> TensorDictBase:
        state = self._env.state
        return tensordict.set("action", self.act_on_shown(state.referent, state.target))

    def act_on_shown(self, referent: Slots, target: Slots) -> Tensor:
        """Return the action (N, A) as `act` does; arms hold still where referent or target are not seen."""
        action, shown = self.act(referent, target), self._env.state.shown
        seen = shown[self._rows, referent] & shown[self._rows, target]
        if seen.all():
            return action
        return torch.where(torch.from_numpy(seen)[:, None], action, self._env.towards(self._env.gripper))

    @abstractmethod
    def act(self, referent: Slots, target: Slots) -> Tensor:
        """Return the action (N, A) for referents and targets (N,); a target equal to the referent means none."""

    def _place(self, slots: Slots) -> Array:
        """(N, 3) positions of the objects in these slots (N,), metres."""
        return self._env.state.objects[self._rows, slots]


class AimingExpert(Expert):
    """Gives each gripper's next position and whether it closes; the environment's control computes the action."""

    def act(self, referent: Slots, target: Slots) -> Tensor:
        return self._env.towards(*self.aim(referent, target))

    @abstractmethod
    def aim(self, referent: Slots, target: Slots) -> tuple[Array, NDArray[np.bool_]]:
        """Return where the grippers go (N, 3), metres, and whether they close (N,). Arguments: of `act`."""


class SeenEnv:
    """An environment whose task and state are those that cameras see."""

    def __init__(self, env: WorkspaceEnv) -> None:
        self._env = env

    def __getattr__(self, name: str) -> Any:
        return getattr(self._env, name)

    @property
    def task(self) -> Task:
        """As policies may know it."""
        return self._env.sight.task

    @property
    def state(self) -> State:
        """As policies may know it."""
        return self._env.sight.state


def choose_rows(which: NDArray[np.bool_], these: Array, those: Array) -> Array:
    """(N, 3) rows of `these` where which (N,) is true, else of `those`."""
    return np.where(which[:, None], these, those)


def height_share(beside: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) the share of its full height above a place that a gripper has at distance (N,) beside it, metres.

    The height is continuous. A policy that imitates a switch between up and down stands still at the switch.
    """
    return np.clip((beside - OVER / 2) / (FULL_HEIGHT - OVER / 2), 0.0, 1.0)


# ---- the table of experts


EXPERTS: dict[str, type[Expert]] = {}


def register_expert(*tasks: str) -> Callable[[ExpertClass], ExpertClass]:
    """Class decorator that registers the expert for tasks, given by their names in `envs.tasks.TASKS`.

    Raises ValueError where a task has an expert already.
    """

    def register(expert: ExpertClass) -> ExpertClass:
        for task in tasks:
            if task in EXPERTS:
                raise ValueError(f"task {task!r} has an expert already: {EXPERTS[task].__name__}")
            EXPERTS[task] = expert
        return expert

    return register


def expert(env: WorkspaceEnv, privileged: bool = False) -> Expert:
    """Return a new expert for the environment's task. Raises ConfigError where none is registered.

    privileged: whether it knows the simulation's state with perception=camera as well.
    """
    name = env.config.task.name
    if name not in EXPERTS:
        raise ConfigError(
            f"task={name} has no scripted expert: register one with @register_expert({name!r}) in envs/experts/"
        )
    sees = env.config.perception.sees and not privileged
    return EXPERTS[name](cast(WorkspaceEnv, SeenEnv(env)) if sees else env)
