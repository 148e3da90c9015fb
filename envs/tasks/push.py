"""Push, swipe, poke and throw: tasks of one object that moves over the table, or through the air."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from envs.tasks.shared.base import register_task
from envs.tasks.shared.geometry import (
    distance_to_segment,
    horizontal,
    length,
    paths_are_clear,
    share_at_goal,
    with_object_at,
)
from envs.tasks.shared.manipulation import Manipulation
from envs.tasks.shared.types import NOTHING, Array, Column, State
from language import Placed, Scene

# push
MARGIN = 0.06  # metres from the border of the object area to pushed objects, so that a gripper fits behind them
BEHIND = 0.02  # metres from an object's side to the centre of a gripper that is about to push it
NEAR = 0.05  # greatest further distance, and height over the object's middle, at which a gripper begins, metres
FASTEST = 0.03  # bound of the observed sliding, metres per control step
LOST = 0.02  # metres beyond that border at which no gripper can push an object back
SLACK = 0.04  # further metres that a gripper may be behind: pushed objects slide ahead of it
# Height in metres of the gripper on its way to behind the object, by its horizontal distance: it must pass above.
MOUTH, SLOPE, ABOVE = 0.015, 2.0, 0.08
# swipe
LINE = 0.04  # metres that the object may deviate from the line
LIFT = 0.015  # metres that it may rise above the table
# poke
MOVED = 0.02  # least displacement in metres: more than an arm that brushes past causes
PUSHED = 0.12  # greatest displacement in metres: beyond it, the object has been pushed
AWAY = 0.1  # metres between the centres of gripper and object at success: 5 cm from contact
# throw
SHORT = 0.15  # least horizontal distance in metres from the target at the release
HIGH = 0.03  # least height above the table in metres at the release
LANDED = 0.1  # metres from the target within which the object must come to rest


@register_task("push", "nl_push", verb="push")
class Push(Manipulation):
    """Push an object over the table to its target, without gripping it.

    Instruction: "push the green cube to the same position as the transparent red cube".
    Success: the referent lies within `radius` of its target, at rest, for `hold_steps` steps.
    Failure: wrong_object, once another object has been moved; wrong_target, once it was left at another target; failed,
        once the referent is `LOST`: no gripper can push it back.
    Reward terms: approach (metres that the gripper has to go, up, over and down, to the place behind the object, as
        seen from its target, negative; 0 once the object is there), transport (metres from object to target, negative)
        and rest (the share of `success_steps` that it has lain there); success, wrong_object, wrong_target, failed and
        time.
    Config keys: num_objects, num_targets (at least 1), kinds ([]: one object and one target), radius, hold_steps.
    """

    traits = replace(Manipulation.traits, fails=True)
    columns = (
        Column("slid x (m)", -FASTEST, FASTEST),
        Column("slid y (m)", -FASTEST, FASTEST),
        Column("lies at a target", 0.0, 1.0),
    )
    potentials = ("approach", "transport", "rest")

    def seen(self, state: State) -> Array:
        return np.concatenate((self._moved[..., :2], share_at_goal(state, self.config.radius)[..., None]), axis=2)

    @property
    def memory(self) -> Array:
        """(N, 3) the share of `success_steps` that the referent has lain at its target, and how it slides."""
        sliding = np.clip(0.5 + self._motion[:, :2] / (2 * FASTEST), 0.0, 1.0)
        return np.concatenate((self._lain()[:, None], sliding), axis=1)

    def _is_feasible(self, placed: Placed) -> bool:
        return self._inside_margin(placed) and paths_are_clear(placed)

    def _inside_margin(self, placed: Placed) -> bool:
        x0, x1, y0, y1 = self._area
        inner = np.array([[x0, y0], [x1, y1]]) + [[MARGIN], [-MARGIN]]
        places = placed.scene.positions[~placed.scene.targets, :2]
        return bool(((places >= inner[0]) & (places <= inner[1])).all())

    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        return self._there(state) & (self._still >= 1)

    def _failed(self, state: State) -> NDArray[np.bool_]:
        x0, x1, y0, y1 = self._area
        x, y = self._referent(state)[:, :2].T
        inside = (x > x0 - LOST) & (x < x1 + LOST) & (y > y0 - LOST) & (y < y1 + LOST)
        return ~inside & ~self._there(state)

    def _there(self, state: State) -> NDArray[np.bool_]:
        return length(self._goal(state) - self._referent(state)) <= self.config.success_radius

    def _potentials(self, state: State) -> dict[str, Array]:
        place, goal = self._referent(state), self._goal(state)
        to_go = self._to_go(state.gripper - place, horizontal(goal - place))
        return {
            "approach": np.where(self._there(state), 0.0, -to_go),
            "transport": -length(goal - place),
            "rest": self._lain(),
        }

    def _lain(self) -> Array:
        """(N,) the share of `success_steps` that the referent has lain at its target."""
        return np.minimum(self._reached / self.config.success_steps, 1.0)

    def _to_go(self, offset: Array, way: Array) -> Array:
        """(N,) metres from a gripper at `offset` (N, 3) to a place behind an object that is to move along `way` (N, 3).

        The horizontal distance plus that in height. A gripper that is too low has to go up and down again.
        """
        back = -(offset * way).sum(-1)
        behind = np.clip(back, self._behind(), self._behind() + SLACK)
        aside = length((offset + behind[:, None] * way)[:, :2])
        wanted = np.clip(SLOPE * (aside - MOUTH), 0.0, ABOVE)
        return aside + np.maximum(np.abs(offset[:, 2]), 2 * wanted - offset[:, 2])

    def _behind(self) -> float:
        return self.config.object_size / 2 + BEHIND

    def _near_offset(self, scene: Scene, referent: int, target: int | None, rng: Generator) -> Array:
        """Return an offset low behind the object."""
        assert target is not None
        way = horizontal(scene.positions[target] - scene.positions[referent])
        back, up = rng.uniform(0.0, NEAR, 2)
        return up * np.array([0.0, 0.0, 1.0]) - (self._behind() + back) * way


@register_task("swipe", verb="swipe")
class Swipe(Manipulation):
    """Grip an object and drag it over the table along the straight line to its target.

    Instruction: "swipe the red cube along the line to the transparent blue cube".
    Success: the referent has been gripped, lies within `radius` of its target, released and at rest, for `hold_steps`
        steps.
    Failure: wrong_object, once another object has been moved; wrong_target, once it was left at another target; failed,
        where the referent leaves the straight line from where it stood to its target by more than `LINE`, or the table
        by more than `LIFT`.
    Reward terms: approach (metres from gripper to object, negative; 0 while it is held or there), grasp (1 while it is
        held or there), transport (metres from object to target, negative) and release (1 while it is there: near its
        target, released, and gripped before); success, wrong_object, wrong_target, failed and time.
    Config keys: num_objects, num_targets (at least 1), kinds, radius, hold_steps.
    """

    traits = replace(Manipulation.traits, grips=True, fails=True)
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


@register_task("poke", verb="poke")
class Poke(Manipulation):
    """Touch an object briefly, so that it moves a little, and move away.

    Instruction: "poke the red cube".
    Success: the referent lies, at rest, between `MOVED` and `PUSHED` from where it stood, and the gripper is `AWAY`
        from it, for `hold_steps` steps.
    Failure: wrong_object, once another object has been moved; failed, where the referent is displaced by more than
        `PUSHED`.
    Reward terms: approach (metres from gripper to object, negative; 0 once it has been moved), touch (the share of
        `MOVED` by which it is displaced) and withdraw (once it has been moved, the share of `AWAY` that the gripper is
        from it); success, wrong_object, wrong_target (always 0), failed and time.
    Config keys: num_objects, kinds, hold_steps.
    """

    traits = replace(Manipulation.traits, fails=True)
    potentials = ("approach", "touch", "withdraw")

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._displaced = np.zeros(worlds)  # metres

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        self._displaced[worlds] = 0.0

    @property
    def memory(self) -> NDArray[np.float64]:
        """(N, 1) the share of `PUSHED` by which the referent is displaced."""
        return np.minimum(self._displaced / PUSHED, 1.0)[:, None]

    def _update_memory(self, state: State) -> None:
        self._displaced = length(self._referent(state) - self._begun[self._rows, state.referent])

    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        place = self._referent(state)
        moved = (self._displaced >= MOVED) & (self._displaced <= PUSHED)
        return moved & (length(place - state.gripper) >= AWAY) & (self._still >= 1)

    def _failed(self, state: State) -> NDArray[np.bool_]:
        return self._displaced > PUSHED

    def _potentials(self, state: State) -> dict[str, Array]:
        apart = length(self._referent(state) - state.gripper)
        moved = self._displaced >= MOVED
        return {
            "approach": np.where(moved, 0.0, -apart),
            "touch": np.minimum(self._displaced / MOVED, 1.0),
            "withdraw": np.where(moved, np.minimum(apart / AWAY, 1.0), 0.0),
        }


@register_task("throw", verb="throw")
class Throw(Manipulation):
    """Throw an object to its target: let go of it in the air, so that it lands there.

    Instruction: "throw the red cube to the same position as the transparent blue cube".
    Success: the referent, released in the air (`HIGH`) and at least `SHORT` from its target, lies within `LANDED` of
        it, at rest, for `hold_steps` steps. If it is gripped again, it no longer counts as thrown.
    Failure: wrong_object, once another object has been moved; wrong_target, once it was left at another target.
    Reward terms: approach (metres from gripper to object, negative; 0 while it is held or thrown), grasp (1 while it is
        held or thrown), lift (1 while it is held in the air or thrown), transport (metres over the table from object to
        where it counts as landed, negative) and release (1 while it is thrown); success, wrong_object, wrong_target and
        time.
    Config keys: num_objects, num_targets (at least 1), kinds, hold_steps.
    """

    traits = replace(Manipulation.traits, grips=True)
    release_lag = 3  # an arm is fastest early in a control step, and nearly at rest at its beginning
    potentials = ("approach", "grasp", "lift", "transport", "release")

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._thrown = np.zeros(worlds, bool)
        self._carried = np.zeros((worlds, 3))  # where the object was last held

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        self._thrown[worlds] = False
        self._carried[worlds] = self._held_at(state)[worlds]

    @property
    def memory(self) -> NDArray[np.float64]:
        """(N, 1) whether the referent has been thrown."""
        return self._thrown[:, None].astype(np.float64)

    def _held_at(self, state: State) -> Array:
        """(N, 3) where the referent is held; NaN where it is not."""
        return np.where((state.held == state.referent)[:, None], self._referent(state), np.nan)

    def _update_memory(self, state: State) -> None:
        held = state.held == state.referent
        short = length((self._goal(state) - self._carried)[:, :2]) >= SHORT
        released = ~held & short & (self._carried[:, 2] - self.config.object_size / 2 >= HIGH)
        self._thrown = ~held & (self._thrown | released)
        self._carried = self._held_at(state)

    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        return self._thrown & (self._left(state) == 0) & (self._still >= 1) & (state.held == NOTHING)

    def _left(self, state: State) -> Array:
        """(N,) metres over the table to where the referent counts as landed."""
        return np.maximum(length((self._goal(state) - self._referent(state))[:, :2]) - LANDED, 0.0)

    def _potentials(self, state: State) -> dict[str, Array]:
        place, held = self._referent(state), state.held == state.referent
        has = held | self._thrown
        up = place[:, 2] - self.config.object_size / 2 >= HIGH
        return {
            "approach": np.where(has, 0.0, -length(place - state.gripper)),
            "grasp": has.astype(np.float64),
            "lift": ((held & up) | self._thrown).astype(np.float64),
            "transport": -self._left(state),
            "release": self._thrown.astype(np.float64),
        }
