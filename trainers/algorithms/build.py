"""A plan and the specs to a policy and the algorithm that teaches it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from torchrl.data import Composite

from conf.schema import ConfigError
from trainers.algorithms.algorithm import Algorithm
from trainers.algorithms.ppo import PPO
from trainers.algorithms.relabelling import Relabel
from trainers.algorithms.sac import SAC
from trainers.config import Plan, PPOConfig, read_plan
from trainers.models.policy import Policy, aim_key, build, build_q, build_value
from trainers.run import checkpoint
from trainers.run.vocabulary import extend_vocabulary


def build_algorithm(
    plan: Plan,
    observation_spec: Composite,
    unit: Sequence[float],
    vocabulary: Sequence[str] = (),
    relabel: Relabel | None = None,
) -> tuple[Policy, Algorithm]:
    """Networks on run.device, with the learner around them.

    unit: the environment's action_unit. vocabulary: the tokenizer's words, which only policy.encoder=sentence reads.
    relabel: the environment's hindsight, which only SAC asks for.
    """
    config, device = plan.policy, find_device(plan.run.device)
    if isinstance(plan.algo, PPOConfig):
        policy = build(config, observation_spec, unit, vocabulary=vocabulary).to(device)
        value = build_value(config, policy, observation_spec).to(device)
        return policy, PPO(plan.algo, policy, value)
    policy = build(config, observation_spec, unit, squash=True, vocabulary=vocabulary).to(device)
    critic = build_q(config, policy, observation_spec).to(device)
    return policy, SAC(plan.algo, policy, critic, aim_key(config, policy), relabel)


def restore_policy(plan: Plan, observation_spec: Composite, unit: Sequence[float], payload: dict[str, Any]) -> Policy:
    """The policy of a checkpoint (`checkpoint.load`, then `check_fits`), to act on the CPU."""
    squash = not isinstance(plan.algo, PPOConfig)
    policy = build(plan.policy, observation_spec, unit, squash, payload["vocabulary"])
    policy.load_state_dict(payload["algorithm"]["policy"])
    return policy


def fitted_policy(payload: dict[str, Any], config: Any, env: Any) -> Policy:
    """The policy of a checkpoint for this environment, built by `config`. Raises CheckpointError for another one."""
    widths = checkpoint.widths(env.observation_spec, env.action_spec)
    payload = extend_vocabulary(payload, env.tokenizer.vocabulary)
    checkpoint.check_fits(payload, list(env.tokenizer.vocabulary), widths)
    return restore_policy(read_plan(config), env.observation_spec, env.action_unit, payload)


def find_device(name: str) -> torch.device:
    """The torch device of run.device. Raises ConfigError for one that is not here."""
    try:
        device = torch.device(name)
        torch.empty(0, device=device)
    except (RuntimeError, AssertionError) as error:
        raise ConfigError(f"device={name} cannot be used: {str(error).splitlines()[0]}") from None
    return device
