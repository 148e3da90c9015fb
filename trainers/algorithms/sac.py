"""SAC with automatic temperature, Haarnoja et al. 2018 (arXiv:1812.05905), with the update written out.

TorchRL's SACLoss computes the same three losses; `algo.loss=torchrl` uses it. It takes 17 ms per step at batch 256 and
256 x 256 on one core (12 ms compiled), the lines below about 7 ms. The difference is in swapping parameters in and out
of modules, vmap over the two critics, TensorDict copies and, in distributions, transforms and their caches.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import torch
import torch.nn.functional as F
from tensordict import TensorDictBase
from torch import Tensor

from trainers.algorithms.grounding_supervision import METRICS
from trainers.algorithms.off_policy import OffPolicyAlgorithm
from trainers.algorithms.relabelling import Relabel
from trainers.algorithms.sac_config import SACConfig
from trainers.algorithms.specs import Specs
from trainers.algorithms.torchrl_off_policy import TorchRLOffPolicy
from trainers.models.networks import Critic, normal_log_prob
from trainers.models.policy import Policy, parameters


class SAC(OffPolicyAlgorithm):
    """critic: two action values on (robot, critic_key, move)."""

    metrics = (
        "loss/actor",
        "loss/critic",
        "loss/alpha",
        "entropy",
        "alpha",
        "q",
        "updates",
        "relabelled",
        *METRICS,
    )
    saved = ("policy", "critic", "target", "optimizer")

    def __init__(
        self,
        config: SACConfig,
        policy: Policy,
        critic: Critic,
        critic_key: str | tuple[str, str],
        relabel: Relabel | None = None,
    ) -> None:
        super().__init__(config, policy, critic_key, relabel)
        self.critic, self.tau = critic, config.tau
        self.target = copy.deepcopy(critic).requires_grad_(False)
        self.critic_parameters = parameters(critic)
        self.target_parameters: list[Tensor] = list(self.target.parameters())
        self.log_alpha = torch.tensor(math.log(config.initial_alpha), device=self.device, requires_grad=True)
        learned = [*self.actor_parameters, *self.critic_parameters, self.log_alpha]
        self.optimizer = self.make_optimizer(learned)
        self.target_entropy = config.target_entropy * len(policy.action_unit)

    @classmethod
    def build(cls, config: SACConfig, policy: Policy, specs: Specs) -> SAC | TorchRLOffPolicy:
        if config.loss == "torchrl":
            return TorchRLOffPolicy.build(config.for_torchrl(len(policy.action_unit)), policy, specs)
        return cls(config, policy, specs.build_q(policy), specs.critic_key(policy), specs.relabel)

    def compute_losses(self, frames: TensorDictBase) -> dict[str, Tensor]:
        """The three losses; no gradient of one reaches the parameters of another."""
        alpha = self.log_alpha.detach().exp()
        after = frames["next"]
        with torch.no_grad():
            # A truncated frame bootstraps, a terminated one does not.
            action, log_prob = self.sample_moves(after)
            next_value = self.target(after["robot"], after[self.critic_key], action).amin(0) - alpha * log_prob
            target_value = after["reward"] + self.config.gamma * next_value * ~after["terminated"]
        q = self.critic(frames["robot"], frames[self.critic_key], frames["move"])
        action, log_prob = self.sample_moves(frames)
        with frozen(self.critic_parameters):  # saves the time of their gradients
            value = self.critic(frames["robot"], frames[self.critic_key], action).amin(0)
        return {
            "loss/critic": F.mse_loss(q, target_value.expand_as(q)) * len(q),
            "loss/actor": (alpha * log_prob - value).mean(),
            "loss/alpha": -self.log_alpha * (log_prob.detach().mean() + self.target_entropy),
            "entropy": -log_prob.mean(),
            "alpha": alpha,
            "q": q.mean(),
        }

    def sample_moves(self, frames: TensorDictBase) -> tuple[Tensor, Tensor]:
        """Moves (B, A), differentiable, and their log-probability (B, 1)."""
        return sample_tanh_normal(*self.policy.move_parameters(frames))

    def after_step(self, frames: TensorDictBase) -> None:
        """Move the target critics towards the critics."""
        with torch.no_grad():
            torch._foreach_lerp_(self.target_parameters, self.critic_parameters, self.tau)

    def state_dict(self) -> dict[str, Any]:
        return super().state_dict() | {"log_alpha": self.log_alpha.detach()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        super().load_state_dict(state)
        with torch.no_grad():
            self.log_alpha.copy_(state["log_alpha"])


@contextmanager
def frozen(parameters: Iterable[Tensor]) -> Iterator[None]:
    """Within this block the parameters take no gradients, while gradients flow through their products."""
    for parameter in parameters:
        parameter.requires_grad_(False)
    try:
        yield
    finally:
        for parameter in parameters:
            parameter.requires_grad_(True)


def sample_tanh_normal(loc: Tensor, scale: Tensor) -> tuple[Tensor, Tensor]:
    """A sample of tanh(Normal(loc, scale)), (B, A), and its log-probability, (B, 1)."""
    noise = torch.randn_like(loc)
    x = loc + scale * noise
    slope = 2 * (math.log(2) - x - F.softplus(-2 * x))  # log(1 - tanh(x)^2) without cancellation
    return x.tanh(), (normal_log_prob(noise, scale) - slope).sum(-1, keepdim=True)
