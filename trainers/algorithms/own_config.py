"""Settings of imitation."""

from __future__ import annotations

from dataclasses import dataclass, fields

from core.errors import ConfigError
from core.schema import one_of, within
from trainers.algorithms.registry import AlgorithmConfig, OffPolicyConfig, OnPolicyConfig, register
from trainers.algorithms.torchrl_config import TorchRLOffPolicyConfig


@register("bc", builds="bc.BC")
@dataclass(frozen=True, kw_only=True)
class BCConfig(AlgorithmConfig):
    """Behaviour cloning on states that the policy meets: DAgger, Ross et al. 2011 (arXiv:1011.0686)."""

    on_policy = False

    name: str = one_of("bc")
    batch: int = within(2)
    updates_per_frame: float = within(0.0, 100.0)  # gradient steps per collected frame
    buffer: int = within(100)  # labelled frames that are kept, the latest ones
    grounding_every: int = within(1)  # gradient steps for each one that includes the grounding loss
    std: float = within(0.01, 2.0)  # exploration noise of the policy's moves
    expert_until: float = within(0.0, 1.0)  # share of the run over which the expert's share of the steps falls to 0

    @property
    def imitates(self) -> bool:
        return True

    def check_batch(self, frames: int) -> None:
        needed = max(frames, self.batch)
        if self.buffer < needed:
            raise ConfigError(f"algo.buffer={self.buffer} must hold a batch of {needed} frames")


@register("ppo", builds="ppo.PPO")
@dataclass(frozen=True, kw_only=True)
class PPOConfig(OnPolicyConfig):
    """Proximal policy optimisation, Schulman et al. 2017 (arXiv:1707.06347)."""

    name: str = one_of("ppo")
    loss: str = one_of("own", "torchrl")  # TorchRL's ClipPPOLoss gives the same numbers and takes longer
    clip: float = within(1e-3, 1.0)
    entropy: float = within(0.0, 1.0)  # weight of the entropy bonus
    critic_weight: float = within(0.0, 100.0)
    target_kl: float = within(0.0)  # an update ends early beyond 1.5 times this; 0 = never


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
