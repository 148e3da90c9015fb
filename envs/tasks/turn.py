"""Turn: push a wheel round by the peg on it, either way."""

from __future__ import annotations

from envs.tasks.operate import OperateAlone
from envs.tasks.operate_among import OperateAmong
from envs.tasks.registry import register_task


@register_task("turn", verb="turn")
class TurnWheel(OperateAlone):
    """ "turn the green wheel". It stays where it is left."""

    noun = "wheel"


@register_task("nl_turn", verb="turn")
class TurnWheelAmong(OperateAmong):
    """ "turn the green wheel", among other objects."""

    noun = "wheel"
