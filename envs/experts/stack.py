"""Stack: pick and place onto the top of another object."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.experts.base import UP, Array, Slots
from envs.experts.place import PlaceExpert
from envs.experts.registry import register_expert

SINK = 0.02  # metres that it goes down in a control step with the object; if faster, joint control leaves the path


@register_expert("nl_stack")
class StackExpert(PlaceExpert):
    """Picks the referent up, and releases it on top of the target."""

    def _goal(self, target: Slots) -> Array:
        return self._place(target) + self._task.config.object_size * UP

    def _carry(self, thing: Array, goal: Array) -> tuple[Array, NDArray[np.bool_]]:
        place, keep = super()._carry(thing, goal)
        place[:, 2] = np.maximum(place[:, 2], self._env.gripper[:, 2] - SINK)
        return place, keep
