"""Grasp, lift, pick and place, pick and rotate: tasks of one object that is gripped from above."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from envs.tasks.shared.base import register_task
from envs.tasks.shared.geometry import funnel, length
from envs.tasks.shared.manipulation import Manipulation
from envs.tasks.shared.types import NOTHING, Array, State, StepOutcome
from language import LIFTED

LIFT = 0.02  # metres above the table at which a held object counts as picked up
MOUTH = 0.02  # metres: a funnel's radius at its lower end
ABOVE, OVER_ALL = 0.06, 0.09  # metres: heights of the funnels to the object, and with it over others to its target
CLEAR = 0.08  # metres over the table up to which lifting is rewarded: objects held there pass over others
TURNED = math.radians(45)  # about the vertical
UPRIGHT = 0.97  # cosine of the angle by which it may lean: 14 degrees
DOWN = 0.01  # metres above the table at which it counts as put down


@register_task("nl_grasp", verb="grasp")
class Grasp(Manipulation):
    """Grip an object and hold it.

    Instruction: "grasp the red cube".
    Success: the referent is held for `hold_steps` steps.
    Failure: wrong_object, once another object has been held for as long, or moved.
    Reward terms: approach (metres from gripper to object, negative; 0 while it is held) and grasp (1 while it is held);
        success, wrong_object, wrong_target (always 0) and time.
    Config keys: num_objects, kinds, hold_steps.
    """

    traits = replace(Manipulation.traits, grips=True)
    potentials: tuple[str, ...] = ("approach", "grasp")

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._other = np.zeros(worlds, np.int64)  # control steps that another object has been held
        self._before = np.full(worlds, NOTHING)  # the object held at the beginning, until it is released

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        self._other[worlds] = 0
        self._before[worlds] = state.held[worlds]

    def _update_memory(self, state: State) -> None:
        self._before = np.where(state.held == self._before, self._before, NOTHING)
        other = (state.held != NOTHING) & (state.held != state.referent) & (state.held != self._before)
        self._other = np.where(other, self._other + 1, 0)

    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        return state.held == state.referent

    def _disturbed(self, state: State) -> NDArray[np.bool_]:
        return super()._disturbed(state) | (self._other >= self.config.success_steps)

    def _potentials(self, state: State) -> dict[str, Array]:
        held = state.held == state.referent
        apart = length(self._referent(state) - state.gripper)
        return {"approach": np.where(held, 0.0, -apart), "grasp": held.astype(np.float64)}


@register_task("nl_lift", verb="lift")
class Lift(Grasp):
    """Grip an object and raise it.

    Instruction: "lift the red cube".
    Success: the referent is held `LIFTED` metres above where it stood, for `hold_steps` steps.
    Failure: wrong_object, once another object has been held for as long, or moved.
    Reward terms: approach and grasp as of `Grasp`, and height (metres above where it stood, up to `LIFTED`); success,
        wrong_object, wrong_target (always 0) and time.
    Config keys: num_objects, kinds, hold_steps.
    """

    potentials = ("approach", "grasp", "height")

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._stood = np.zeros(worlds)  # metres above the table

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        super()._reset_memory(worlds, state)
        taken = state.held == state.referent  # an episode that begins with the object held
        stood = np.where(taken, self.config.object_size / 2, self._referent(state)[:, 2])
        self._stood[worlds] = stood[worlds]

    @property
    def memory(self) -> NDArray[np.float64]:
        """(N, 1) how high the referent stood."""
        return np.clip(self._stood, 0.0, 1.0)[:, None]

    def _height(self, state: State) -> Array:
        return self._referent(state)[:, 2] - self._stood

    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        return super()._at_goal(state) & (self._height(state) >= LIFTED)

    def _potentials(self, state: State) -> dict[str, Array]:
        return super()._potentials(state) | {"height": np.clip(self._height(state), 0.0, LIFTED)}


@register_task("pick_and_place", "nl_pick_and_place", verb="pick_and_place")
class PickAndPlace(Manipulation):
    """Pick an object up and put it down at its target, which is see-through.

    Instruction: "pick the green cube and place it to the same position as the transparent red cube".
    Success: the referent has been picked up, and lies within `radius` of its target, released and at rest, for
        `hold_steps` steps. Pushing it there does not count.
    Failure: wrong_object, once another object has been moved; wrong_target, once it was left at another target.
    Reward terms: approach (metres from gripper to object along a funnel above it, negative; 0 while it is held or
        placed), grasp (1 while it is held or placed), lift (the greatest height at which it has been held, in units of
        `CLEAR`, at most 1), transport (metres from object to target along a higher funnel, negative) and release (1
        while it is placed: picked up, near its target, and released); success, wrong_object, wrong_target and time.
        From transport is taken what the object was carried sideways, in metres, times the share of `CLEAR` by which it
        was lower. It is no potential: a way near the table costs more than one above the other objects.
    Config keys: num_objects, num_targets (at least 1), kinds ([]: one object and one target), radius, curriculum.
    """

    traits = replace(Manipulation.traits, grips=True)
    potentials = ("approach", "grasp", "lift", "transport", "release")

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._raised = np.zeros(worlds)  # the greatest height at which the referent has been held, in units of CLEAR

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        # An episode that begins with the object held high, or near its goal, requires no lifting. One that begins with
        # it held low does: otherwise policies learn to carry objects along the table.
        height = self._held_height(state)
        lifted = self._is_near_goal(state) | (height >= LIFT / CLEAR)
        self._raised[worlds] = np.where(lifted, 1.0, height)[worlds]

    @property
    def memory(self) -> NDArray[np.float64]:
        """(N, 1) the greatest height at which the referent has been held, in units of `CLEAR`."""
        return self._raised[:, None]

    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        return self._placed_there(state) & (self._still >= 1)

    def _update_memory(self, state: State) -> None:
        self._raised = np.maximum(self._raised, self._held_height(state))

    def _outcome(self, state: State) -> StepOutcome:
        outcome = super()._outcome(state)
        low = (1.0 - self._held_height(state)) * (state.held == state.referent)
        outcome.terms["transport"] -= low * length(self._motion[:, :2])
        return outcome

    def _held_height(self, state: State) -> Array:
        """(N,) height over the table at which the referent is held, in units of `CLEAR`, at most 1; 0 if it is not."""
        height = self._referent(state)[:, 2] - self.config.object_size / 2
        return np.clip(height / CLEAR, 0.0, 1.0) * (state.held == state.referent)

    def _placed_there(self, state: State) -> NDArray[np.bool_]:
        return (self._raised >= LIFT / CLEAR) & self._is_near_goal(state) & (state.held == NOTHING)

    def _is_near_goal(self, state: State) -> NDArray[np.bool_]:
        return length(self._goal(state) - self._referent(state)) <= self.config.success_radius

    def goal_places(self, state: State) -> Array:
        """(N, 3) the places to which reward and expert bring the referents, metres."""
        return self._goal(state)

    def _potentials(self, state: State) -> dict[str, Array]:
        placed = self._placed_there(state)
        has = (state.held == state.referent) | placed
        return {
            "approach": np.where(has, 0.0, -self._way_to_object(state)),
            "grasp": has.astype(np.float64),
            "lift": self._raised.copy(),
            "transport": -self._way_to_goal(state),
            "release": placed.astype(np.float64),
        }

    def _way_to_object(self, state: State) -> Array:
        """(N,) metres from the gripper to its object."""
        return funnel(state.gripper - self._referent(state), ABOVE, MOUTH)

    def _way_to_goal(self, state: State) -> Array:
        """(N,) metres from the object to its target."""
        return funnel(self._referent(state) - self._goal(state), OVER_ALL, MOUTH)


@register_task("pick_and_rotate", verb="pick_and_rotate")
class PickAndRotate(Manipulation):
    """Pick an object up and put it down turned.

    Instruction: "pick the red cube and rotate it".
    Success: the referent has been picked up and stands on the table again, turned about the vertical by `TURNED` or
        more from its initial yaw, released and at rest, for `hold_steps` steps.
    Failure: wrong_object, once another object has been moved.
    Reward terms: approach (metres from gripper to object, negative; 0 while it is held or done), grasp (1 while it is
        held or done), lift (1 once it has been picked up), turn (the share of `TURNED`) and release (1 while it is
        done: picked up, turned, put down and released); success, wrong_object, wrong_target (always 0) and time.
    Config keys: num_objects, kinds, hold_steps.
    """

    traits = replace(Manipulation.traits, grips=True, turns=True)
    potentials = ("approach", "grasp", "lift", "turn", "release")

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._picked = np.zeros(worlds, bool)
        self._stood = np.zeros(worlds)  # radians about the vertical

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        self._picked[worlds] = self._in_the_air(state)[worlds]
        self._stood[worlds] = yaw(self._turns(state))[worlds]

    @property
    def memory(self) -> NDArray[np.float64]:
        """(N, 3) whether the referent has been picked up, and sine and cosine of its first yaw, scaled to [0, 1]."""
        angle = self._stood
        return np.stack((self._picked, (1 + np.sin(angle)) / 2, (1 + np.cos(angle)) / 2), axis=1)

    def _turns(self, state: State) -> Array:
        """(N, 4) the referents' quaternions."""
        return state.quaternions[self._rows, state.referent]

    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        return self._done(state) & (self._still >= 1)

    def _update_memory(self, state: State) -> None:
        self._picked |= self._in_the_air(state)

    def _in_the_air(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether the referent is held above the table."""
        return (state.held == state.referent) & (self._height(state) >= LIFT)

    def _height(self, state: State) -> Array:
        return self._referent(state)[:, 2] - self.config.object_size / 2

    def _turned(self, state: State) -> Array:
        """(N,) radians from how the referent stood, at most pi."""
        apart = yaw(self._turns(state)) - self._stood
        return np.abs((apart + np.pi) % (2 * np.pi) - np.pi)

    def _done(self, state: State) -> NDArray[np.bool_]:
        x, y = self._turns(state)[:, :2].T
        stands = (1 - 2 * (x * x + y * y) >= UPRIGHT) & (self._height(state) <= DOWN)
        return self._picked & stands & (self._turned(state) >= TURNED) & (state.held == NOTHING)

    def _potentials(self, state: State) -> dict[str, Array]:
        done = self._done(state)
        has = (state.held == state.referent) | done
        return {
            "approach": np.where(has, 0.0, -length(self._referent(state) - state.gripper)),
            "grasp": has.astype(np.float64),
            "lift": self._picked.astype(np.float64),
            "turn": np.minimum(self._turned(state) / TURNED, 1.0),
            "release": done.astype(np.float64),
        }


def yaw(turns: Array) -> Array:
    """(N,) radians about the vertical of quaternions (N, 4)."""
    x, y, z, w = turns.T
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
