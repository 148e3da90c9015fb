"""Switch: push a lever over, from its one end to the other."""

from __future__ import annotations

from envs.tasks.operate import OperateAlone
from envs.tasks.operate_among import OperateAmong
from envs.tasks.registry import register_task


@register_task("switch", verb="switch")
class SwitchLever(OperateAlone):
    """ "switch the blue lever". It stays where it is left."""

    noun = "lever"


@register_task("nl_switch", verb="switch")
class SwitchLeverAmong(OperateAmong):
    """ "switch the blue lever", among other objects."""

    noun = "lever"
