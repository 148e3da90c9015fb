"""The inputs from which an algorithm builds its critics."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from tensordict.nn import TensorDictModule
from torchrl.data import Composite

from trainers.config import PolicyConfig
from trainers.environment import Relabel
from trainers.models import critics
from trainers.models.networks import Critic
from trainers.models.policy import Policy


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
        return critics.critic_key(self.config, policy)

    def build_value(self, policy: Policy) -> TensorDictModule:
        """A state value: writes state_value (N, 1)."""
        return critics.build_value(self.config, policy, self.observation).to(self.device)

    def build_q(self, policy: Policy) -> Critic:
        """Two action values on (robot, critic_key, move): (2, N, 1)."""
        return critics.build_q(self.config, policy, self.observation).to(self.device)

    def build_q_modules(self, policy: Policy, count: int, quantiles: int, normalisation: str) -> list[TensorDictModule]:
        """`count` action values as TorchRL's losses take them: each writes state_action_value (N, quantiles)."""
        modules = critics.build_q_modules(self.config, policy, self.observation, count, quantiles, normalisation)
        return [module.to(self.device) for module in modules]
