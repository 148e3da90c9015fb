"""Swipe: grip the referent, drag it straight to its target, and release it."""

from __future__ import annotations

import numpy as np
from torch import Tensor

from envs.experts.base import HOVER, UP, Slots, choose_rows
from envs.experts.place import GRASP, THERE, Fetch
from envs.experts.registry import register_expert
from envs.tasks.geometry import length

STEP = 0.02  # metres in a control step: slower than it could, so that it keeps to the line


@register_expert("swipe")
class SwipeExpert(Fetch):
    """Keeps the dragged object on the table."""

    def act(self, referent: Slots, target: Slots) -> Tensor:
        thing, goal = self._place(referent), self._place(target)
        held = self._env.state.held == referent
        left = length((goal - thing)[:, :2])
        there = ~held & (left < THERE)
        fetch, close = self._fetch(thing)
        onward = self._env.gripper + (goal - thing) * np.minimum(1.0, STEP / np.maximum(left, 1e-9))[:, None]
        onward[:, 2] = self._env.gripper[:, 2] + (goal - thing)[:, 2]  # a gripper that closed too low must not lift
        place = choose_rows(there, self._env.gripper + HOVER * UP, choose_rows(held, onward, fetch))
        return self._env.towards(place, np.where(held, left > GRASP, close) & ~there)
