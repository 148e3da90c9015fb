"""Builds the policy and the algorithm of a plan, and restores the policy of a checkpoint."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any

import torch
from torchrl.data import Composite

from core.errors import ConfigError
from trainers.algorithms.algorithm import Algorithm
from trainers.config import Plan, read_plan
from trainers.environment import Relabel, TrainingEnv
from trainers.models.critics import Specs
from trainers.models.policy import MoveBounds, Policy, build_policy
from trainers.run import checkpoint
from trainers.run.checkpoint import extend_vocabulary


def build_algorithm(
    plan: Plan,
    observation_spec: Composite,
    action_unit: Sequence[float],
    vocabulary: Sequence[str] = (),
    relabel: Relabel | None = None,
) -> tuple[Policy, Algorithm]:
    """Networks on run.device and the algorithm that trains them.

    Args:
        plan: of the run.
        observation_spec: of the environment.
        action_unit: of the environment.
        vocabulary: the tokenizer's words, which only policy.encoder=sentence reads.
        relabel: the environment's `hindsight`, which only off-policy algorithms use.
    """
    device = find_device(plan.run.device)
    policy = _build_policy(plan, observation_spec, action_unit, vocabulary).to(device)
    specs = Specs(plan.policy, observation_spec, device, relabel)
    module, _, name = plan.algo.algorithm.rpartition(".")
    cls: type[Algorithm] = getattr(import_module(f"trainers.algorithms.{module}"), name)
    return policy, cls.build(plan.algo, policy, specs)


def restore_policy(
    plan: Plan, observation_spec: Composite, action_unit: Sequence[float], payload: dict[str, Any]
) -> Policy:
    """The policy of a checkpoint (`checkpoint.load`, then `check_fits`), to act on the CPU."""
    policy = _build_policy(plan, observation_spec, action_unit, payload["vocabulary"])
    policy.load_state_dict(payload["algorithm"]["policy"])
    return policy


def fitted_policy(payload: dict[str, Any], config: Any, env: TrainingEnv) -> Policy:
    """The policy of a checkpoint for this environment, built by `config`. Raises CheckpointError if it does not fit."""
    widths = checkpoint.widths(env.observation_spec, env.action_spec)
    payload = extend_vocabulary(payload, env.tokenizer.vocabulary)
    checkpoint.check_fits(payload, list(env.tokenizer.vocabulary), widths)
    return restore_policy(read_plan(config), env.observation_spec, env.action_unit, payload)


def find_device(name: str) -> torch.device:
    """The torch device of run.device. Raises ConfigError if it is not available."""
    try:
        device = torch.device(name)
        torch.ones(1, device=device).item()
    except (RuntimeError, AssertionError) as error:
        reason = str(error).splitlines()[0]
        raise ConfigError(f"device={name} cannot be used: {reason}; choose cpu, or cuda where there is a GPU") from None
    return device


def _build_policy(plan: Plan, spec: Composite, action_unit: Sequence[float], vocabulary: Sequence[str]) -> Policy:
    bounds = MoveBounds(squash=plan.algo.squashes, clip=plan.algo.clips)
    return build_policy(plan.policy, spec, action_unit, bounds, vocabulary)
