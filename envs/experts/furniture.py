"""Experts of the fittings: open and close them by their handles, and move objects into and out of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.experts.base import HOVER, UP, AimingExpert, Array, Slots, choose_rows, register_expert
from envs.experts.pick_and_place import GRASP, PRESS, StackExpert
from envs.sim.workspace import HANDLE, Fitting
from envs.tasks import Task
from envs.tasks.pick_and_place import PickAndPlace
from envs.tasks.shared.geometry import length
from envs.workspace_env import WorkspaceEnv

OVER, STILL_OVER = 0.008, 0.016  # metres beside a handle that count as over it, at first and on the way down
SLOWLY = 0.015  # metres that a gripper goes down in a control step: faster, a panda leaves the vertical
SAG = 0.03  # metres below the height of travel at which a gripper still goes sideways
MAGNET_STEP, FINGER_STEP = 0.016, 0.008  # metres that they move a handle in a control step: fingers slip when faster
END = {"nl_open": 0.97, "nl_close": 0.0}  # shares to which it is moved
ENOUGH = 0.03  # share from there at which it is left
BESIDE = 0.04  # metres beside the area of the loose objects from which a gripper is at a fitting
TRAVEL = 0.14  # metres above the table at which an object passes over all walls
BELOW = 0.015  # metres below its travelling height at which an object at a fitting moves only up
STRAIGHT = 0.015  # metres beside its aim along x at which a gripper may go to a fitting


# ---- open and close


class FittingExpert(AimingExpert):
    """Holds the handle of a fitting, and moves it along its path."""

    def __init__(self, env: WorkspaceEnv, task: Task | None = None) -> None:
        super().__init__(env, task)
        assert self._task.fittings is not None
        self._fittings, magnet = self._task.fittings, env.grip_depth > 0
        self._step = MAGNET_STEP if magnet else FINGER_STEP
        self._tops = {
            noun: fitting.parts[HANDLE].size[2] / 2 * magnet for noun, fitting in self._fittings.by_noun.items()
        }

    def _move_to(self, slots: Slots, end: float) -> tuple[Array, NDArray[np.bool_]]:
        """Return where grippers go (N, 3), and whether they close (N,), to move fittings in slots (N,) to the share."""
        env, held = self._env, self._env.state.held == slots
        handle, top, onward = self._place(slots), *self._path(slots, end)
        grip = handle + top[:, None] * UP
        fetch, close = self._take(grip)
        pull = env.gripper + onward - handle
        pull[:, 1] = handle[:, 1]  # fingers close along y, and no handle moves along y
        place = choose_rows(held, pull, fetch)
        return place, held | close

    def _take(self, grip: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return the way to `grip` (N, 3): up, over the handle and down on it; and whether the gripper closes (N,)."""
        gripper = self._env.gripper
        travel, up, down = grip + HOVER * UP, gripper.copy(), grip - PRESS * (self._env.grip_depth > 0) * UP
        up[:, 2] = travel[:, 2]
        down[:, 2] = np.maximum(down[:, 2], gripper[:, 2] - SLOWLY)
        high = gripper[:, 2] > travel[:, 2] - SAG
        over = length((grip - gripper)[:, :2]) < np.where(high, OVER, STILL_OVER)
        close = over & (np.abs((grip - gripper)[:, 2]) < GRASP)
        return choose_rows(over, down, choose_rows(high, travel, up)), close

    def _path(self, slots: Slots, end: float) -> tuple[NDArray[np.float64], Array]:
        """(N,) metres from the centre of each handle up to where it is held, and (N, 3) where the handle goes next."""
        state = self._env.state
        nouns, place = state.nouns[self._rows, slots], self._place(slots)
        tops, onward = np.zeros(len(nouns)), place.copy()
        for noun, fitting in self._fittings.by_noun.items():
            which = nouns == noun
            share = fitting.share(place[which])
            step = self._step / (radius(fitting) * (fitting.high - fitting.low))
            onward[which] = fitting.handle_at(fitting.value(share + np.clip(end - share, -step, step)))
            tops[which] = self._tops[noun]
        return tops, onward


@register_expert("nl_open", "nl_close")
class OpenCloseExpert(FittingExpert):
    """Moves the referent to its end, and stays there."""

    def aim(self, referent: Slots, target: Slots) -> tuple[Array, NDArray[np.bool_]]:
        end = END[self._task.config.name]
        place, close = self._move_to(referent, end)
        share = self._fittings.shares(self._env.state.nouns[self._rows, referent], self._place(referent))
        done = np.abs(share - end) < ENOUGH
        return choose_rows(done, self._env.gripper, place), close


def radius(fitting: Fitting) -> float:
    """Metres that the handle moves for each unit of the joint value: metres, or radians."""
    if fitting.joint == "slide":
        return 1.0
    arm = np.subtract(fitting.parts[HANDLE].position, fitting.origin)
    return float(np.linalg.norm(np.cross(fitting.axis, arm)))


# ---- put in and take out


@register_expert("nl_put_in", "nl_take_out")
class InOutExpert(StackExpert):
    """Moves only along y between the table and a fitting."""

    def __init__(self, env: WorkspaceEnv, task: Task | None = None) -> None:
        super().__init__(env, task)
        self._beside = fittings_from(env)

    def _goal(self, target: Slots) -> Array:
        assert isinstance(self._task, PickAndPlace)
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
        """Return the places (N, 3), or waypoints to them: first along x, then along y."""
        gripper, way = self._env.gripper, place.copy()
        at, aim = np.abs(gripper[:, 1]) > self._beside, np.abs(place[:, 1]) > self._beside
        away, aside = at & ~aim, aim & ~at & (np.abs(place[:, 0] - gripper[:, 0]) > STRAIGHT)
        way[away, 0] = gripper[away, 0]
        way[aside, 1] = gripper[aside, 1]
        return way


def fittings_from(env: WorkspaceEnv) -> float:
    """Metres from the middle of the table, to either side, from which a gripper is at a fitting."""
    return max(abs(edge) for edge in env.config.workspace.object_area[2:]) + BESIDE
