"""Unstack: pick and place onto the free place of the table that the task observes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.experts.base import Array, Slots
from envs.experts.registry import register_expert
from envs.experts.stack import StackExpert
from envs.tasks.unstack import Unstack


@register_expert("nl_unstack")
class UnstackExpert(StackExpert):
    """Picks the referent up, and releases it where the table is free."""

    def aim(self, referent: Slots, target: Slots) -> tuple[Array, NDArray[np.bool_]]:
        return super().aim(referent, referent)

    def _goal(self, target: Slots) -> Array:
        assert isinstance(self._task, Unstack)
        return self._task.free_places()[self._rows, target]
