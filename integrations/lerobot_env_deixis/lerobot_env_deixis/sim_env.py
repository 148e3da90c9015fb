"""One world of a task of Deixis, with observations in the form that LeRobot's evaluation reads."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase

from core.overrides import apply, check, compose
from core.spaces import action_space, public_keys
from envs.config import EnvConfig, read_env
from envs.gym_interface import group_words
from envs.registration import check_list
from envs.sim.workspace import FILM
from envs.workspace_env import WorkspaceEnv

AGENT, OBJECTS = "agent_pos", "environment_state"
NAMES = {"robot": AGENT, "objects": OBJECTS}  # LeRobot's names; the other keys keep theirs


class DeixisSimEnv(gym.Env):
    """One world. Episodes are those of evaluations, and `reset(seed=s)` begins the same one each time.

    Observations: `agent_pos` (R,) float32, the state of the arm; with `cameras`, `pixels` with a picture
    (H, W, 3) uint8 of each, by name; with `objects`, what policies of Deixis read: `environment_state` (K * D,), the
    rows of the objects, and the others under their own keys, as numbers that LeRobot turns into float32. The action
    (A,) is in [-1, 1]. The info is `is_success` alone. The sentence is `task_description`.

    Args: as of `DeixisEnvConfig`.

    Raises:
        ConfigError: for an unknown or invalid override, camera or checkpoint.
    """

    render_mode = "rgb_array"
    observation_space: spaces.Dict

    def __init__(
        self,
        task: str = "nl_reach",
        robot: str = "kuka",
        control: str = "step",
        overrides: Sequence[str] = (),
        checkpoint: str | None = None,
        cameras: Sequence[str] = (FILM,),
        objects: bool = False,
    ) -> None:
        check_list(overrides)
        words = group_words(task, robot, control, overrides)
        config = _of_checkpoint(checkpoint, overrides) if checkpoint else _of_groups(words)
        self._cameras = config.workspace.named_cameras("cameras", cameras)
        self._env = WorkspaceEnv(config, num_worlds=1, render=True)
        keys = public_keys(self._env.observation_spec)
        self._keys = keys if objects else ["robot"]
        period = config.physics.time_step * config.physics.substeps
        self.metadata = {"render_modes": [self.render_mode], "render_fps": max(1, round(1 / period))}
        self.task, self._max_episode_steps = config.task.name, config.task.most_steps
        self.observation_space = self._space()
        self.action_space = action_space(self._env.action_spec)

    def _space(self) -> spaces.Dict:
        parts: dict[str, spaces.Space] = {}
        for key in self._keys:
            spec = self._env.observation_spec[key]
            shape = (spec[0].shape.numel(),)
            if spec.dtype == torch.float32:
                parts[NAMES.get(key, key)] = spaces.Box(-np.inf, np.inf, shape, np.float32)
            else:
                parts[NAMES.get(key, key)] = spaces.Box(0, np.iinfo(np.int64).max, shape, np.int64)
        if self._cameras:
            shapes = {name: (view.height, view.width, 3) for name, view in self._cameras.items()}
            parts["pixels"] = spaces.Dict({name: spaces.Box(0, 255, each, np.uint8) for name, each in shapes.items()})
        return spaces.Dict(parts)

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """The shape of each observation and of the action, by name; that of a picture is `pixels/<camera>`."""
        shapes: dict[str, Any] = {"action": self.action_space.shape}
        for name, space in self.observation_space.items():
            if isinstance(space, spaces.Dict):
                shapes |= {f"{name}/{camera}": each.shape for camera, each in space.items()}
            else:
                shapes[name] = space.shape
        return shapes

    @property
    def task_description(self) -> str:
        """The sentence of the present episode; where the task has no words, its name."""
        return self._env.sentence() or self.task

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin an episode. seed: of this and all later ones; None: go on with the present generator."""
        super().reset(seed=seed)
        if seed is not None:
            self._env.set_seed(seed)
        return self._seen(self._env.reset()), {"is_success": False}

    def step(self, action: NDArray[np.float32]) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """One control step."""
        given = torch.as_tensor(np.asarray(action, np.float32))[None]
        values = self._env.step(TensorDict({"action": given}, [1]))["next"]
        success, terminated, truncated = (values[key].item() for key in ("success", "terminated", "truncated"))
        return self._seen(values), values["reward"].item(), terminated, truncated, {"is_success": success}

    def render(self) -> NDArray[np.uint8]:
        """(H, W, 3) from the camera of films."""
        return self._env.render()

    def close(self) -> None:
        """Free the world. Idempotent."""
        if not self._env.is_closed:
            self._env.close()

    def _seen(self, values: TensorDictBase) -> dict[str, Any]:
        seen: dict[str, Any] = {}
        for key in self._keys:
            array = values[key][0].numpy().reshape(-1)
            seen[NAMES.get(key, key)] = array.astype(np.float32 if array.dtype.kind == "f" else np.int64)
        if self._cameras:
            seen["pixels"] = {name: self._env.render(camera=name) for name in self._cameras}
        return seen


def _of_groups(words: list[str]) -> EnvConfig:
    """Return the config of overrides, for evaluation. Raises ConfigError."""
    check(words)
    return read_env(compose(words)).without_curriculum()


def _of_checkpoint(source: str, overrides: Sequence[str]) -> EnvConfig:
    """Return the config of a policy's own environment, for evaluation. Raises ConfigError."""
    from trainers.run import checkpoint

    saved = checkpoint.load(checkpoint.find(Path(source)), given=list(overrides))
    return read_env(apply(saved["config"], list(overrides))).without_curriculum()
