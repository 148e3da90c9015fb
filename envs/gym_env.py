"""The Gymnasium face: one world of a WorkspaceEnv, for those who bring another library.

import envs, gymnasium
env = gymnasium.make("Deixis/NLReach-v0", robot="panda")
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Bounded

OBSERVED = ("robot", "objects", "objects_mask", "instruction", "gesture")  # the last where a person points


class GymEnv(gym.Env):
    """One world. The observation is a Dict of WorkspaceEnv's public keys, the action a Box in [-1, 1].

    info holds `is_success`, `wrong_object`, `at_goal`, `sentence`, and the weighted `reward_terms` by name.
    robot, control, task: options of those config groups. overrides: more Hydra overrides ("task.num_objects=6").
    Raises ConfigError.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012

    def __init__(
        self,
        task: str = "nl_reach",
        robot: str = "kuka",
        control: str = "step",
        overrides: Sequence[str] = (),
        render_mode: str | None = None,
    ) -> None:
        from envs.registration import make_env

        self.render_mode = render_mode
        groups = [f"task={task}", f"robot={robot}", f"control={control}", *overrides]
        self._env = make_env(groups, num_worlds=1, render=render_mode is not None)
        spec = self._env.observation_spec
        words, length = spec["instruction"].space.n, spec["instruction"].shape[-1]
        bounded = [name for name in ("robot", "objects", "gesture") if name in spec.keys()]
        boxes: dict[str, spaces.Space] = {name: _box(spec[name]) for name in bounded}
        self.observation_space = spaces.Dict(
            boxes,
            objects_mask=spaces.MultiBinary(spec["objects_mask"].shape[-1]),
            instruction=spaces.MultiDiscrete([words] * length),
        )
        self.action_space = spaces.Box(-1.0, 1.0, (self._env.action_spec.shape[-1],), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, NDArray], dict[str, Any]]:
        super().reset(seed=seed)
        if seed is not None:
            self._env.set_seed(seed)
        values = self._env.reset()
        return self._observation(values), self._info(values)

    def step(self, action: NDArray[np.float32]) -> tuple[dict[str, NDArray], float, bool, bool, dict[str, Any]]:
        values = self._env.step(_as_tensordict(action))["next"]
        return (
            self._observation(values),
            values["reward"].item(),
            values["terminated"].item(),
            values["truncated"].item(),
            self._info(values),
        )

    def render(self) -> NDArray[np.uint8] | None:
        return self._env.render() if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        if not self._env.is_closed:
            self._env.close()

    def _observation(self, values: TensorDictBase) -> dict[str, NDArray]:
        observation = {name: values[name][0].numpy() for name in OBSERVED if name in values.keys()}
        observation["objects_mask"] = observation["objects_mask"].astype(np.int8)
        return observation

    def _info(self, values: TensorDictBase) -> dict[str, Any]:
        return {
            "is_success": values["success"].item(),
            "wrong_object": values["wrong_object"].item(),
            "at_goal": values["at_goal"].item(),
            "sentence": self._env.sentence(),
            "reward_terms": dict(zip(self._env.reward_names, values["reward_terms"][0].tolist(), strict=True)),
        }


def _as_tensordict(action: NDArray[np.float32]) -> TensorDict:
    return TensorDict({"action": torch.as_tensor(action, dtype=torch.float32)[None]}, [1])


def _box(spec: Bounded) -> spaces.Box:
    return spaces.Box(spec.space.low[0].numpy(), spec.space.high[0].numpy(), dtype=np.float32)
