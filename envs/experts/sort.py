"""Sort: pick and place onto a free spot at the marked place."""

from __future__ import annotations

from envs.experts.base import Array, Slots
from envs.experts.registry import register_expert
from envs.experts.stack import StackExpert
from envs.tasks.sort import Sort


@register_expert("nl_sort")
class SortExpert(StackExpert):
    """Picks the referent up, and releases it at its spot."""

    height = 0.11  # higher than elsewhere: it sets out sideways halfway up, and there are up to four other objects

    def _goal(self, target: Slots) -> Array:
        assert isinstance(self._task, Sort)
        return self._task.goal_places(self._env.state)
