"""Trains with any on-policy loss module of TorchRL that takes an actor and a critic of state values."""

from __future__ import annotations

from tensordict import TensorDictBase
from tensordict.nn import TensorDictModule
from torch import Tensor
from torchrl.objectives import LossModule

from trainers.algorithms.on_policy import OnPolicyAlgorithm
from trainers.algorithms.specs import Specs
from trainers.algorithms.torchrl_config import TorchRLOnPolicyConfig
from trainers.algorithms.torchrl_losses import build_loss, find_loss
from trainers.models.actors import stochastic_actor
from trainers.models.policy import Policy

# Outputs of TorchRL's losses, and the names that they are reported under.
OUTPUTS = {
    "loss_objective": "loss/actor",
    "loss_critic": "loss/critic",
    "loss_entropy": "loss/entropy",
    "entropy": "entropy",
    "kl_approx": "kl",
    "clip_fraction": "clip_fraction",
}


class TorchRLOnPolicy(OnPolicyAlgorithm):
    """critic: writes state_value; it may read privileged/goal."""

    def __init__(self, config: TorchRLOnPolicyConfig, policy: Policy, critic: TensorDictModule) -> None:
        # functional=False: its networks are not shared, so no parameters need to be swapped in.
        given = {"actor_network": stochastic_actor(policy), "critic_network": critic, "functional": False}
        self.loss = build_loss(find_loss(config.loss), config.options, given)
        measured = [name for key, name in OUTPUTS.items() if key in self.loss.out_keys]
        super().__init__(config, policy, critic, measured)

    def compute_losses(self, frames: TensorDictBase) -> dict[str, Tensor]:
        return loss_outputs(self.loss, frames)

    @classmethod
    def build(cls, config: TorchRLOnPolicyConfig, policy: Policy, specs: Specs) -> TorchRLOnPolicy:
        return cls(config, policy, specs.build_value(policy))


def loss_outputs(loss: LossModule, frames: TensorDictBase) -> dict[str, Tensor]:
    """The outputs of the loss on frames (B,), under our names."""
    out = loss(frames)
    return {name: out[key] for key, name in OUTPUTS.items() if key in loss.out_keys}
