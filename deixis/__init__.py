"""Deixis: robot arms that do what a sentence and a pointing finger ask, trained by reinforcement learning.

This module offers the public functions of the project; each is imported on first use.

| name | what it is |
|---|---|
| `make_env` | `envs.make_env`: the TorchRL environment of some Hydra overrides |
| `load_policy` | `deixis.policy.load_policy`: a trained policy with the settings of its environment |
| `evaluate` | `deixis.benchmark.evaluate`: a policy of any origin by a fixed protocol |
| `parse` | `language.parse`: a sentence as a `Command`, or an error with a position |
| `describe` | `language.describe`: an instruction that singles out an object of a scene |
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from deixis.origins import check_origins

if TYPE_CHECKING:
    from deixis.benchmark import evaluate
    from deixis.policy import LoadedPolicy, load_policy
    from envs import make_env
    from language import describe, parse

__version__ = "0.2.0"
__all__ = ["LoadedPolicy", "__version__", "describe", "evaluate", "load_policy", "make_env", "parse"]

MODULES = {
    "LoadedPolicy": "deixis.policy",
    "describe": "language",
    "evaluate": "deixis.benchmark",
    "load_policy": "deixis.policy",
    "make_env": "envs",
    "parse": "language",
}

check_origins("conf", "core", "language", "human", "envs", "trainers")


def __getattr__(name: str) -> Any:
    if name not in MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(MODULES[name]), name)


def __dir__() -> list[str]:
    return __all__
