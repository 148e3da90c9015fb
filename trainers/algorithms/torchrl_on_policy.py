"""Trains with any on-policy loss module of TorchRL that takes an actor and a critic of state values."""

from __future__ import annotations

from tensordict.nn import TensorDictModule

from trainers.algorithms.on_policy import OnPolicyAlgorithm
from trainers.algorithms.specs import Specs
from trainers.algorithms.torchrl_config import TorchRLOnPolicyConfig
from trainers.algorithms.torchrl_losses import build_loss, find_loss
from trainers.models.actors import stochastic_actor
from trainers.models.policy import Policy


class TorchRLOnPolicy(OnPolicyAlgorithm):
    """critic: writes state_value; it may read privileged/goal."""

    def __init__(self, config: TorchRLOnPolicyConfig, policy: Policy, critic: TensorDictModule) -> None:
        given = {"actor_network": stochastic_actor(policy), "critic_network": critic, "functional": False}
        super().__init__(config, policy, critic, build_loss(find_loss(config.loss), config.options, given))

    @classmethod
    def build(cls, config: TorchRLOnPolicyConfig, policy: Policy, specs: Specs) -> TorchRLOnPolicy:
        return cls(config, policy, specs.build_value(policy))
