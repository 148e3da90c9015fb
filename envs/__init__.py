"""Robots, controls, workspaces and tasks; the batched TorchRL environment and its Gymnasium face."""

import gymnasium

from envs.config import EnvConfig, make_env, read_env

__all__ = ["EnvConfig", "make_env", "read_env"]

for _id, _task in (("Deixis/Reach-v0", "reach"), ("Deixis/NLReach-v0", "nl_reach")):
    gymnasium.register(_id, entry_point="envs.gym_env:GymEnv", kwargs={"task": _task})
