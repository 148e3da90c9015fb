"""Common logic of the tasks in which fixtures, the fittings of the workspace, stand among loose objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.errors import ConfigError
from envs.sim.workspace import HANDLE, Fitting
from envs.tasks.pick_and_place import ABOVE, MOUTH, PickAndPlace
from envs.tasks.shared.base import register_task
from envs.tasks.shared.free_places import COLUMNS, ToTable
from envs.tasks.shared.geometry import funnel, scatter
from envs.tasks.shared.manipulation import SCENES, Manipulation, MovableObjects
from envs.tasks.shared.types import Array, Column, EpisodeSpec, State, TaskConfig
from human import Person
from language import COLORS, FITTINGS, NOUNS, Placed, Scene

OPEN, SHUT = 0.85, 0.05  # shares of its range: from the first on a fitting counts as open, up to the second as shut
AJAR = (0.0, 0.04)  # range of the share by which a fitting that is drawn as shut is open
NUMBERS = np.array([list(NOUNS).index(noun) for noun in FITTINGS])


class Furnished(MovableObjects):
    """The workspace's fittings are objects with a noun and a colour, whose positions are those of their handles.

    `num_objects` counts them, too; the others are loose.
    """

    fixtures: tuple[str, ...] = FITTINGS
    grips = True
    columns = (*(Column(f"is a {noun}", 0.0, 1.0) for noun in FITTINGS), Column("share by which it is open", 0.0, 1.0))
    shut = 0.5  # the share of fittings that are shut as an episode begins
    wide = (0.88, 1.0)  # shares by which the others are open

    def __init__(
        self, config: TaskConfig, object_area: Sequence[float], num_worlds: int, person: Person | None = None
    ) -> None:
        if len(config.objects):
            raise ConfigError(f"task.objects must be empty in task.name={config.name}: its objects are drawn")
        if config.min_objects < len(FITTINGS):
            raise ConfigError(
                f"task.min_objects={config.min_objects} must be at least {len(FITTINGS)} in task.name={config.name}: "
                f"{' and '.join(FITTINGS)} are among them"
            )
        super().__init__(config, object_area, num_worlds, person)
        self.fittings: dict[int, Fitting] = {}  # by the number of their noun

    def furnish(self, fittings: Mapping[str, Fitting]) -> None:
        for noun in FITTINGS:
            if noun not in fittings or HANDLE not in fittings[noun].parts:
                raise ConfigError(
                    f"task.name={self.config.name} needs a workspace whose fittings are {' and '.join(FITTINGS)}, each "
                    "with a handle within reach: choose workspace=room"
                )
            self.fittings[list(NOUNS).index(noun)] = fittings[noun]

    @property
    def bodies(self) -> tuple[int, int, int]:
        free, fixed, targets = super().bodies
        return free - len(FITTINGS), fixed, targets

    # ---- evaluating

    def shares(self, nouns: NDArray[np.int64], places: Array) -> Array:
        """(...) the share by which fittings are open; 0 for other objects. nouns: (...). places: (..., 3), metres."""
        shares = np.zeros(nouns.shape)
        for noun, fitting in self.fittings.items():
            which = nouns == noun
            shares[which] = fitting.share(places[which])
        return shares

    def seen(self, state: State) -> Array:
        return self._described(state.nouns, state.objects)

    def described(self, episode: EpisodeSpec) -> Array:
        return self._described(episode.scene.nouns, episode.scene.positions)

    def _described(self, nouns: NDArray[np.int64], places: Array) -> Array:
        """(..., C) the values of `columns`. nouns: (...). places: (..., 3), metres."""
        shares = self.shares(nouns, places)[..., None]
        return np.concatenate((nouns[..., None] == NUMBERS, shares), axis=-1)

    def rooms(self, nouns: NDArray[np.int64], places: Array) -> Array:
        """The space inside each fitting.

        Args:
            nouns: (...) numbers of the objects' nouns.
            places: (..., 3) positions, of fittings those of their handles, metres.

        Returns:
            (..., 2, 3) lowest and highest corner, metres; 0 for other objects.
        """
        rooms, shares = np.zeros((*nouns.shape, 2, 3)), self.shares(nouns, places)
        for noun, fitting in self.fittings.items():
            rooms[nouns == noun] = fitting.inside_at(shares[nouns == noun])
        return rooms

    def _inside(self, nouns: NDArray[np.int64], places: Array) -> NDArray[np.bool_]:
        """(..., K, K) whether the first of two objects is in the second. nouns: (..., K). places: (..., K, 3)."""
        rooms = self.rooms(nouns, places)
        low, high = rooms[..., 0, :], rooms[..., 1, :]
        at = places[..., :, None, :]
        return np.all((at >= low[..., None, :, :]) & (at <= high[..., None, :, :]), axis=-1)

    def middles(self, nouns: NDArray[np.int64], places: Array) -> Array:
        """(..., 3) where an object lies in the middle of each fitting, metres."""
        rooms = self.rooms(nouns, places)
        low, high = rooms[..., 0, :], rooms[..., 1, :]
        middle = (low + high) / 2
        middle[..., 2] = low[..., 2] + self.config.object_size / 2
        return middle

    def relabel(self, placed: Placed, moments: State, rng: Generator) -> EpisodeSpec | None:
        """None: no sentence names the place to which a fitting was moved."""
        return None

    # ---- drawing

    def _draw_shares(self, rng: Generator) -> Array:
        """(F,) the share by which each fitting is open when an episode begins: each is shut or open."""
        low, high = np.where(rng.random((len(FITTINGS), 1)) < self.shut, AJAR, self.wide).T
        return rng.uniform(low, high)

    def _scene(self, rng: Generator) -> Scene:
        config = self.config
        count = int(rng.integers(config.min_objects, config.num_objects + 1)) - len(FITTINGS)
        loose = scatter(rng, count, self._area, config.spacing, config.object_size / 2)
        shares = zip(self.fittings.values(), self._draw_shares(rng), strict=True)
        handles = [fitting.handle_at(fitting.value(share)) for fitting, share in shares]
        nouns = np.concatenate((self._nouns[rng.integers(len(self._nouns), size=count)], list(self.fittings)))
        colors = rng.integers(len(COLORS), size=len(nouns))
        places = np.concatenate((np.reshape(loose, (-1, 3)), handles))
        return Scene.from_arrays(nouns, colors, places, config.object_size, viewpoint=config.viewpoint)

    def episode(self, placed: Placed, referent: int, target: int | None, rng: Generator) -> EpisodeSpec:
        """As in other tasks, with the shares by which fittings are open."""
        episode = super().episode(placed, referent, target, rng)
        shares = self.shares(placed.scene.nouns, placed.scene.positions)
        return replace(episode, shares=np.clip(shares, 0.0, 1.0))

    def _fits(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) which objects are fittings."""
        return np.isin(placed.scene.nouns, list(self.fittings))


