"""The tasks of Deixis as environments of LeRobot, whose programs find this package by its name.

lerobot-eval --env.type=deixis --env.task=nl_reach --env.robot=panda --policy.path=<dir> ...
"""

from gymnasium import register

from lerobot_env_deixis.configuration_deixis import GYM_ID, DeixisEnvConfig
from lerobot_env_deixis.sim_env import DeixisSimEnv

register(GYM_ID, entry_point="lerobot_env_deixis.sim_env:DeixisSimEnv")

__all__ = ["DeixisEnvConfig", "DeixisSimEnv"]
