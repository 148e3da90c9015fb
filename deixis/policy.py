"""Trained policies as callables, with the settings of the environment that they were trained in."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
from omegaconf import OmegaConf
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torchrl.envs.utils import ExplorationType, set_exploration_type

from core.errors import UseError
from core.overrides import apply
from envs.config import read_env
from envs.workspace_env import WorkspaceEnv
from trainers.models.policy import Policy
from trainers.run import checkpoint
from trainers.run.checkpoint import fitted_policy


class LoadedPolicy(TensorDictModuleBase):
    """A policy that acts on the observations of its environment: `policy(observation)["action"]`.

    TorchRL takes it wherever it takes a policy, such as in `env.rollout(100, policy)`.

    Attributes:
        path: the file that it was loaded from.
        config: the composed config of its training run, as plain values.
        deterministic: whether it takes the mean action; otherwise it samples, as in training.
    """

    def __init__(self, path: Path, payload: dict[str, Any], deterministic: bool = True) -> None:
        """Build the networks of a checkpoint for its own environment.

        Args:
            path: the file of the checkpoint.
            payload: its content, from `trainers.run.checkpoint.load`.
            deterministic: whether the policy takes its mean action.

        Raises:
            CheckpointError: where it was trained with other words, observations or actions than this version has.
        """
        super().__init__()
        self.path, self.config, self.deterministic = path, payload["config"], deterministic
        env = self.make_env()
        try:
            self._actor = fitted_policy(payload, self.config, env).act
        finally:
            env.close()
        self.in_keys, self.out_keys = self._actor.in_keys, ["action"]

    @property
    def networks(self) -> Policy:
        """The encoder and the actor."""
        return self._actor.policy

    def make_env(
        self,
        num_worlds: int = 1,
        overrides: Sequence[str] = (),
        seed: int = 0,
        render: bool = False,
        instructions: int = 1,
    ) -> WorkspaceEnv:
        """Build the environment that the policy was trained in, without the curriculum.

        Args:
            num_worlds: N, the worlds that step together.
            overrides: Hydra overrides on top of the run's config, such as `task.num_objects=6`.
            seed: of the episodes.
            render: whether to load visuals, which `env.render` needs.
            instructions: of an episode, with `task=anything`: after a success the next one is said, in the room as it
                is then.

        Raises:
            ConfigError: for an override that is unknown, or that changes what the policy was trained with, and for
                several instructions with another task.
        """
        config = read_env(apply(self.config, overrides)).without_curriculum().with_instructions(instructions)
        return WorkspaceEnv(config, num_worlds=num_worlds, seed=seed, render=render)

    @torch.no_grad()
    def forward(self, observation: TensorDictBase) -> TensorDictBase:
        """Write `action` (N, A), in [-1, 1], to an observation (N,) of the environment, and return it.

        Raises UseError for an observation of another kind, such as that of the Gymnasium interface.
        """
        missing = [str(key) for key in self.in_keys if key not in observation.keys(True)]
        if missing:
            raise UseError(
                f"the policy reads {', '.join(missing)}, which this observation lacks: it acts in what its make_env() "
                "builds; an observation of the Gymnasium interface has fewer keys"
            )
        kind = ExplorationType.DETERMINISTIC if self.deterministic else ExplorationType.RANDOM
        with set_exploration_type(kind):
            acted = self._actor(observation.select(*self.in_keys))
        return observation.set("action", acted["action"])

    def __repr__(self) -> str:
        names = ", ".join(f"{group}={self.config[group]['name']}" for group in ("task", "robot", "control", "algo"))
        return f"LoadedPolicy({str(self.path)!r}, {names})"


def load_policy(source: str | Path, deterministic: bool = True, overrides: Sequence[str] = ()) -> LoadedPolicy:
    """Load a trained policy, ready to act.

    Args:
        source: the name of a pretrained policy (`nl_reach_kuka`), a run folder, or a file (`last.pt`, `best.pt`,
            `policy.safetensors`).
        deterministic: whether the policy takes its mean action.
        overrides: of the config that it was trained with, such as `robot.urdf=my_robot.urdf`: a file may not name other
            files itself.

    Raises:
        CheckpointError: where `source` names nothing, or a file that is damaged or made for another version.
        ConfigError: for an override that does not apply, and where the file's config names places that `overrides` do
            not.
    """
    path = checkpoint.find(Path(source))
    payload = checkpoint.load(path, given=overrides)
    payload["config"] = OmegaConf.to_container(apply(payload["config"], overrides), resolve=True)
    return LoadedPolicy(path, payload, deterministic)
