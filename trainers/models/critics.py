"""Critics, built from specs.

    robot, privileged/goal or context ─► state value
    robot, privileged/goal or context, move ─► action values

A critic may be given the goal, which the policy has to infer (asymmetric actor-critic, Pinto et al. 2018,
arXiv:1710.06542): it is not used after training.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from tensordict.nn import TensorDictModule
from torchrl.data import Composite

from trainers.config import PolicyConfig
from trainers.environment import Relabel
from trainers.models.networks import Critic, Normalise, SingleCritic
from trainers.models.policy import Policy

GOAL = ("privileged", "goal")


def critic_key(config: PolicyConfig, policy: Policy) -> str | tuple[str, str]:
    """The key that a critic reads beside robot and move: the goal itself, or the policy's context."""
    return GOAL if config.privileged_critic else policy.context_key


def build_value(config: PolicyConfig, policy: Policy, observation_spec: Composite) -> TensorDictModule:
    """A state value: writes state_value (N, 1)."""
    robot, goal = _inputs(config, policy, observation_spec)
    value = SingleCritic(robot, goal, 0, config.critic_hidden, config.activation, heads=1)
    return TensorDictModule(value, in_keys=["robot", critic_key(config, policy)], out_keys=["state_value"])


def build_q(config: PolicyConfig, policy: Policy, observation_spec: Composite) -> Critic:
    """Two action values on (robot, critic_key, move): (2, N, 1)."""
    robot, goal = _inputs(config, policy, observation_spec)
    return Critic(robot, goal, len(policy.action_unit), config.critic_hidden, config.activation, heads=2)


def build_q_modules(
    config: PolicyConfig,
    policy: Policy,
    observation_spec: Composite,
    count: int,
    quantiles: int = 1,
    normalisation: str = "none",
) -> list[TensorDictModule]:
    """`count` action values as TorchRL's losses take them: each writes state_action_value (N, quantiles)."""
    keys = ["robot", critic_key(config, policy), "move"]
    # Each has buffers of its own: TorchRL expands shared ones to views, which `load_state_dict` cannot write.
    critics = [
        SingleCritic(
            *_inputs(config, policy, observation_spec),
            len(policy.action_unit),
            config.critic_hidden,
            config.activation,
            heads=1,
            outputs=quantiles,
            normalisation=normalisation,
        )
        for _ in range(count)
    ]
    return [TensorDictModule(critic, in_keys=keys, out_keys=["state_action_value"]) for critic in critics]


def _inputs(config: PolicyConfig, policy: Policy, spec: Composite) -> tuple[Normalise, Normalise | int]:
    goal = Normalise(spec[GOAL]) if config.privileged_critic else policy.encoder.outputs
    return Normalise(spec["robot"]), goal


@dataclass(frozen=True)
class Specs:
    """The inputs from which an algorithm builds its critics.

    Attributes:
        config: the key `policy` of a run.
        observation: the environment's observation spec.
        device: of the networks.
        relabel: the environment's `hindsight`; None: no relabelling.
    """

    config: PolicyConfig
    observation: Composite
    device: torch.device
    relabel: Relabel | None = None

    def critic_key(self, policy: Policy) -> str | tuple[str, str]:
        """The key that a critic reads beside robot and move."""
        return critic_key(self.config, policy)

    def build_value(self, policy: Policy) -> TensorDictModule:
        """A state value: writes state_value (N, 1)."""
        return build_value(self.config, policy, self.observation).to(self.device)

    def build_q(self, policy: Policy) -> Critic:
        """Two action values on (robot, critic_key, move): (2, N, 1)."""
        return build_q(self.config, policy, self.observation).to(self.device)

    def build_q_modules(self, policy: Policy, count: int, quantiles: int, normalisation: str) -> list[TensorDictModule]:
        """`count` action values as TorchRL's losses take them: each writes state_action_value (N, quantiles)."""
        modules = build_q_modules(self.config, policy, self.observation, count, quantiles, normalisation)
        return [module.to(self.device) for module in modules]
