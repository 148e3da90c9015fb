"""The settings of each algorithm, by the name that they are registered under.

This file imports no torch, so that a wrong value is refused at once.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass, fields
from importlib import import_module
from importlib.util import find_spec
from typing import Any, ClassVar, TypeVar

from core.errors import ConfigError, did_you_mean
from core.plugins import load_plugins
from core.schema import Checked, checked_by, one_of, read, within, word

MOST_FRAMES = 10**9  # of a batch, a buffer or a memory
COMPILED_FROM = 5_000  # gradient steps: from about here on, a first compilation of 5 to 30 s is repaid
COMPILERS = "g++", "clang++", "c++"
PACKAGE = "trainers.algorithms"  # of the algorithms and, with dotted names, of losses


_CLASSES: dict[str, type[AlgorithmConfig]] = {}


@dataclass(frozen=True, kw_only=True)
class AlgorithmConfig(Checked):
    """The settings of every algorithm; `register` names those of one algorithm."""

    algorithm: ClassVar[str]  # <module>.<class>, set by `register`
    for_pictures: ClassVar[str | None] = None  # the same, of policies that see pictures; None: it trains none
    on_policy: ClassVar[bool]  # whether an update learns from the latest batch alone

    name: str = word()
    anneal_lr: bool  # linearly to zero over the run
    horizon: int = within(1, 4096)  # steps of each world between updates
    lr: float = within(1e-7, 1.0)
    max_grad_norm: float = within(1e-3, 1e6)
    grounding_weight: float = within(0.0, 100.0)  # 0 = the words must be learned from reward alone
    grounding_lr: float = within(1e-7, 1.0)  # of the parameters that only the grounding loss trains; annealed like lr
    grounding_batch: int = within(1, MOST_FRAMES)  # scenes of one gradient step of the grounding loss
    grounding_memory: int = within(1, MOST_FRAMES)  # latest scenes, on which the grounding loss is computed
    grounding_scenes: int = within(
        0, MOST_FRAMES
    )  # scenes added at each update that are drawn and described but never simulated

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


def find_compiler() -> str | None:
    """Return the C++ compiler that `compile` uses: that of $CXX, or else the first of COMPILERS that is installed."""
    names = (os.environ["CXX"],) if os.environ.get("CXX") else COMPILERS
    return next((found for found in map(shutil.which, names) if found), None)


C = TypeVar("C", bound=type[AlgorithmConfig])


def register(name: str, builds: str) -> Callable[[C], C]:
    """Return a decorator for a class of settings.

    Args:
        name: `algo.adapter` of the configs that it reads, or else their `algo.name`.
        builds: <module>.<class>, the algorithm with these settings: a module in `PACKAGE`, or of an own package. It is
            named rather than imported, so that settings are read without torch.
    """

    def add(cls: C) -> C:
        cls.algorithm = builds
        if _CLASSES.setdefault(name, cls) is not cls:
            raise ValueError(f"two algorithms are registered as {name!r}: {_CLASSES[name]} and {cls}")
        return cls

    return add


def read_algorithm(node: Any) -> AlgorithmConfig:
    """Return the key `algo` of a composed config. Raises ConfigError."""
    get = getattr(node, "get", lambda key: None if key == "adapter" else node)
    key = "adapter" if get("adapter") else "name"
    name = str(get(key))
    if name not in _CLASSES and name.isidentifier() and find_spec(f"{PACKAGE}.{name}"):
        import_module(f"{PACKAGE}.{name}")  # of an algorithm that registers its settings in its own file
    if name not in _CLASSES:
        load_plugins()
    if name not in _CLASSES:
        raise ConfigError(f"algo.{key}={name} is not known" + did_you_mean(name, _CLASSES))
    return read(_CLASSES[name], node, "algo")


def import_class(path: str) -> Any:
    """Return <module>.<class>: of a module in `PACKAGE` if there is one of this name. Raises ImportError."""
    module, _, name = path.rpartition(".")
    ours = module and find_spec(f"{PACKAGE}.{module.partition('.')[0]}")
    found = getattr(import_module(f"{PACKAGE}.{module}" if ours else module), name, None)
    if found is None:
        raise ImportError(f"{module} has no class {name}")
    return found


@dataclass(frozen=True, kw_only=True)
class OnPolicyConfig(AlgorithmConfig):
    """Epochs of minibatches over the latest batch, with generalised advantages."""

    on_policy = True

    horizon: int = within(2, 4096)  # steps of each world between updates
    epochs: int = within(1, 100)
    gamma: float = within(0.0, 1.0)
    minibatch: int = within(2, MOST_FRAMES)
    lmbda: float = within(0.0, 1.0)
    # Discount factor at the end of the run, after a linear change; None: gamma.
    final_gamma: float | None = within(0.0, 1.0, default=None)
    final_std: float = within(0.01, 2.0)  # upper bound of the exploration noise at the end, after a linear decline
    # Share of the run, at its beginning, in which the actor does not learn.
    critic_warmup: float = within(0.0, 1.0, default=0.0)
    # Share of gradient steps and of added scenes for the grounding loss: this times the attention's error on fresh
    # scenes, at most 1 and at least 1/8. None = all.
    grounding_gain: float | None = within(0.0, 1e6)

    def discount(self, progress: float) -> float:
        """Return the discount factor after this share of the run."""
        last = self.gamma if self.final_gamma is None else self.final_gamma
        return self.gamma + (last - self.gamma) * progress

    def check_batch(self, frames: int) -> None:
        if self.minibatch > frames:
            raise ConfigError(
                f"algo.minibatch={self.minibatch} is more than the {frames} frames of a batch: "
                "lower it, or raise algo.horizon or collector.worlds"
            )


@dataclass(frozen=True, kw_only=True)
class ReplayConfig(AlgorithmConfig):
    """Gradient steps on frames that were kept: so many for each collected one."""

    on_policy = False

    batch: int = within(2, MOST_FRAMES)
    updates_per_frame: float = within(1e-6, 100.0)  # gradient steps per collected frame
    buffer: int = within(100, MOST_FRAMES)  # frames that are kept, the latest ones
    grounding_every: int = within(1, 1_000_000)  # gradient steps for each one that includes the grounding loss
    # Whether losses and gradients are compiled; auto: in a run of COMPILED_FROM gradient steps or more, on a CPU, where
    # there is a C++ compiler. `train.py` writes the choice into the run's config. Not with policy=pixels.
    compile: str = one_of("auto", "on", "off", default="off")

    def choose_compilation(self, frames: int, device: str) -> str:
        """Return on or off, the value of `compile` in a run of so many frames on a device. Raises ConfigError."""
        possible = find_compiler() is not None and device == "cpu"
        if self.compile == "on" and not possible:
            raise ConfigError(
                f"algo.compile=on requires device=cpu, not {device}"
                if device != "cpu"
                else "algo.compile=on requires a C++ compiler such as g++; install one, or take algo.compile=auto"
            )
        if self.compile == "auto":
            return "on" if possible and frames * self.updates_per_frame >= COMPILED_FROM else "off"
        return self.compile

    def check_batch(self, frames: int) -> None:
        needed = max(frames, self.batch)
        if self.buffer < needed:
            raise ConfigError(f"algo.buffer={self.buffer} must hold a batch of {needed} frames")


@dataclass(frozen=True, kw_only=True)
class OffPolicyConfig(ReplayConfig):
    """Gradient steps on frames drawn from a replay buffer, with hindsight relabelling."""

    gamma: float = within(0.0, 1.0)
    learning_starts: int = within(0, MOST_FRAMES)  # frames collected before the first gradient step
    hindsight: float = within(0.0, 100.0)  # relabelled copies of each episode; 0 = none, a fraction is a probability
    # First frames in which the task's expert acts. Half of each batch is drawn from them: RLPD, Ball et al. 2023
    # (arXiv:2302.02948).
    demonstrations: int = within(0, MOST_FRAMES, default=0)

    @property
    def imitates(self) -> bool:
        return self.demonstrations > 0

    def check_batch(self, frames: int) -> None:
        super().check_batch(frames)
        if 0 < self.demonstrations < frames:
            raise ConfigError(
                f"algo.demonstrations={self.demonstrations} must be 0, or at least a batch: {frames} frames"
            )


@register("ppo", builds="ppo.PPO")
@dataclass(frozen=True, kw_only=True)
class PPOConfig(OnPolicyConfig):
    """Proximal policy optimisation, Schulman et al. 2017 (arXiv:1707.06347)."""

    name: str = one_of("ppo")
    loss: str = one_of("own", "torchrl")  # TorchRL's ClipPPOLoss gives the same numbers and takes longer
    clip: float = within(1e-3, 1.0)
    entropy: float = within(0.0, 1.0)  # weight of the entropy bonus
    critic_weight: float = within(0.0, 100.0)
    target_kl: float = within(0.0, 1e6)  # an update ends early beyond 1.5 times this; 0 = never


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
        """Return the settings with which TorchRL's SACLoss computes what SAC computes. actions: width of a move."""
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
        )


