"""Put in and take out: bring an object into an open drawer or fridge, or out of it onto the table."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from conf.schema import ConfigError
from envs.tasks.free_places import COLUMNS, ToTable
from envs.tasks.furnished import OPEN, Furnished
from envs.tasks.movable_objects import SCENES
from envs.tasks.pick_and_place import PickAndPlace
from envs.tasks.registry import register_task
from envs.tasks.types import Array, EpisodeSpec, State
from language import FITTINGS, Placed, Scene

PUSHED = 0.25  # share by which the fitting of the instruction may be opened or closed by accident
JITTER = 0.012  # metres from the middle of a fitting at which an object in it begins, at most


class InOut(Furnished, PickAndPlace):
    """The referent is a loose object, and the target a fitting that is open.

    Success: the referent has been picked up and lies where it is to go, released and at rest, for `hold_steps` steps.
    An object that went into, or came out of, the other fitting is at the wrong target. The episode fails once the
    fitting of the instruction has been pushed by `PUSHED` of its range.
    Potentials: those of pick and place.
    """

    potentials = PickAndPlace.potentials
    real_goals = True
    fails = True
    wide = (0.94, 1.0)  # open far enough for objects to go in and out

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._opened = np.zeros((worlds, self.config.slots))  # the share by which each fitting was open at first

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        self._raised[worlds] = (state.held == state.referent)[worlds]
        self._opened[worlds] = self.shares(state.nouns, state.objects)[worlds]

    def _failed(self, state: State) -> NDArray[np.bool_]:
        each = self._rows, state.target
        share = self.shares(state.nouns[each], state.objects[each])
        return np.abs(share - self._opened[each]) > PUSHED

    def _referent_in(self, state: State) -> NDArray[np.bool_]:
        """(N, K) which fittings the referents are in."""
        return self._inside(state.nouns, state.objects)[self._rows, state.referent]

    # ---- drawing

    def _possible_goals(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) the fittings that are open."""
        return self._fits(placed) & (self.shares(placed.scene.nouns, placed.scene.positions) > OPEN)

    def _is_feasible(self, placed: Placed) -> bool:
        return bool(self._possible_goals(placed).any() and self._movable(placed).any())


@register_task("nl_put_in", verb="put_in")
class PutIn(InOut):
    """ "put the red cube in the drawer"."""

    shut = 0.25

    def _goal(self, state: State) -> Array:
        each = self._rows, state.target
        return self.middles(state.nouns[each], state.objects[each])

    def _is_near_goal(self, state: State) -> NDArray[np.bool_]:
        return self._referent_in(state)[self._rows, state.target]

    def _misplaced(self, state: State) -> NDArray[np.bool_]:
        there = self._referent_in(state)
        there[self._rows, state.target] = False
        left = (state.held != state.referent) & (self._still >= self.config.success_steps)
        return (there & state.goals).any(1) & left

    def _movable(self, placed: Placed) -> NDArray[np.bool_]:
        return super()._movable(placed) & ~self._fits(placed)


@register_task("nl_take_out", verb="take_out")
class TakeOut(ToTable, InOut):
    """ "take the red cube out of the fridge": an object lies in each fitting, and one or more on the table."""

    columns = (*InOut.columns, *COLUMNS)
    shut = 0.0

    def _is_near_goal(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether the referent stands on the table, beside all others."""
        return super()._is_near_goal(state) & ~self._referent_in(state).any(1)

    def _scene(self, rng: Generator) -> Scene:
        """The first objects lie in the fittings."""
        scene = super()._scene(rng)
        places, count = scene.positions.copy(), len(FITTINGS)
        jitter = rng.uniform(-JITTER, JITTER, (count, 3)) * [1.0, 1.0, 0.0]
        places[:count] = self.middles(scene.nouns[-count:], places[-count:]) + jitter
        return scene.moved(places)

    def _movable(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) which objects lie in a fitting."""
        return np.any(self._inside(placed.scene.nouns, placed.scene.positions), axis=1)

    def _draw(self, rng: Generator) -> EpisodeSpec:
        """An episode whose referent lies in its target."""
        for _ in range(SCENES):
            episode = super()._draw(rng)
            if self._lies_in_target(episode):
                return episode
        raise ConfigError(f"task.name={self.config.name}: nothing lies in a fitting")

    def _each_in_turn(self, rng: Generator) -> list[EpisodeSpec]:
        return [episode for episode in super()._each_in_turn(rng) if self._lies_in_target(episode)]

    def _lies_in_target(self, episode: EpisodeSpec) -> bool:
        scene = episode.scene
        assert episode.target is not None
        return bool(self._inside(scene.nouns, scene.positions)[episode.referent, episode.target])
