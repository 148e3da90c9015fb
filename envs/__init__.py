"""Robots, controls, workspaces and tasks; the batched TorchRL environment and its Gymnasium face."""

from envs.config import EnvConfig, compose, make_env, read_env

__all__ = ["EnvConfig", "compose", "make_env", "read_env"]
