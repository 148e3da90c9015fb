"""Press: push a button down, and keep it down."""

from __future__ import annotations

from envs.tasks.operate import OperateAlone
from envs.tasks.operate_among import OperateAmong
from envs.tasks.registry import register_task


@register_task("press", verb="press")
class PressButton(OperateAlone):
    """ "press the red button"."""

    noun = "button"


@register_task("nl_press", verb="press")
class PressButtonAmong(OperateAmong):
    """ "press the red button", among other objects."""

    noun = "button"
