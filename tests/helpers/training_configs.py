"""Plans small enough for a test."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from omegaconf import OmegaConf
from torchrl.envs import EnvBase

from trainers.config import TrainingConfig, read_training
from trainers.models.policy import Policy, build_policy

CONF = Path(__file__).parents[2] / "conf"


def config(algo: str = "ppo", policy: str = "grounded", overrides: tuple[str, ...] = ()) -> dict[str, Any]:
    """The composed config of a short run on the fake environment, as plain values."""
    base: dict[str, Any] = {
        "total_frames": 512,
        "seed": 0,
        "device": "cpu",
        "update_threads": 1,
        "logger": [],
        "schedule_frames": None,
        "init": None,
        "collector": {"name": "local", "workers": 1, "worlds": 8, "timeout": None, "restarts": 3, "overlap": False},
        "checkpoint": {"every": None, "keep": 0},
        "eval": {
            "episodes": 20,
            "interval": 256,
            "interval_episodes": 8,
            "worlds": 8,
            "video_episodes": 0,
            "overlap": False,
        },
        "algo": OmegaConf.load(CONF / "algo" / f"{algo}.yaml"),
        "policy": OmegaConf.load(CONF / "policy" / f"{policy}.yaml"),
    }
    on_policy = "epochs" in base["algo"]
    small = ["algo.horizon=16", "algo.minibatch=64"] if on_policy else ["algo.batch=32"]
    small += ["algo.learning_starts=64"] * ("learning_starts" in base["algo"])
    merged = OmegaConf.merge(OmegaConf.create(base), OmegaConf.from_dotlist([*small, *overrides]))
    return OmegaConf.to_container(merged, resolve=True)  # type: ignore[return-value]


def training(algo: str = "ppo", policy: str = "grounded", overrides: tuple[str, ...] = ()) -> TrainingConfig:
    return read_training(config(algo, policy, overrides))


def policy_of(env: EnvBase) -> Policy:
    """The policy of `training()` for an environment, with the same weights each time."""
    torch.manual_seed(0)
    return build_policy(training().policy, env.observation_spec, env.action_unit)
