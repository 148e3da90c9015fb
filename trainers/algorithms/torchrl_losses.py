"""Two adapters, on-policy and off-policy, which train with any loss module of TorchRL or of this package."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModule
from torch import Tensor
from torchrl import objectives
from torchrl.data import Bounded
from torchrl.objectives import HardUpdate, LossModule, SoftUpdate
from torchrl.objectives.utils import TargetNetUpdater

from core.errors import ConfigError, did_you_mean
from core.plugins import plugin_packages
from core.schema import shown
from trainers.algorithms.algorithm import GROUNDING_METRICS, ExplorationSchedule
from trainers.algorithms.off_policy import OffPolicyAlgorithm
from trainers.algorithms.on_policy import OnPolicyAlgorithm
from trainers.algorithms.settings import PACKAGE, TorchRLOffPolicyConfig, TorchRLOnPolicyConfig, import_class
from trainers.environment import Relabel
from trainers.models.critics import CriticBuilder
from trainers.models.policy import Policy, deterministic_actor, parameters, stochastic_actor

# Outputs of TorchRL's losses, and the names that they are reported under.
OFF_POLICY_OUTPUTS = {
    "loss_actor": "loss/actor",
    "loss_qvalue": "loss/critic",
    "loss_value": "loss/value",
    "loss_alpha": "loss/alpha",
    "loss_cql": "loss/cql",
    "entropy": "entropy",
    "alpha": "alpha",
    "pred_value": "q",
}
ACTOR_LOSSES = ("loss/actor", "loss/alpha")
# Outputs of TorchRL's losses, and the names that they are reported under.
ON_POLICY_OUTPUTS = {
    "loss_objective": "loss/actor",
    "loss_critic": "loss/critic",
    "loss_entropy": "loss/entropy",
    "entropy": "entropy",
    "kl_approx": "kl",
    "clip_fraction": "clip_fraction",
}


class TorchRLOnPolicy(OnPolicyAlgorithm):
    """critic: writes state_value; it may read privileged/goal."""

    def __init__(self, config: TorchRLOnPolicyConfig, policy: Policy, critic: TensorDictModule) -> None:
        # functional=False: its networks are not shared, so no parameters need to be swapped in.
        given = {"actor_network": stochastic_actor(policy), "critic_network": critic, "functional": False}
        self.loss = build_loss(find_loss(config.loss), config.options, given)
        super().__init__(config, policy, critic, list(outputs_of(self.loss, ON_POLICY_OUTPUTS).values()))

    def compute_losses(self, frames: TensorDictBase) -> dict[str, Tensor]:
        return loss_outputs(self.loss, frames)

    @classmethod
    def build(
        cls, config: TorchRLOnPolicyConfig, policy: Policy, critics: CriticBuilder, relabel: Relabel | None
    ) -> TorchRLOnPolicy:
        return cls(config, policy, critics.build_value())


def outputs_of(loss: LossModule, names: Mapping[str, str]) -> dict[str, str]:
    """Return the outputs of a loss that are measured, each with the name that it is reported under.

    names: of outputs of TorchRL's losses. Any other `loss_x` of a loss of one's own is reported as loss/x.
    """
    known = {key: name for key, name in names.items() if key in loss.out_keys}
    own = [key for key in loss.out_keys if key.startswith("loss_") and key not in known]
    return known | {key: key.replace("_", "/", 1) for key in own}


def loss_outputs(loss: LossModule, frames: TensorDictBase) -> dict[str, Tensor]:
    """Return the outputs of an on-policy loss on frames (B,), under our names. Raises ConfigError as `fits`."""
    with fits(type(loss)):
        out = loss(frames)
    return {name: out[key] for key, name in outputs_of(loss, ON_POLICY_OUTPUTS).items()}


@contextmanager
def fits(cls: type[LossModule]) -> Iterator[None]:
    """Make an error of a loss in this context a ConfigError: it suits neither our networks nor our frames."""
    try:
        yield
    except torch.OutOfMemoryError:
        raise
    except (AttributeError, IndexError, KeyError, NotImplementedError, RuntimeError, TypeError, ValueError) as error:
        if isinstance(error, ConfigError):
            raise
        raise ConfigError(
            f"algo.loss: {cls.__name__} fits neither the actor and the critics of this adapter nor the frames that it "
            f"is given ({type(error).__name__}: {shown(error)}); docs/extending.md lists the losses that do"
        ) from error


class TorchRLOffPolicy(OffPolicyAlgorithm):
    """The loss module holds the critics, their targets and the temperature; the actor's parameters are the policy's."""

    saved = ("policy", "loss", "optimizer")

    def __init__(
        self, config: TorchRLOffPolicyConfig, policy: Policy, critics: CriticBuilder, relabel: Relabel | None
    ) -> None:
        super().__init__(config, policy, critics.keys, relabel)
        self.config: TorchRLOffPolicyConfig = config
        self.loss = build_off_policy_loss(config, policy, critics)
        self.outputs = outputs_of(self.loss, OFF_POLICY_OUTPUTS)
        self.metrics = (*self.outputs.values(), "std", "updates", "relabelled", *GROUNDING_METRICS)
        self.updater = build_target_updater(config, self.loss)
        self.exploration = ExplorationSchedule(policy, config.final_std) if config.final_std else None
        learned = parameters(policy, self.loss)
        self.optimizer = self.make_optimizer(learned, betas=(config.adam_beta1, 0.999))

    @classmethod
    def build(
        cls, config: TorchRLOffPolicyConfig, policy: Policy, critics: CriticBuilder, relabel: Relabel | None
    ) -> TorchRLOffPolicy:
        return cls(config, policy, critics, relabel)

    def update(self, batch: TensorDictBase, progress: float) -> dict[str, float]:
        if self.exploration is not None:
            self.exploration.step(progress)
        return super().update(batch, progress)

    def compute_losses(self, frames: TensorDictBase) -> dict[str, Tensor]:
        """Return the outputs of the loss module. The actor's losses are included in one of `actor_every` steps only."""
        frames["next", "done"] = frames["next", "terminated"]  # a truncated frame bootstraps
        with fits(type(self.loss)):
            out = self.loss(frames)
        measured = {name: out[key].mean() for key, name in self.outputs.items()}
        measured["std"] = self.policy.actor.log_std.exp().mean()
        if not self.variant:
            measured = {name: value for name, value in measured.items() if name not in ACTOR_LOSSES}
        return measured

    @property
    def variant(self) -> bool:
        """Whether the next gradient step trains the actor."""
        return self.steps_taken % self.config.actor_every == 0

    def after_step(self, frames: TensorDictBase) -> None:
        if self.updater is not None:
            self.updater.step()

    def running_state(self) -> dict[str, Any]:
        counter = self.updater.counter if isinstance(self.updater, HardUpdate) else 0
        return super().running_state() | {"steps_since_copy": counter}

    def load_running_state(self, state: dict[str, Any]) -> None:
        super().load_running_state(state)
        if isinstance(self.updater, HardUpdate):
            self.updater.counter = state["steps_since_copy"]

    def state_dict(self) -> dict[str, Any]:
        return super().state_dict() | {"steps_taken": self.steps_taken}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        super().load_state_dict(state)
        self.steps_taken = state["steps_taken"]


