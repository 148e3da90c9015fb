"""Reach: bring the gripper to an object, and hold it there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.tasks.base import Task
from envs.tasks.outcome import Outcome
from envs.tasks.registry import register_task
from envs.tasks.types import Array, State, TaskConfig

NEAR = 0.7  # of the radius: greatest height over an object's centre, so that there is room to its sides


def reaching_height(config: TaskConfig, clearance: float) -> float:
    """Metres over an object's centre at which a gripper is to reach it: `clearance` over its top, within the radius."""
    return min(config.object_size / 2 + clearance, NEAR * config.radius)


@register_task("reach", verb="reach")
class Reach(Task):
    """One object, no words.

    Success: the referent is the object nearest to the gripper, within `radius`, for `hold_steps` consecutive steps.
    The same time at another object ends the episode as `wrong_object`, so trying all objects in turn does not pay.
    The environment keeps the gripper above the `reaching_height` of objects on the table, so that it pushes none.
    Terms: progress (metres nearer to the referent than a step ago), success, wrong_object and time (1 each step).
    """

    terms = ("progress", "success", "wrong_object", "time")

    def _allocate(self, worlds: int) -> None:
        self._distance = np.zeros(worlds)
        self._held = np.zeros(worlds, np.int64)
        self._held_other = np.zeros(worlds, np.int64)

    def reset(self, worlds: NDArray[np.int64], state: State) -> None:
        """Begins new episodes in these worlds, or continues with another referent."""
        self._distance[worlds] = self._distances(state)[worlds, state.referent[worlds]]
        self._held[worlds] = 0
        self._held_other[worlds] = 0

    def step(self, state: State) -> Outcome:
        """Evaluates one control step of all worlds."""
        distances = self._distances(state)
        nearest = distances.argmin(1)
        near = distances[self._rows, nearest] <= self.config.success_radius
        at_goal = near & (nearest == state.referent)
        self._held = np.where(at_goal, self._held + 1, 0)
        self._held_other = np.where(near & ~at_goal, self._held_other + 1, 0)
        success = self._held >= self.config.success_steps
        wrong_object = self._held_other >= self.config.success_steps
        distance = distances[self._rows, state.referent]
        progress, self._distance = self._distance - distance, distance
        terms = {
            "progress": progress,
            "success": success.astype(np.float64),
            "wrong_object": wrong_object.astype(np.float64),
            "time": np.ones_like(progress),
        }
        return Outcome(terms, success, wrong_object, at_goal)

    def _distances(self, state: State) -> Array:
        """(N, K) metres from the gripper; infinite where no object is shown."""
        offset = state.objects - state.gripper[:, None]
        return np.where(state.shown, np.sqrt((offset * offset).sum(-1)), np.inf)
