"""Robots, controls, workspaces and tasks: the batched TorchRL environment and its Gymnasium interface."""

from envs.config import EnvConfig, read_env
from envs.registration import make_env, register_gym_ids

__all__ = ["EnvConfig", "make_env", "read_env"]

register_gym_ids()
