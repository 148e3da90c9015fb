"""The settings that algorithms share. Imports no torch, so that a wrong value is refused at once."""

from __future__ import annotations

import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any, ClassVar, TypeVar

import trainers.algorithms as package
from core.errors import ConfigError, did_you_mean
from core.schema import Checked, read, within


@dataclass(frozen=True, kw_only=True)
class AlgorithmConfig(Checked):
    """The settings of every algorithm; subclasses are registered by name (`trainers.algorithms.registry`)."""

    algorithm: ClassVar[str]  # <module>.<class> of trainers.algorithms, set by `register`
    on_policy: ClassVar[bool]  # whether an update learns from the latest batch alone

    name: str
    anneal_lr: bool  # linearly to zero over the run
    horizon: int = within(1, 4096)  # steps of each world between updates
    lr: float = within(1e-7, 1.0)
    max_grad_norm: float = within(1e-3)
    grounding_weight: float = within(0.0, 100.0)  # 0 = the words must be learned from reward alone
    grounding_lr: float = within(1e-7, 1.0)  # of the parameters that only the grounding loss trains; annealed like lr
    grounding_batch: int = within(1)  # scenes of one gradient step of the grounding loss
    grounding_memory: int = within(1)  # latest scenes, on which the grounding loss is computed
    grounding_scenes: int = within(0)  # scenes added at each update that are drawn and described but never simulated

    @property
    def squashes(self) -> bool:
        """Whether a move is the tanh of a normal sample."""
        return False

    @property
    def clips(self) -> bool:
        """Whether a move is a deterministic mean with exploration noise, clipped to [-1, 1]."""
        return False

    @property
    def imitates(self) -> bool:
        """Whether the worlds must observe the actions of the task's expert."""
        return False

    def check_batch(self, frames: int) -> None:
        """Raise ConfigError if batches of this number of frames do not fit the other settings."""


@dataclass(frozen=True, kw_only=True)
class OnPolicyConfig(AlgorithmConfig):
    """Epochs of minibatches over the latest batch, with generalised advantages."""

    on_policy = True

    horizon: int = within(2, 4096)  # steps of each world between updates
    epochs: int = within(1, 100)
    gamma: float = within(0.0, 1.0)
    minibatch: int = within(2)
    lmbda: float = within(0.0, 1.0)
    # Discount factor at the end of the run, after a linear change; None: gamma.
    final_gamma: float | None = within(0.0, 1.0, default=None)
    final_std: float = within(0.01, 2.0)  # upper bound of the exploration noise at the end, after a linear decline
    # Share of the run, at its beginning, in which the actor does not learn.
    critic_warmup: float = within(0.0, 1.0, default=0.0)
    # Share of gradient steps and of added scenes for the grounding loss: this times the attention's error on fresh
    # scenes, at most 1 and at least 1/8. None = all.
    grounding_gain: float | None = within(0.0)

    def discount(self, progress: float) -> float:
        """The discount factor after this share of the run."""
        last = self.gamma if self.final_gamma is None else self.final_gamma
        return self.gamma + (last - self.gamma) * progress

    def check_batch(self, frames: int) -> None:
        if self.minibatch > frames:
            raise ConfigError(
                f"algo.minibatch={self.minibatch} is more than the {frames} frames of a batch: "
                "lower it, or raise algo.horizon or collector.worlds"
            )


@dataclass(frozen=True, kw_only=True)
class OffPolicyConfig(AlgorithmConfig):
    """Gradient steps on frames drawn from a replay buffer, with hindsight relabelling."""

    on_policy = False

    batch: int = within(2)
    gamma: float = within(0.0, 1.0)
    updates_per_frame: float = within(0.0, 100.0)  # gradient steps per collected frame
    buffer: int = within(100)  # capacity of the replay buffer in frames
    learning_starts: int = within(0)  # frames collected before the first gradient step
    grounding_every: int = within(1)  # gradient steps for each one that includes the grounding loss
    hindsight: float = within(0.0, 100.0)  # relabelled copies of each episode; 0 = none, a fraction is a probability
    # First frames in which the task's expert acts. Half of each batch is drawn from them: RLPD, Ball et al. 2023
    # (arXiv:2302.02948).
    demonstrations: int = within(0, default=0)

    @property
    def imitates(self) -> bool:
        return self.demonstrations > 0

    def check_batch(self, frames: int) -> None:
        needed = max(frames, self.batch)
        if self.buffer < needed:
            raise ConfigError(f"algo.buffer={self.buffer} must hold a batch of {needed} frames")
        if 0 < self.demonstrations < frames:
            raise ConfigError(
                f"algo.demonstrations={self.demonstrations} must be 0, or at least a batch: {frames} frames"
            )


_CONFIGS: dict[str, type[AlgorithmConfig]] = {}
C = TypeVar("C", bound=type[AlgorithmConfig])


def register(name: str, builds: str) -> Callable[[C], C]:
    """A decorator for a class of settings.

    Args:
        name: `algo.adapter` of the configs that it reads, or else their `algo.name`.
        builds: <module>.<class> of trainers.algorithms, the algorithm with these settings. It is named rather than
            imported, so that settings are read without torch.
    """

    def add(cls: C) -> C:
        cls.algorithm = builds
        if _CONFIGS.setdefault(name, cls) is not cls:
            raise ValueError(f"two algorithms are registered as {name!r}: {_CONFIGS[name]} and {cls}")
        return cls

    return add


@cache
def config_classes() -> dict[str, type[AlgorithmConfig]]:
    """The classes of settings by the names they are registered under."""
    for module in pkgutil.iter_modules(package.__path__):
        if module.name.endswith("_config"):
            import_module(f"{package.__name__}.{module.name}")
    return dict(_CONFIGS)


def read_algorithm(node: Any) -> AlgorithmConfig:
    """The key `algo` of a composed config. Raises ConfigError."""
    classes, get = config_classes(), getattr(node, "get", lambda key: None if key == "adapter" else node)
    key = "adapter" if get("adapter") else "name"
    name = get(key)
    if name not in classes:
        raise ConfigError(f"algo.{key}={name} is not known" + did_you_mean(str(name), classes))
    return read(classes[name], node, "algo")
