"""Settings of SAC."""

from __future__ import annotations

from dataclasses import dataclass, fields

from conf.schema import one_of, within
from trainers.algorithms.base_config import OffPolicyConfig
from trainers.algorithms.registry import register
from trainers.algorithms.torchrl_config import TorchRLOffPolicyConfig


@register("sac", builds="sac.SAC")
@dataclass(frozen=True, kw_only=True)
class SACConfig(OffPolicyConfig):
    """Soft actor-critic with automatic temperature, Haarnoja et al. 2018 (arXiv:1812.05905)."""

    name: str = one_of("sac")
    loss: str = one_of("own", "torchrl")  # TorchRL's SACLoss gives the same numbers and takes longer
    tau: float = within(1e-5, 1.0)  # part of the way that the target critics move towards the critics at each step
    initial_alpha: float = within(1e-4, 10.0)  # temperature
    target_entropy: float = within(-10.0, 10.0)  # nats for each dimension of the action

    @property
    def squashes(self) -> bool:
        return True

    def for_torchrl(self, actions: int) -> TorchRLOffPolicyConfig:
        """The settings with which TorchRL's SACLoss computes what SAC computes. actions: width of a move."""
        return TorchRLOffPolicyConfig(
            **{field.name: getattr(self, field.name) for field in fields(OffPolicyConfig)},
            adapter="torchrl_off_policy",
            loss="SACLoss",
            options={
                "loss_function": "l2",
                "alpha_init": self.initial_alpha,
                "target_entropy": self.target_entropy * actions,
            },
            deterministic=False,
            final_std=None,
            critics=2,
            quantiles=1,
            critic_normalisation="none",
            target="soft",
            tau=self.tau,
            target_interval=1,
            actor_every=1,
            adam_beta1=0.9,
            priority_alpha=0.0,
            priority_beta=0.0,
        )
