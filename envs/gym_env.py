"""The Gymnasium interface: one world of a WorkspaceEnv.

import envs, gymnasium
env = gymnasium.make("Deixis/NLReach-v0", robot="panda")
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase

from core.errors import ConfigError, UseError
from core.spaces import action_space, space_of
from envs.mdp.observations import OBSERVATIONS
from envs.registration import can_show, check_list, make_env

RENDER_MODES = ("rgb_array", "human")


class GymEnv(gym.Env):
    """One world. Observations are a Dict of `OBSERVATIONS` with `gymnasium`; the action is a Box in [-1, 1].

    `info` holds `is_success`, `wrong_object`, `at_goal`, `sentence`, and the weighted `reward_terms` by name.

    Args:
        task, robot, control: options of those config groups.
        overrides: more Hydra overrides, such as "task.num_objects=6".
        render_mode: None, "rgb_array" (`render` returns an image) or "human" (a window shows the world
            in real time).

    Raises:
        ConfigError: for an unknown or invalid override, or a window that cannot be opened.
    """

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 20}  # noqa: RUF012

    def __init__(
        self,
        task: str = "nl_reach",
        robot: str = "kuka",
        control: str = "step",
        overrides: Sequence[str] = (),
        render_mode: str | None = None,
    ) -> None:
        if render_mode not in (None, *RENDER_MODES):
            raise ConfigError(f"render_mode={render_mode} must be None, {' or '.join(RENDER_MODES)}")
        check_list(overrides)
        self.render_mode, self._due = render_mode, 0.0
        self.metadata = {**self.metadata, "render_modes": [mode for mode in RENDER_MODES if can_show(mode)]}
        groups = [f"task={task}", f"robot={robot}", f"control={control}", *overrides]
        asked = "render_mode=human" if render_mode == "human" else None
        self._env = make_env(groups, num_worlds=1, render=render_mode is not None, window=asked)
        spec = self._env.observation_spec
        self._keys = [term.key for term in OBSERVATIONS if term.gymnasium and term.key in spec.keys()]
        boxes: dict[str, spaces.Space] = {
            key: space_of(spec[key]) for key in self._keys if spec[key].dtype == torch.float32
        }
        others: dict[str, Any] = {key: space_of(spec[key]) for key in self._keys if key not in boxes}
        self.observation_space = spaces.Dict(boxes, **others)
        self.action_space = action_space(self._env.action_spec)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, NDArray], dict[str, Any]]:
        """Begin an episode. seed: of this and all later episodes; None: continue with the present generator."""
        super().reset(seed=seed)
        if seed is not None:
            self._env.set_seed(seed)
        values = self._env.reset()
        return self._observation(values), self._info(values)

    def step(self, action: NDArray[np.float32]) -> tuple[dict[str, NDArray], float, bool, bool, dict[str, Any]]:
        """One control step. Raises UseError for an action of another shape or type, and before `reset`."""
        values = self._env.step(_as_tensordict(action, self._env.action_spec.shape[-1]))["next"]
        if self.render_mode == "human":
            self._wait()
        return (
            self._observation(values),
            values["reward"].item(),
            values["terminated"].item(),
            values["truncated"].item(),
            self._info(values),
        )

    def render(self) -> NDArray[np.uint8] | None:
        """(height, width, 3) from the workspace's camera if render_mode="rgb_array", else None."""
        return self._env.render() if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Free the world. Idempotent."""
        if not self._env.is_closed:
            self._env.close()

    def _wait(self) -> None:
        """Sleep until a control step's time has passed since the last one, so that the window shows real time."""
        physics = self._env.config.physics
        self._due = max(self._due + physics.time_step * physics.substeps, time.monotonic())
        time.sleep(max(0.0, self._due - time.monotonic()))

    def _observation(self, values: TensorDictBase) -> dict[str, NDArray]:
        arrays = {key: values[key][0].numpy() for key in self._keys}
        return {key: array.astype(np.int8) if array.dtype == bool else array for key, array in arrays.items()}

    def _info(self, values: TensorDictBase) -> dict[str, Any]:
        return {
            "is_success": values["success"].item(),
            "wrong_object": values["wrong_object"].item(),
            "at_goal": values["at_goal"].item(),
            "sentence": self._env.sentence(),
            "reward_terms": dict(zip(self._env.reward_names, values["reward_terms"][0].tolist(), strict=True)),
        }


def _as_tensordict(action: NDArray[np.float32], width: int) -> TensorDict:
    """Return the action as the environment takes it. Raises UseError."""
    try:
        values = np.asarray(action)
    except ValueError:  # lists of different lengths
        values = np.empty(0, object)
    if values.shape != (width,) or values.dtype.kind != "f":
        raise UseError(
            f"step got an action of shape {values.shape} and {values.dtype}; it must be an array of shape ({width},) "
            "and float32"
        )
    return TensorDict({"action": torch.as_tensor(values, dtype=torch.float32)[None]}, [1])
