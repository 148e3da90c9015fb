"""Unstack: pick and place onto the free place of the table that the task observes."""

from __future__ import annotations

from torch import Tensor

from envs.experts.base import Array, Slots
from envs.experts.place import OPENING
from envs.experts.registry import register_expert
from envs.experts.stack import StackExpert
from envs.tasks.unstack import Unstack


@register_expert("nl_unstack")
class UnstackExpert(StackExpert):
    """Picks the referent up, and releases it where the table is free."""

    wait = OPENING

    def act(self, referent: Slots, target: Slots) -> Tensor:
        return super().act(referent, referent)

    def _goal(self, target: Slots) -> Array:
        task = self._env.task
        assert isinstance(task, Unstack)
        return task.free_places()[self._rows, target]
