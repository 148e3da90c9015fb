"""Robots, controls, workspaces and tasks; the batched TorchRL environment and its Gymnasium face."""

import gymnasium

from envs.config import EnvConfig, make_env, read_env

__all__ = ["EnvConfig", "make_env", "read_env"]

for _id, _task in (
    ("Reach", "reach"),
    ("NLReach", "nl_reach"),
    ("ReachGesture", "reach_gesture"),
    ("NLReachGesture", "nl_reach_gesture"),
):
    gymnasium.register(f"Deixis/{_id}-v0", entry_point="envs.gym_env:GymEnv", kwargs={"task": _task})
