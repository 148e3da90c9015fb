"""The options of `--policy.type=deixis`."""

from __future__ import annotations

from dataclasses import dataclass, field

from lerobot.configs import NormalizationMode, PreTrainedConfig
from lerobot.optim import AdamWConfig

from core.errors import ConfigError

NOT_TRAINED = "policy.type=deixis is trained by Deixis itself: deixis train task=... robot=..."


@PreTrainedConfig.register_subclass("deixis")
@dataclass
class DeixisConfig(PreTrainedConfig):
    """A trained policy of Deixis.

    checkpoint: a run, a file, or the name of a pretrained policy. A directory that `save_pretrained` wrote holds the
        policy itself, and `checkpoint` is None there.
    """

    checkpoint: str | None = None
    device: str | None = "cpu"
    normalization_mapping: dict[str, NormalizationMode] = field(
        default_factory=lambda: dict.fromkeys(("VISUAL", "STATE", "ENV", "ACTION"), NormalizationMode.IDENTITY)
    )

    @property
    def observation_delta_indices(self) -> None:
        """It reads the present observation only."""

    @property
    def action_delta_indices(self) -> None:
        """It returns one action."""

    @property
    def reward_delta_indices(self) -> None:
        """It reads no rewards."""

    def get_optimizer_preset(self) -> AdamWConfig:
        """Raise ConfigError."""
        raise ConfigError(NOT_TRAINED)

    def get_scheduler_preset(self) -> None:
        """Raise ConfigError."""
        raise ConfigError(NOT_TRAINED)

    def validate_features(self) -> None:
        """Nothing: the policy names what it misses when it acts."""
