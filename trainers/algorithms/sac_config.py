"""Settings of SAC."""

from __future__ import annotations

from dataclasses import dataclass

from conf.schema import one_of, within
from trainers.algorithms.base_config import OffPolicyConfig
from trainers.algorithms.registry import register


@register("sac", builds="sac.SAC")
@dataclass(frozen=True, kw_only=True)
class SACConfig(OffPolicyConfig):
    """Soft actor-critic with automatic temperature, Haarnoja et al. 2018 (arXiv:1812.05905)."""

    name: str = one_of("sac")
    tau: float = within(1e-5, 1.0)  # part of the way that the target critics move towards the critics at each step
    initial_alpha: float = within(1e-4, 10.0)  # temperature
    target_entropy: float = within(-10.0, 10.0)  # nats for each dimension of the action

    @property
    def squashes(self) -> bool:
        return True
