"""Stack: pick and place onto the top of another object."""

from __future__ import annotations

from envs.experts.base import UP, Array, Slots
from envs.experts.place import PlaceExpert
from envs.experts.registry import register_expert


@register_expert("nl_stack")
class StackExpert(PlaceExpert):
    """Picks the referent up, and releases it on top of the target."""

    def _goal(self, target: Slots) -> Array:
        return self._place(target) + self._env.config.task.object_size * UP
