"""Press: push a button down, and keep it down."""

from __future__ import annotations

from envs.tasks.operate import Operate
from envs.tasks.registry import register_task
from envs.tasks.types import Array, State


@register_task("press", verb="press")
class PressButton(Operate):
    """ "press the red button"."""

    noun = "button"

    def _measure(self, state: State) -> Array:
        return -state.objects[..., 2]

    def _from(self, state: State, place: Array) -> Array:
        return place
