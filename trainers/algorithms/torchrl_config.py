"""Settings of the two adapters that train with any of TorchRL's loss modules."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from core.errors import ConfigError
from core.schema import one_of, within
from trainers.algorithms.registry import OffPolicyConfig, OnPolicyConfig, register


@register("torchrl_on_policy", builds="torchrl_losses.TorchRLOnPolicy")
@dataclass(frozen=True, kw_only=True)
class TorchRLOnPolicyConfig(OnPolicyConfig):
    """An on-policy loss of TorchRL: A2CLoss, PPOLoss, ClipPPOLoss, ..."""

    adapter: str = one_of("torchrl_on_policy")
    loss: str  # a class of torchrl.objectives, or <module>.<class> of trainers.algorithms
    options: dict[str, Any]  # keyword arguments of the loss


@register("torchrl_off_policy", builds="torchrl_losses.TorchRLOffPolicy")
@dataclass(frozen=True, kw_only=True)
class TorchRLOffPolicyConfig(OffPolicyConfig):
    """An off-policy loss of TorchRL: TD3Loss, SACLoss, CrossQLoss, TQCLoss, REDQLoss, DDPGLoss, ..."""

    adapter: str = one_of("torchrl_off_policy")
    loss: str  # a class of torchrl.objectives, or <module>.<class> of trainers.algorithms
    options: dict[str, Any]  # keyword arguments of the loss
    deterministic: bool  # the actor writes the move itself, and exploration noise of policy.initial_std is added
    final_std: float | None = within(0.01, 2.0)  # deterministic: exploration noise at the end, after a linear decline
    critics: int = within(1, 100)
    quantiles: int = within(1, 1000)  # outputs of each critic; 1 = the expected return
    critic_normalisation: str = one_of("none", "layer", "batch_renorm")
    target: str = one_of("none", "soft", "hard")  # how the target networks follow
    tau: float = within(1e-5, 1.0)  # soft: part of the way at each step
    target_interval: int = within(1)  # hard: gradient steps between two copies
    actor_every: int = within(1)  # gradient steps of the critics for each one of actor and temperature
    adam_beta1: float = within(0.0, 0.999)
    priority_alpha: float = within(0.0, 1.0)  # exponent of prioritised replay; 0 = uniform
    priority_beta: float = within(0.0, 1.0)  # exponent of its importance weights

    @property
    def squashes(self) -> bool:
        return not self.deterministic

    @property
    def clips(self) -> bool:
        return self.deterministic

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.deterministic != (self.final_std is not None):
            needed = "a number" if self.deterministic else "null"
            raise ConfigError(f"final_std={self.final_std} must be {needed} with deterministic={self.deterministic}")
        if self.demonstrations and self.priority_alpha:
            raise ConfigError(
                f"demonstrations={self.demonstrations} needs priority_alpha=0: they are drawn evenly, half of a batch"
            )
