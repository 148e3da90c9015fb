"""Settings of PPO."""

from __future__ import annotations

from dataclasses import dataclass

from conf.schema import one_of, within
from trainers.algorithms.base_config import OnPolicyConfig
from trainers.algorithms.registry import register


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
