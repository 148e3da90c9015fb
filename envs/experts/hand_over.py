"""Hand over: stack onto the palm of a hand, and pass over the hand on the way."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.experts.base import HOVER, Array, Slots
from envs.experts.registry import register_expert
from envs.experts.stack import StackExpert
from envs.tasks.hand_over import HandOver

CLEAR = 0.07  # metres over the palm at which an empty gripper passes


@register_expert("nl_hand_over")
class HandOverExpert(StackExpert):
    """Picks the referent up, and releases it on the palm. least_hover: metres above objects at which it travels."""

    least_hover = HOVER

    def aim(self, referent: Slots, target: Slots) -> tuple[Array, NDArray[np.bool_]]:
        over = self._place(target)[:, 2] + CLEAR - self._place(referent)[:, 2]
        self.hover = np.maximum(self.least_hover, over)
        return super().aim(referent, target)

    def _goal(self, target: Slots) -> Array:
        assert isinstance(self._task, HandOver)
        return self._task.on_palm(self._place(target))