def build_off_policy_loss(config: TorchRLOffPolicyConfig, policy: Policy, builder: CriticBuilder) -> LossModule:
    """Return the loss module of a config, with critics of its own. Raises ConfigError."""
    cls = find_loss(config.loss)
    make_actor = deterministic_actor if config.deterministic else stochastic_actor
    critics = builder.build_q_modules(config.critics, config.quantiles, config.critic_normalisation)
    given = {
        "actor_network": make_actor(policy, builder.keys),
        "qvalue_network": critics,
        "num_qvalue_nets": config.critics,
        "value_network": critics[0],
        "action_spec": Bounded(-1.0, 1.0, (len(policy.action_unit),), device=builder.device),
        "deactivate_vmap": True,  # a loop over few small critics is faster on a CPU
    }
    if takes(cls, "qvalue_network"):
        del given["value_network"]
    loss = build_loss(cls, config.options, given)
    with fits(cls):
        if hasattr(loss.tensor_keys, "action"):  # DDPGLoss takes the key from its networks
            loss.set_keys(action="move")
        getattr(loss, "target_entropy", None)  # REDQLoss registers this buffer at its first use: a checkpoint has it
        loss.make_value_estimator(loss.default_value_estimator, gamma=config.gamma)
        return loss.to(builder.device)


def build_target_updater(config: TorchRLOffPolicyConfig, loss: LossModule) -> TargetNetUpdater | None:
    """Return the updater of the target networks, used after each gradient step; None: the loss has no targets."""
    with fits(type(loss)):
        if config.target == "soft":
            return SoftUpdate(loss, tau=config.tau)
        if config.target == "hard":
            return HardUpdate(loss, value_network_update_interval=config.target_interval)
    return None


def find_loss(name: str) -> type[LossModule]:
    """Return the loss class of torchrl.objectives, or <module>.<class> of trainers.algorithms or an installed plugin.

    Raises ConfigError. A config may come from a file, so that no other module is imported.
    """
    module = name.rpartition(".")[0]
    first = module.partition(".")[0]
    try:
        known = first in plugin_packages() or find_spec(f"{PACKAGE}.{first}") is not None
        found = getattr(objectives, name, None) if not module else import_class(name) if known else None
    except ImportError:
        found = None
    if not (inspect.isclass(found) and issubclass(found, LossModule)):
        losses = [each for each in objectives.__all__ if each.endswith("Loss")]
        raise ConfigError(f"algo.loss={name} is not known" + did_you_mean(name, losses))
    return found


def takes(cls: type[LossModule], parameter: str) -> bool:
    """Return whether the class has a parameter of this name."""
    return parameter in inspect.signature(cls.__init__).parameters


def build_loss(cls: type[LossModule], options: Mapping[str, Any], given: Mapping[str, Any]) -> LossModule:
    """Return an instance of a loss.

    Args:
        cls: the class.
        options: keyword arguments of the config; they win over `given`.
        given: values that the adapter can supply, by parameter names; those that the class does not take are left out.

    Raises:
        ConfigError: an option that the class does not take, or one that it refuses.
    """
    for name in options:
        if not takes(cls, name):
            known = [each for each in inspect.signature(cls.__init__).parameters if each != "self"]
            raise ConfigError(f"algo.options.{name} is not a parameter of {cls.__name__}" + did_you_mean(name, known))
    try:
        with fits(cls):
            return cls(**{name: value for name, value in given.items() if takes(cls, name)} | dict(options))
    except ConfigError as failure:
        error = failure.__cause__
        if not isinstance(error, TypeError | ValueError):
            raise
        raise ConfigError(f"algo.options={dict(options)} was refused by {cls.__name__}: {error}") from None
