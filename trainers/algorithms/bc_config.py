"""Settings of imitation."""

from __future__ import annotations

from dataclasses import dataclass

from conf.schema import ConfigError, one_of, within
from trainers.algorithms.base_config import AlgorithmConfig
from trainers.algorithms.registry import register


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
