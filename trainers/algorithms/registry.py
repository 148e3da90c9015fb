"""Algorithms by name: each `*_config` module of this package registers settings of an algorithm. Imports no torch."""

from __future__ import annotations

import pkgutil
from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import Any, TypeVar

import trainers.algorithms as package
from conf.schema import ConfigError, did_you_mean, read
from trainers.algorithms.base_config import AlgorithmConfig

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
