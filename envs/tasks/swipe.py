"""Swipe: drag an object over the table along a straight line."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from envs.tasks.geometry import distance_to_segment, length, paths_are_clear, with_object_at
from envs.tasks.manipulation import Manipulation
from envs.tasks.registry import register_task
from envs.tasks.types import NOTHING, Array, State
from language import Placed, Scene

LINE = 0.04  # metres that the object may deviate from the line
LIFT = 0.015  # metres that it may rise above the table


@register_task("swipe", verb="swipe")
class Swipe(Manipulation):
    """ "swipe the red cube along the line to the transparent blue cube".

    Success: the referent has been gripped, lies within `radius` of its target, released and at rest, for `hold_steps`
    steps. It fails where the referent leaves the straight line from where it stood to its target by more than `LINE`,
    or the table by more than `LIFT`.
    Potentials: approach (metres from gripper to object, negative; 0 while it is held or there), grasp (1 while it is
    held or there), transport (metres from object to target, negative) and release (1 while it is there: near its
    target, released, and gripped before).
    """

    grips = True
    fails = True
    potentials = ("approach", "grasp", "transport", "release")

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._gripped = np.zeros(worlds, bool)
        self._aside = np.zeros(worlds)  # metres from the line

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        self._gripped[worlds] = (state.held == state.referent)[worlds]
        self._aside[worlds] = 0.0

    @property
    def memory(self) -> NDArray[np.float64]:
        """(N, 2) whether the referent has been gripped, and the share of `LINE` that it is beside the line."""
        return np.stack((self._gripped, np.minimum(self._aside / LINE, 1.0)), axis=1)

    def _is_feasible(self, placed: Placed) -> bool:
        return paths_are_clear(placed)

    def _update_memory(self, state: State) -> None:
        self._gripped |= state.held == state.referent
        start, place = self._begun[self._rows, state.referent], self._referent(state)
        self._aside = distance_to_segment(place[:, :2], start[:, :2], self._goal(state)[:, :2])

    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        return self._there(state) & (self._still >= 1)

    def _there(self, state: State) -> NDArray[np.bool_]:
        near = length(self._goal(state) - self._referent(state)) <= self.config.success_radius
        return self._gripped & near & (state.held == NOTHING)

    def _failed(self, state: State) -> NDArray[np.bool_]:
        start, place = self._begun[self._rows, state.referent], self._referent(state)
        return (self._aside > LINE) | (place[:, 2] > start[:, 2] + LIFT)

    def _potentials(self, state: State) -> dict[str, Array]:
        place = self._referent(state)
        there = self._there(state)
        has = (state.held == state.referent) | there
        return {
            "approach": np.where(has, 0.0, -length(place - state.gripper)),
            "grasp": has.astype(np.float64),
            "transport": -length(self._goal(state) - place),
            "release": there.astype(np.float64),
        }

    def _held_scene(self, scene: Scene, referent: int, target: int | None, rng: Generator) -> Scene | None:
        """On the table, part of the way to its target."""
        assert target is not None
        way = scene.positions[target] - scene.positions[referent]
        return with_object_at(scene, referent, scene.positions[referent] + 0.9 * rng.random() * way)
