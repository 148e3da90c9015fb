"""Common goal, failure and reward logic of the tasks that move one object."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from envs.tasks.achieved_goal import find_achieved_goal
from envs.tasks.geometry import length
from envs.tasks.movable_objects import MovableObjects
from envs.tasks.outcome import Outcome
from envs.tasks.types import Array, EpisodeSpec, State
from language import Placed

DISTURBED = 0.05  # metres by which another object must be moved to count as the wrong object
STILL = 0.002  # metres in a control step below which an object is at rest


class Manipulation(MovableObjects):
    """One instruction an episode: success is to reach its goal, for `hold_steps` control steps.

    An episode ends as `wrong_object` once another object has moved by `disturbed` metres, as `wrong_target` once the
    referent was left at another goal, and, if the task `fails`, as `failed` once success has become impossible in
    another way.

    All reward terms except those for the ends of episodes and for time are differences of potentials (potential-based
    shaping, Ng et al. 1999), from which subclasses may take costs, so no cycle of states earns anything.
    """

    potentials: tuple[str, ...]  # the names of the values of `_potentials`
    fails = False
    disturbed = DISTURBED
    ends: tuple[str, ...] = ("success", "wrong_object", "wrong_target", "time")

    def __init_subclass__(cls) -> None:
        cls.ends = (*cls.ends[:3], "failed", "time") if cls.fails else cls.ends
        cls.terms = (*cls.potentials, *cls.ends)

    def _allocate(self, worlds: int) -> None:
        slots = self.config.slots
        self._begun = np.zeros((worlds, slots, 3))  # where objects were as the episode began
        self._places = np.zeros((worlds, slots, 3))  # where objects were a step ago
        self._moved = np.zeros((worlds, slots, 3))  # how they moved since
        self._motion = np.zeros((worlds, 3))  # the referent
        self._still = np.zeros(worlds, np.int64)  # control steps that the referent has been at rest
        self._reached = np.zeros(worlds, np.int64)  # control steps that the goal has been reached
        self._values, self._last_values = ({name: np.zeros(worlds) for name in self.potentials} for _ in range(2))

    @abstractmethod
    def _potentials(self, state: State) -> dict[str, Array]:
        """(N,) each: the potentials by name. Higher is nearer to success."""

    @abstractmethod
    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether the goal is reached; for `hold_steps` consecutive steps, that is success."""

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        """Resets the memory of a subclass for these worlds."""

    def _update_memory(self, state: State) -> None:
        """Updates the memory of a subclass for all worlds, once per control step, before anything is evaluated."""

    def reset(self, worlds: NDArray[np.int64], state: State) -> None:
        """Begins new episodes in these worlds, or continues with another referent."""
        self._begun[worlds] = state.objects[worlds]
        self._places[worlds] = state.objects[worlds]
        self._moved[worlds] = self._motion[worlds] = 0.0
        self._still[worlds] = self._reached[worlds] = 0
        self._reset_memory(worlds, state)
        for name, values in self._potentials(state).items():
            self._values[name][worlds] = values[worlds]

    def step(self, state: State) -> Outcome:
        """Evaluates one control step of all worlds: the memory is updated first, and the rest has no side effects."""
        self._remember(state)
        return self._outcome(state)

    def _remember(self, state: State) -> None:
        """Updates the memory of all episodes. Nothing else writes to it between resets."""
        self._moved = state.objects - self._places
        self._motion = self._moved[self._rows, state.referent]
        self._places[:] = state.objects
        self._still = np.where(length(self._motion) < STILL, self._still + 1, 0)
        self._update_memory(state)
        self._reached = np.where(self._at_goal(state), self._reached + 1, 0)
        self._last_values, self._values = self._values, self._potentials(state)

    def _outcome(self, state: State) -> Outcome:
        """The reward terms and ends that follow from the state and the memory."""
        success = self._reached >= self.config.success_steps
        wrong_object = self._disturbed(state) & ~success
        wrong_target = self._misplaced(state) & ~success & ~wrong_object
        failed = self._failed(state) & ~success & ~wrong_object & ~wrong_target
        terms = {name: self._values[name] - self._last_values[name] for name in self.potentials}
        ends = {
            "success": success,
            "wrong_object": wrong_object,
            "wrong_target": wrong_target,
            "failed": failed,
            "time": np.ones(len(self._rows)),
        }
        terms |= {name: ends[name].astype(np.float64) for name in self.ends}
        return Outcome(terms, success, wrong_object, self._reached > 0, wrong_target, failed)

    def _failed(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether success has become impossible in another way."""
        return np.zeros(len(self._rows), bool)

    def _referent(self, state: State) -> Array:
        """(N, 3) positions of the referents, metres."""
        return state.objects[self._rows, state.referent]

    def _goal(self, state: State) -> Array:
        """(N, 3) where the referents go, metres."""
        return self._goals(state)[self._rows, state.target]

    def _goals(self, state: State) -> Array:
        """(N, K, 3) where a referent goes whose goal is each slot's object, metres."""
        return state.objects

    def _disturbed(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether an object has been moved that is to stay where it is."""
        return np.any(self._stays(state) & (length(state.objects - self._begun) > self.disturbed), axis=1)

    def _stays(self, state: State) -> NDArray[np.bool_]:
        """(N, K) which objects are to stay where they are: all but the referent."""
        others = state.movable.copy()
        others[self._rows, state.referent] = False
        if self.real_goals:  # the task itself bounds how far its goals may be moved
            others[self._rows, state.target] = False
        return others

    def _misplaced(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether the referent has been brought to another goal, and left there."""
        if not self.places:
            return np.zeros(len(self._rows), bool)
        others = state.goals.copy()
        others[self._rows, state.target] = others[self._rows, state.referent] = False
        if self.real_goals and self.config.devices:  # a base that stands at a see-through target is not misplaced
            others &= state.movable
        place = self._referent(state)
        there = others & (length(self._goals(state) - place[:, None]) <= self.config.success_radius)
        moved = length(place - self._begun[self._rows, state.referent]) > self.disturbed
        left = (state.held != state.referent) & (self._still >= self.config.success_steps)
        return there.any(1) & moved & left

    def relabel(self, placed: Placed, moments: State, rng: Generator) -> EpisodeSpec | None:
        """Names an object that was moved, and a target where it came to rest, moved there if none stood there."""
        achieved = find_achieved_goal(moments, self.disturbed, STILL, self.config.success_radius, rng)
        if achieved is None:
            return None
        return self.episode(
            placed._replace(scene=placed.scene.moved(achieved.places)), achieved.referent, achieved.target, rng
        )
