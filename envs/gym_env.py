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
from numpy.typing import NDArray
from tensordict import TensorDictBase

from core.errors import ConfigError
from envs.gym_interface import RENDER_MODES, group_words, make_interface
from envs.registration import can_show, check_list, make_env


class GymEnv(gym.Env):
    """One world. Observations are a Dict of `OBSERVATIONS` with `gymnasium`; the action is a Box in [-1, 1].

    `info` holds `is_success`, `wrong_object`, `at_goal`, and the weighted `reward_terms` (T,), whose names are
    `reward_names`. It has numbers only, which readers of vectorised environments take.

    Args:
        task, robot, control: options of those config groups.
        overrides: more Hydra overrides, such as "task.num_objects=6".
        render_mode: None, "rgb_array" (`render` returns an image) or "human" (a window shows the world
            in real time).
        instruction: "tokens" (L,), "embedding" (a vector of floats: `language.SentenceEmbedding`) or "text".
        goal: goal positions in place of words, for HER: `GoalInterface`. Not for tasks whose goal is no position.

    Raises:
        ConfigError: for an unknown or invalid override or argument, or a window that cannot be opened.
    """

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 20}  # noqa: RUF012

    def __init__(
        self,
        task: str = "nl_reach",
        robot: str = "kuka",
        control: str = "step",
        overrides: Sequence[str] = (),
        render_mode: str | None = None,
        instruction: str = "tokens",
        goal: bool = False,
    ) -> None:
        if render_mode not in (None, *RENDER_MODES):
            raise ConfigError(f"render_mode={render_mode} must be None, {' or '.join(RENDER_MODES)}")
        check_list(overrides)
        self.render_mode, self._due = render_mode, 0.0
        self.metadata = {**self.metadata, "render_modes": [mode for mode in RENDER_MODES if can_show(mode)]}
        words = group_words(task, robot, control, overrides)
        asked = "render_mode=human" if render_mode == "human" else None
        self._env = make_env(words, num_worlds=1, render=render_mode is not None, window=asked)
        self._interface = make_interface(self._env, instruction, goal)
        self.observation_space, self.action_space = self._interface.observation_space, self._interface.action_space

    @property
    def sentence(self) -> str:
        """The instruction of the present episode."""
        return self._env.sentence()

    @property
    def reward_names(self) -> list[str]:
        """The names of the reward terms."""
        return list(self._env.reward_names)

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
        values = self._env.step(self._interface.action(action))["next"]
        if self.render_mode == "human":
            self._wait()
        rewards, terminated, truncated = self._interface.outcome(values)
        observed, info = self._observation(values), self._info(values)
        return observed, float(rewards[0]), bool(terminated[0]), bool(truncated[0]), info

    def compute_reward(self, achieved_goal: NDArray, desired_goal: NDArray, info: Any) -> Any:
        """Return the reward of goals (3,), or of many (..., 3), with goal=True. `info` does not matter."""
        return self._interface.compute_reward(achieved_goal, desired_goal, info)

    def render(self) -> NDArray[np.uint8] | None:
        """(height, width, 3) from the camera of films if render_mode="rgb_array", else None."""
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
        return {key: array[0] for key, array in self._interface.observations(values).items()}

    def _info(self, values: TensorDictBase) -> dict[str, Any]:
        infos = {name: array[0] for name, array in self._interface.infos(values).items()}
        return {name: value if value.ndim else value.item() for name, value in infos.items()}
