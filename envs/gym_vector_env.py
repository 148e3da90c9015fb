"""The vectorised Gymnasium interface: the N worlds of a WorkspaceEnv, which step together in one process.

import envs, gymnasium
worlds = gymnasium.make_vec("Deixis/NLReach-v0", num_envs=16, robot="panda")
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray
from tensordict import TensorDictBase

from core.errors import ConfigError, UseError
from envs.gym_interface import RENDER_MODES, group_words, make_interface
from envs.registration import check_list, make_env

MODES = ", ".join(repr(mode.value) for mode in AutoresetMode)


class GymVectorEnv(gym.vector.VectorEnv):
    """N worlds. Observations, actions and infos are those of `GymEnv`, with the worlds as first dimension.

    With the same seed, world i begins as world i of `make_env(num_worlds=N)`.

    Args:
        num_envs: N.
        task, robot, control: options of those config groups.
        overrides: more Hydra overrides, such as "task.num_objects=6".
        render_mode: None, or "rgb_array" (`render` returns an image of each world).
        autoreset_mode: when an episode that ended is followed by the next one: "NextStep" (by the next `step`,
            whose action and reward are not used), "SameStep" (at once; infos have the last observation as
            `final_obs`, and `final_info`), or "Disabled" (by `reset` with `options={"reset_mask": (N,) bools}`).
        instruction, goal: as of `GymEnv`.

    Raises:
        ConfigError: for an unknown or invalid override or argument.
    """

    def __init__(
        self,
        num_envs: int = 1,
        task: str = "nl_reach",
        robot: str = "kuka",
        control: str = "step",
        overrides: Sequence[str] = (),
        render_mode: str | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        instruction: str = "tokens",
        goal: bool = False,
    ) -> None:
        if render_mode not in (None, RENDER_MODES[0]):
            raise ConfigError(f"render_mode={render_mode} must be None or {RENDER_MODES[0]} for several worlds")
        if num_envs < 1:
            raise ConfigError(f"num_envs={num_envs} must be at least 1")
        check_list(overrides)
        self.render_mode, self.num_envs = render_mode, num_envs
        self.autoreset_mode = _autoreset_mode(autoreset_mode)
        self.metadata = {"render_modes": [RENDER_MODES[0]], "render_fps": 20, "autoreset_mode": self.autoreset_mode}
        words = group_words(task, robot, control, overrides)
        self._env = make_env(words, num_envs, render=render_mode is not None)
        self._interface = make_interface(self._env, instruction, goal)
        self.single_observation_space = self._interface.observation_space
        self.single_action_space = self._interface.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._values: TensorDictBase | None = None  # of the last step or reset
        self._ended = np.zeros(num_envs, bool)

    @property
    def sentences(self) -> tuple[str, ...]:
        """The instruction of each world's present episode."""
        return tuple(self._env.sentence(i) for i in range(self.num_envs))

    @property
    def reward_names(self) -> list[str]:
        """The names of the reward terms."""
        return list(self._env.reward_names)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, NDArray], dict[str, Any]]:
        """Begin an episode in each world, or in those of `options["reset_mask"]`, an array (N,) of bools.

        seed: of this and all later episodes; None: continue with the present generators.

        Raises:
            UseError: for a mask or a seed of another form.
        """
        chosen = self._mask((options or {}).get("reset_mask"))
        if seed is not None:
            if not isinstance(seed, int | np.integer) or not chosen.all():
                raise UseError(f"reset got seed={seed!r}; it must be a whole number, for all worlds together")
            super().reset(seed=int(seed))
            self._env.set_seed(int(seed))
        infos = self._begin(chosen)
        return self._observations(), infos

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[dict[str, NDArray], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """One control step. Raises UseError for actions of another shape or type, and where a world must be reset."""
        taken, over = self._interface.action(actions, self.num_envs), self._ended.copy()
        if over.any() and self.autoreset_mode == AutoresetMode.DISABLED:
            raise UseError(f"step was called, but the episodes of worlds {np.flatnonzero(over).tolist()} are over")
        self._values = self._env.step(taken)["next"]
        rewards, terminated, truncated = self._interface.outcome(self._values)
        infos, self._ended = self._interface.infos(self._values), terminated | truncated
        if self.autoreset_mode == AutoresetMode.NEXT_STEP and over.any():
            infos = self._begin(over)
            rewards[over], terminated[over], truncated[over] = 0.0, False, False
        elif self.autoreset_mode == AutoresetMode.SAME_STEP and self._ended.any():
            final = self._final(infos, self._ended)
            infos = self._begin(self._ended) | final
        return self._observations(), rewards, terminated, truncated, infos

    def compute_reward(self, achieved_goal: NDArray, desired_goal: NDArray, info: Any) -> Any:
        """Return the rewards of goals (..., 3), with goal=True. `info` does not matter."""
        return self._interface.compute_reward(achieved_goal, desired_goal, info)

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Return (height, width, 3) of each world if render_mode="rgb_array", else None."""
        return tuple(map(self._env.render, range(self.num_envs))) if self.render_mode else None

    def close_extras(self) -> None:
        """Free the worlds."""
        if not self._env.is_closed:
            self._env.close()

    def _mask(self, given: Any) -> NDArray[np.bool_]:
        """Return the worlds (N,) that a reset is for. given: the user's mask, or None for all. Raises UseError."""
        if given is None:
            return np.ones(self.num_envs, bool)
        mask = np.asarray(given)
        if mask.shape != (self.num_envs,) or mask.dtype != bool or not mask.any():
            raise UseError(
                f"reset_mask={given!r} must be an array of shape ({self.num_envs},) and bool with a world to reset"
            )
        if self._values is None and not mask.all():
            raise UseError(f"reset_mask={given!r} leaves out worlds that have not been reset yet")
        return mask

    def _begin(self, chosen: NDArray[np.bool_]) -> dict[str, Any]:
        """Begin an episode in the chosen worlds (N,). Returns the infos (N,), which are 0 there."""
        if self._values is None or chosen.all():
            self._values = self._env.reset()
        else:
            present = self._values.clone().set("_reset", torch.from_numpy(chosen)[:, None])
            self._values = self._env.reset(present).exclude("_reset")
        self._ended = self._ended & ~chosen
        return self._interface.infos(self._values)

    def _observations(self) -> dict[str, NDArray]:
        return self._interface.observations(self._values)

    def _final(self, infos: dict[str, Any], ended: NDArray[np.bool_]) -> dict[str, Any]:
        """Return the last observations and infos of the worlds (N,) whose episodes ended, as Gymnasium has them."""
        observed = self._interface.observations(self._values)
        final: dict[str, Any] = {}
        for i in np.flatnonzero(ended).tolist():
            last = {key: copy(of_worlds[i]) for key, of_worlds in observed.items()}
            final = self._add_info(final, {"final_obs": last, "final_info": {k: v[i] for k, v in infos.items()}}, i)
        return final


def _autoreset_mode(given: str | AutoresetMode) -> AutoresetMode:
    try:
        return AutoresetMode(given)
    except ValueError:
        raise ConfigError(f"autoreset_mode={given!r} must be one of {MODES}") from None