class OpenClose(Furnished, Manipulation):
    """The referent is a fitting. It stays where it is left.

    Success: it is open, or shut, for `hold_steps` steps, pulled or pushed. Another object, or another fitting's handle,
    that is moved is the wrong object.
    Potentials: approach (metres from gripper to handle along a funnel above it, negative; 0 while it is held or the
    goal is reached), grasp (1 while it is held or the goal is reached) and operate (the share of the way there).
    """

    potentials = ("approach", "grasp", "operate")

    def _share(self, state: State) -> Array:
        """(N,) the share by which the referent is open."""
        each = self._rows, state.referent
        return self.shares(state.nouns[each], state.objects[each])

    def _potentials(self, state: State) -> dict[str, Array]:
        has = (state.held == state.referent) | self._at_goal(state)
        way = funnel(state.gripper - self._referent(state), ABOVE, MOUTH)
        return {
            "approach": np.where(has, 0.0, -way),
            "grasp": has.astype(np.float64),
            "operate": np.clip(self._done(state), 0.0, 1.0),
        }

    def _done(self, state: State) -> Array:
        """(N,) the share of the way to the goal."""
        return self._share(state) / OPEN

    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        return self._done(state) >= 1.0

    def _stays(self, state: State) -> NDArray[np.bool_]:
        """(N, K) which objects are to stay where they are: objects in the referent move with it."""
        along = self._inside(state.nouns, state.objects)[self._rows, :, state.referent]
        return super()._stays(state) & ~along

    def _movable(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) the fittings that are not yet open."""
        return self._fits(placed) & (self.shares(placed.scene.nouns, placed.scene.positions) < SHUT)

    def _is_feasible(self, placed: Placed) -> bool:
        return bool(self._movable(placed).any())


@register_task("nl_open", verb="open")
class Open(OpenClose):
    """ "open the drawer"."""


@register_task("nl_close", verb="close")
class Close(OpenClose):
    """ "close the fridge"."""

    def _done(self, state: State) -> Array:
        return (1.0 - self._share(state)) / (1.0 - SHUT)

    def _movable(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) the fittings that are open."""
        return self._fits(placed) & (self.shares(placed.scene.nouns, placed.scene.positions) > OPEN)


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
