"""TorchRL's loss modules by name, built from plain values."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from importlib import import_module
from typing import Any

from torchrl import objectives
from torchrl.objectives import LossModule

from conf.schema import ConfigError, did_you_mean

OWN = "trainers.algorithms"  # where "<module>.<class>" is looked for


def find_loss(name: str) -> type[LossModule]:
    """The loss class of torchrl.objectives, or <module>.<class> of trainers.algorithms. Raises ConfigError."""
    module, _, cls = name.rpartition(".")
    try:
        found = getattr(import_module(f"{OWN}.{module}") if module else objectives, cls, None)
    except ModuleNotFoundError:
        found = None
    if not (inspect.isclass(found) and issubclass(found, LossModule)):
        known = [each for each in objectives.__all__ if each.endswith("Loss")]
        raise ConfigError(f"algo.loss={name} is not known" + did_you_mean(name, known))
    return found


def takes(cls: type[LossModule], parameter: str) -> bool:
    """Whether the class has a parameter of this name."""
    return parameter in inspect.signature(cls.__init__).parameters


def build_loss(cls: type[LossModule], options: Mapping[str, Any], given: Mapping[str, Any]) -> LossModule:
    """An instance of a loss.

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
        return cls(**{name: value for name, value in given.items() if takes(cls, name)} | dict(options))
    except (TypeError, ValueError) as error:
        raise ConfigError(f"algo.options={dict(options)} was refused by {cls.__name__}: {error}") from None
