"""SAC with automatic temperature, Haarnoja et al. 2018 (arXiv:1812.05905), with the update written out.

TorchRL's SACLoss computes the same three losses; `algo.loss=torchrl` uses it. Uncompiled it takes 17 ms per step at
batch 256 and 256 x 256 on one core, the lines below about 7 ms. The difference is in swapping parameters in and out
of modules, vmap over the two critics, TensorDict copies and, in distributions, transforms and their caches. The losses
of critics and actor have no gradient in common, so with two threads each is computed on its own.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import torch
import torch.nn.functional as F
from tensordict import NestedKey, TensorDictBase
from torch import Tensor

from trainers.algorithms.algorithm import GROUNDING_METRICS, Part
from trainers.algorithms.off_policy import OffPolicyAlgorithm
from trainers.algorithms.settings import SACConfig
from trainers.algorithms.torchrl_losses import TorchRLOffPolicy
from trainers.environment import Relabel
from trainers.models.critics import CriticBuilder
from trainers.models.networks import Critic, normal_log_prob
from trainers.models.policy import Policy, parameters


class SAC(OffPolicyAlgorithm):
    """critic: two action values on the observations of `critic_keys` and the move."""

    metrics = (
        "loss/actor",
        "loss/critic",
        "loss/alpha",
        "entropy",
        "alpha",
        "q",
        "updates",
        "relabelled",
        *GROUNDING_METRICS,
    )
    saved = ("policy", "critic", "target", "optimizer")

    def __init__(
        self,
        config: SACConfig,
        policy: Policy,
        critic: Critic,
        *,
        critic_keys: Sequence[NestedKey],
        relabel: Relabel | None = None,
    ) -> None:
        super().__init__(config, policy, critic_keys, relabel)
        self.critic, self.tau = critic, config.tau
        self.target = copy.deepcopy(critic).requires_grad_(False)
        self.critic_parameters = parameters(critic)
        self.target_parameters: list[Tensor] = list(self.target.parameters())
        self.log_alpha = torch.tensor(math.log(config.initial_alpha), device=self.device, requires_grad=True)
        learned = [*self.actor_parameters, *self.critic_parameters, self.log_alpha]
        self.optimizer = self.make_optimizer(learned)
        self.target_entropy = config.target_entropy * len(policy.action_unit)
        self.critic_gradients = self.gradients(self.critic_loss, self.critic_parameters)
        self.actor_gradients = self.gradients(self.actor_losses, [*self.actor_parameters, self.log_alpha])

    @classmethod
    def build(
        cls, config: SACConfig, policy: Policy, critics: CriticBuilder, relabel: Relabel | None
    ) -> SAC | TorchRLOffPolicy:
        if config.loss == "torchrl":
            return TorchRLOffPolicy.build(config.for_torchrl(len(policy.action_unit)), policy, critics, relabel)
        return cls(config, policy, critics.build_q(), critic_keys=critics.keys, relabel=relabel)

    def parts(self, frames: TensorDictBase, scenes: TensorDictBase | None) -> list[Part]:
        if not self.compiles:
            self.encode(frames)
        later, present = draw_noise(frames), draw_noise(frames)  # not in the parts, which run in any order
        return [
            *([] if scenes is None else [partial(self.descend_grounding, scenes)]),
            *self.critic_gradients.parts(frames, later),
            *self.actor_gradients.parts(frames, present),
        ]

    def compute_losses(self, frames: TensorDictBase) -> dict[str, Tensor]:
        """Return the three losses. `parts` gives each the gradients of its own parameters only."""
        later, present = draw_noise(frames), draw_noise(frames)
        return self.critic_loss(frames, later) | self.actor_losses(frames, present)

    def critic_loss(self, frames: TensorDictBase, noise: Tensor) -> dict[str, Tensor]:
        """Return the critics' loss on frames (B,). noise: (B, A), of the moves after them."""
        after = frames["next"]
        with torch.no_grad():
            # A truncated frame bootstraps, a terminated one does not.
            action, log_prob = self.sample_moves(after, noise)
            alpha = self.log_alpha.exp()
            next_value = self.target(*self.observed(after), action).amin(0) - alpha * log_prob
            target_value = after["reward"] + self.config.gamma * next_value * ~after["terminated"]
        q = self.critic(*self.observed(frames), frames["move"])
        return {"loss/critic": F.mse_loss(q, target_value.expand_as(q)) * len(q), "q": q.mean()}

    def actor_losses(self, frames: TensorDictBase, noise: Tensor) -> dict[str, Tensor]:
        """Return the losses of the actor and of the temperature on frames (B,). noise: (B, A), of the moves."""
        alpha = self.log_alpha.detach().exp()
        action, log_prob = self.sample_moves(frames, noise)
        value = self.critic(*self.observed(frames), action).amin(0)
        return {
            "loss/actor": (alpha * log_prob - value).mean(),
            "loss/alpha": -self.log_alpha * (log_prob.detach().mean() + self.target_entropy),
            "entropy": -log_prob.mean(),
            "alpha": alpha,
        }

    def sample_moves(self, frames: TensorDictBase, noise: Tensor) -> tuple[Tensor, Tensor]:
        """Return moves (B, A) of standard normal noise (B, A), differentiable, and their log-probability (B, 1)."""
        return sample_tanh_normal(*self.policy.move_parameters(frames), noise)

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


def draw_noise(frames: TensorDictBase) -> Tensor:
    """Return standard normal noise (B, A) for the moves of frames (B,)."""
    return torch.randn_like(frames["move"])


def sample_tanh_normal(loc: Tensor, scale: Tensor, noise: Tensor) -> tuple[Tensor, Tensor]:
    """tanh(loc + scale * noise), (B, A), and the log-probability (B, 1) of such a sample of noise."""
    x = loc + scale * noise
    slope = 2 * (math.log(2) - x - F.softplus(-2 * x))  # log(1 - tanh(x)^2) without cancellation
    return x.tanh(), (normal_log_prob(noise, scale) - slope).sum(-1, keepdim=True)
