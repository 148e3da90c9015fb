"""Pick and place: pick an object up, carry it to its target, and release it there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.tasks.geometry import funnel, length
from envs.tasks.manipulation import Manipulation
from envs.tasks.outcome import Outcome
from envs.tasks.registry import register_task
from envs.tasks.types import NOTHING, Array, State

LIFT = 0.02  # metres above the table at which a held object counts as picked up
MOUTH = 0.02  # metres: a funnel's radius at its lower end
ABOVE, OVER_ALL = 0.06, 0.09  # metres: heights of the funnels to the object, and with it over others to its target
CLEAR = 0.08  # metres over the table up to which lifting is rewarded: objects held there pass over others


@register_task("pick_and_place", "nl_pick_and_place", verb="pick_and_place")
class PickAndPlace(Manipulation):
    """Such as "pick the green cube and place it to the same position as the transparent red cube".

    Success: the referent has been picked up, and lies within `radius` of its target, released and at rest, for
    `hold_steps` steps. Pushing it there does not count.
    Potentials: approach (metres from gripper to object along a funnel above it, negative; 0 while it is held or
    placed), grasp (1 while it is held or placed), lift (the greatest height at which it has been held, in units of
    `CLEAR`, at most 1), transport (metres from object to target along a higher funnel, negative) and release (1 while
    it is placed: picked up, near its target, and released).
    From the term of transport is taken what the object was carried sideways, in metres, times the share of `CLEAR` by
    which it was lower. It is no potential: a way near the table costs more than one above the other objects.
    """

    grips = True
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

    def _outcome(self, state: State) -> Outcome:
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