@register("bc", builds="bc.BC")
@dataclass(frozen=True, kw_only=True)
class BCConfig(ReplayConfig):
    """Behaviour cloning on states that the policy meets: DAgger, Ross et al. 2011 (arXiv:1011.0686)."""

    for_pictures = "picture_bc.PictureBC"

    name: str = one_of("bc")
    std: float = within(0.01, 2.0)  # exploration noise of the policy's moves
    expert_until: float = within(0.0, 1.0)  # share of the run over which the expert's share of the steps falls to 0

    @property
    def imitates(self) -> bool:
        return True


@register("torchrl_on_policy", builds="torchrl_losses.TorchRLOnPolicy")
@dataclass(frozen=True, kw_only=True)
class TorchRLOnPolicyConfig(OnPolicyConfig):
    """An on-policy loss of TorchRL: A2CLoss, PPOLoss, ClipPPOLoss, ..."""

    adapter: str = one_of("torchrl_on_policy")
    loss: str = word()  # a class of torchrl.objectives, or <module>.<class> of trainers.algorithms
    options: dict[str, Any] = checked_by("the loss")  # keyword arguments of the loss


@register("torchrl_off_policy", builds="torchrl_losses.TorchRLOffPolicy")
@dataclass(frozen=True, kw_only=True)
class TorchRLOffPolicyConfig(OffPolicyConfig):
    """An off-policy loss of TorchRL: TD3Loss, SACLoss, CrossQLoss, TQCLoss, REDQLoss, DDPGLoss, ..."""

    adapter: str = one_of("torchrl_off_policy")
    loss: str = word()  # a class of torchrl.objectives, or <module>.<class> of trainers.algorithms
    options: dict[str, Any] = checked_by("the loss")  # keyword arguments of the loss
    deterministic: bool  # the actor writes the move itself, and exploration noise of policy.initial_std is added
    final_std: float | None = within(0.01, 2.0)  # deterministic: exploration noise at the end, after a linear decline
    critics: int = within(1, 100)
    quantiles: int = within(1, 1000)  # outputs of each critic; 1 = the expected return
    critic_normalisation: str = one_of("none", "layer", "batch_renorm")
    target: str = one_of("none", "soft", "hard")  # how the target networks follow
    tau: float = within(1e-5, 1.0)  # soft: part of the way at each step
    target_interval: int = within(1, 1_000_000)  # hard: gradient steps between two copies
    actor_every: int = within(1, 1_000_000)  # gradient steps of the critics for each one of actor and temperature
    adam_beta1: float = within(0.0, 0.999)

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
