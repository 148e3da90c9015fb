"""PPO, Schulman et al. 2017 (arXiv:1707.06347), with the clipped surrogate written out.

TorchRL's ClipPPOLoss computes the same losses; `algo.loss=torchrl` uses it. The lines below take less than half of its
time: no distribution objects, no TensorDict copies, no statistics that nothing reports.
"""

from __future__ import annotations

import math

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModule
from torch import Tensor
from torchrl.objectives import ClipPPOLoss

from trainers.algorithms.on_policy import OnPolicyAlgorithm
from trainers.algorithms.settings import PPOConfig
from trainers.algorithms.torchrl_losses import loss_outputs
from trainers.environment import Relabel
from trainers.models.critics import CriticBuilder
from trainers.models.networks import normal_log_prob
from trainers.models.policy import Policy, stochastic_actor

MEASURED = ("loss/actor", "loss/critic", "loss/entropy", "entropy", "kl", "clip_fraction")
MAX_WEIGHT = 2.0  # of a frame; the weight is the likelihood of its move now, over that at collection
NORMAL_ENTROPY = 0.5 * math.log(2 * math.pi * math.e)  # nats, of a normal distribution with scale 1


class PPO(OnPolicyAlgorithm):
    """critic: writes state_value; it may read privileged/goal."""

    def __init__(self, config: PPOConfig, policy: Policy, critic: TensorDictModule) -> None:
        super().__init__(config, policy, critic, MEASURED)
        self.config: PPOConfig = config
        self.log_clip = math.log(1 - config.clip) if config.clip < 1 else -math.inf, math.log(1 + config.clip)
        self.loss = _torchrl_loss(config, policy, critic) if config.loss == "torchrl" else None

    @classmethod
    def build(cls, config: PPOConfig, policy: Policy, critics: CriticBuilder, relabel: Relabel | None) -> PPO:
        return cls(config, policy, critics.build_value())

    @torch.no_grad()
    def compute_advantages(self, batch: TensorDictBase) -> tuple[TensorDictBase, float]:
        """As for other algorithms. Likelihood ratios then refer to the policy at the beginning of the update.

        With `collector.overlap` an older policy has acted. The ratio of both weighs the advantage, and the clipping
        bounds the update alone (Hilton et al. 2022, "Batch size-invariance for policy optimization", arXiv:2110.00641).
        """
        frames, explained = super().compute_advantages(batch)
        log_prob, _ = self.evaluate_moves(frames if self.grounding.active else self.policy.encode(frames.copy()))
        weight = (log_prob - frames["move_log_prob"]).exp().clamp_max(MAX_WEIGHT)
        frames["advantage"] = frames["advantage"] * weight[:, None]
        return frames.set("move_log_prob", log_prob), explained

    def evaluate_moves(self, frames: TensorDictBase) -> tuple[Tensor, Tensor]:
        """Return log-probabilities (B,) of the moves of encoded frames, and scales (B, A) of their distributions."""
        loc, scale = self.policy.move_parameters(frames)
        return normal_log_prob((frames["move"] - loc) / scale, scale).sum(-1), scale

    def compute_losses(self, frames: TensorDictBase) -> dict[str, Tensor]:
        if self.loss is not None:
            return loss_outputs(self.loss, frames)
        config, advantage = self.config, frames["advantage"].squeeze(-1)
        log_prob, scale = self.evaluate_moves(frames)
        log_ratio = log_prob - frames["move_log_prob"]
        clipped = log_ratio.clamp(*self.log_clip)
        gain = (log_ratio.exp() * advantage).minimum(clipped.exp() * advantage)
        entropy = (scale.log() + NORMAL_ENTROPY).sum(-1).mean()
        value = self.critic.module(*(frames[key] for key in self.critic.in_keys))
        return {
            "loss/actor": -gain.mean(),
            "loss/critic": config.critic_weight * (value - frames["value_target"]).square().mean(),
            "loss/entropy": -config.entropy * entropy,
            "entropy": entropy,
            "kl": -log_ratio.mean(),
            "clip_fraction": (clipped != log_ratio).float().mean(),
        }

    def stops_early(self, row: dict[str, Tensor]) -> bool:
        """Return whether the policy has moved beyond 1.5 times target_kl."""
        return bool(self.config.target_kl) and float(row["kl"]) > 1.5 * self.config.target_kl


def _torchrl_loss(config: PPOConfig, policy: Policy, critic: TensorDictModule) -> ClipPPOLoss:
    return ClipPPOLoss(
        stochastic_actor(policy),
        critic,
        clip_epsilon=config.clip,
        entropy_coeff=config.entropy,
        critic_coeff=config.critic_weight,
        loss_critic_type="l2",
        functional=False,  # the networks are not shared, so no parameters need to be swapped in
        log_explained_variance=False,
    )
