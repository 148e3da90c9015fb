"""Robots, controls, workspaces and tasks: the batched TorchRL environment and its Gymnasium interface."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from core.plugins import load_plugins
from envs.config import EnvConfig, read_env
from envs.registration import make_env, register_gym_ids

if TYPE_CHECKING:
    from envs.checker import check_env

__all__ = ["EnvConfig", "check_env", "make_env", "read_env"]


def __getattr__(name: str) -> Any:
    if name == "check_env":  # torch is imported only where it is used
        from envs.checker import check_env

        return check_env
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


load_plugins()
register_gym_ids()
