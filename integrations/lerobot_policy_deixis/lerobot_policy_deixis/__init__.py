"""Policies of Deixis in the programs of LeRobot, which find this package by its name.

lerobot-eval --policy.type=deixis --policy.checkpoint=nl_reach_kuka --env.type=deixis --env.objects=true ...
"""

from lerobot_policy_deixis.configuration_deixis import DeixisConfig

__all__ = ["DeixisConfig"]
