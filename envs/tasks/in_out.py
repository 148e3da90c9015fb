"""Put in and take out: bring an object into an open drawer or fridge, or out of it onto the table."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from conf.schema import ConfigError
from envs.tasks.furnished import OPEN, Furnished
from envs.tasks.geometry import length
from envs.tasks.manipulation import SCENES
from envs.tasks.pick_and_place import PickAndPlace
from envs.tasks.registry import register_task
from envs.tasks.types import Array, EpisodeSpec, State
from language import FITTINGS, Placed, Scene

PUSHED = 0.25  # share by which the fitting that is meant may be opened or closed on the way
LEVEL = 0.01  # metres above the table up to which an object stands on it
BESIDE = 1.3  # widths between two objects that stand apart
JITTER = 0.012  # metres from the middle of a fitting at which an object in it begins, at most


class InOut(Furnished, PickAndPlace):
    """The referent is a loose object, and the target a fitting that is open.

    Success: the referent has been picked up and lies where it is to go, released and at rest, for `hold_steps` steps.
    In or out of the other fitting, it is at the wrong target. The episode fails once the fitting that is meant has been
    pushed by `PUSHED` of its range.
    Potentials: those of pick and place.
    """

    potentials = PickAndPlace.potentials
    real_goals = True
    fails = True
    wide = (0.94, 1.0)  # objects go into and come out of them

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._opened = np.zeros((worlds, self.config.slots))  # by which share each fitting was open at first

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        self._raised[worlds] = (state.held == state.referent)[worlds]
        self._opened[worlds] = self.shares(state.nouns, state.objects)[worlds]

    def _failed(self, state: State) -> NDArray[np.bool_]:
        each = self._rows, state.target
        share = self.shares(state.nouns[each], state.objects[each])
        return np.abs(share - self._opened[each]) > PUSHED

    def rooms(self, nouns: NDArray[np.int64], places: Array) -> Array:
        """(..., 2, 3) lowest and highest corner of the room in each fitting, metres; of other objects, 0.

        nouns: (...). places: (..., 3), metres.
        """
        rooms, shares = np.zeros((*nouns.shape, 2, 3)), self.shares(nouns, places)
        for noun, fitting in self.fittings.items():
            rooms[nouns == noun] = fitting.inside_at(shares[nouns == noun])
        return rooms

    def _inside(self, nouns: NDArray[np.int64], places: Array) -> NDArray[np.bool_]:
        """(..., K, K) whether the first of two objects is in the second. nouns: (..., K). places: (..., K, 3)."""
        low, high = np.moveaxis(self.rooms(nouns, places), -2, 0)
        at = places[..., :, None, :]
        return ((at >= low[..., None, :, :]) & (at <= high[..., None, :, :])).all(-1)

    def _referent_in(self, state: State) -> NDArray[np.bool_]:
        """(N, K) which fittings the referents are in."""
        return self._inside(state.nouns, state.objects)[self._rows, state.referent]

    def middles(self, nouns: NDArray[np.int64], places: Array) -> Array:
        """(..., 3) where an object lies in the middle of each fitting, metres."""
        low, high = np.moveaxis(self.rooms(nouns, places), -2, 0)
        middle = (low + high) / 2
        middle[..., 2] = low[..., 2] + self.config.object_size / 2
        return middle

    @abstractmethod
    def goal_places(self, state: State) -> Array:
        """(N, 3) where the expert, and the reward, brings the referent, metres."""

    def _goal(self, state: State) -> Array:
        return self.goal_places(state)

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

    def goal_places(self, state: State) -> Array:
        each = self._rows, state.target
        return self.middles(state.nouns[each], state.objects[each])

    def _is_near_goal(self, state: State) -> NDArray[np.bool_]:
        return self._referent_in(state)[self._rows, state.target]

    def _misplaced(self, state: State) -> NDArray[np.bool_]:
        there = self._referent_in(state)
        there[self._rows, state.target] = False
        left = (state.held != state.referent) & (self._still >= self.config.hold_steps)
        return (there & state.goals).any(1) & left

    def _movable(self, placed: Placed) -> NDArray[np.bool_]:
        return super()._movable(placed) & ~self._fits(placed)


@register_task("nl_take_out", verb="take_out")
class TakeOut(InOut):
    """ "take the red cube out of the fridge": an object lies in each fitting, and one or more on the table."""

    shut = 0.0

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._free = np.zeros((worlds, 3))  # where the table is free

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        super()._reset_memory(worlds, state)
        self._free[worlds] = self._free_places(state)[worlds]

    def _free_places(self, state: State) -> Array:
        """(N, 3) the place of the table that is farthest from all objects, metres."""
        x0, x1, y0, y1 = self._area
        table = np.stack(np.meshgrid(np.linspace(x0, x1, 5), np.linspace(y0, y1, 5)), axis=-1).reshape(-1, 2)
        apart = length(table[:, None] - state.objects[:, None, :, :2])  # world, place, object
        best = table[np.where(state.shown[:, None], apart, np.inf).min(2).argmax(1)]
        return np.column_stack((best, np.full(len(best), self.config.object_size / 2)))

    def goal_places(self, state: State) -> Array:
        return self._free

    def _is_near_goal(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether the referent stands on the table, beside all others."""
        place, others = self._referent(state), state.shown.copy()
        others[self._rows, state.referent] = False
        apart = length((state.objects - place[:, None])[..., :2]).min(1, where=others, initial=np.inf)
        level = place[:, 2] < self.config.object_size / 2 + LEVEL
        return level & (apart >= BESIDE * self.config.object_size) & ~self._referent_in(state).any(1)

    def _misplaced(self, state: State) -> NDArray[np.bool_]:
        return np.zeros(len(self._rows), bool)

    def _scene(self, rng: Generator) -> Scene:
        """The first objects lie in the fittings."""
        scene = super()._scene(rng)
        places, count = scene.positions.copy(), len(FITTINGS)
        jitter = rng.uniform(-JITTER, JITTER, (count, 3)) * [1.0, 1.0, 0.0]
        places[:count] = self.middles(scene.nouns[-count:], places[-count:]) + jitter
        return scene.moved(places)

    def _movable(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) what lies in a fitting."""
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
