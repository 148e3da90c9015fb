"""Put in and take out: pick and place, along the fridge's open lid and not through it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.experts.base import Array, Slots
from envs.experts.registry import register_expert
from envs.experts.stack import StackExpert
from envs.tasks import Task
from envs.tasks.in_out import InOut
from envs.workspace_env import WorkspaceEnv

BESIDE = 0.04  # metres beside the area of the loose objects from which a gripper is at a fitting
TRAVEL = 0.14  # metres above the table at which an object passes over all walls
BELOW = 0.015  # metres below its travelling height at which an object at a fitting moves only up
STRAIGHT = 0.015  # metres beside its aim along x at which a gripper may go to a fitting


def fittings_from(env: WorkspaceEnv) -> float:
    """Metres from the middle of the table, to either side, from which a gripper is at a fitting."""
    return max(abs(edge) for edge in env.config.workspace.object_area[2:]) + BESIDE


@register_expert("nl_put_in", "nl_take_out")
class InOutExpert(StackExpert):
    """Moves only along y between the table and a fitting."""

    def __init__(self, env: WorkspaceEnv, task: Task | None = None) -> None:
        super().__init__(env, task)
        self._beside = fittings_from(env)

    def _goal(self, target: Slots) -> Array:
        assert isinstance(self._task, InOut)
        return self._task.goal_places(self._env.state)

    def _fetch(self, thing: Array) -> tuple[Array, NDArray[np.bool_]]:
        place, close = super()._fetch(thing)
        return self._straight(place), close

    def _carry(self, thing: Array, goal: Array) -> tuple[Array, NDArray[np.bool_]]:
        place, keep = super()._carry(thing, goal)
        gripper, way = self._env.gripper, self._straight(place)
        walled = (thing[:, 2] < self._height(thing, goal) - BELOW) & (np.abs(gripper[:, 1]) > self._beside)
        way[walled, :2] = gripper[walled, :2]
        return way, keep

    def _travel(self, goal: Array) -> NDArray[np.float64]:
        return TRAVEL - goal[:, 2]

    def _straight(self, place: Array) -> Array:
        """The places (N, 3), or waypoints to them: first along x, then along y."""
        gripper, way = self._env.gripper, place.copy()
        at, aim = np.abs(gripper[:, 1]) > self._beside, np.abs(place[:, 1]) > self._beside
        away, aside = at & ~aim, aim & ~at & (np.abs(place[:, 0] - gripper[:, 0]) > STRAIGHT)
        way[away, 0] = gripper[away, 0]
        way[aside, 1] = gripper[aside, 1]
        return way
