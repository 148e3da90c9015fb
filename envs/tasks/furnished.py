"""Common logic of the tasks in which fixtures, the fittings of the workspace, stand among loose objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from conf.schema import ConfigError
from envs.sim.workspace import HANDLE, Fitting
from envs.tasks.movable_objects import MovableObjects
from envs.tasks.object_layout import scatter
from envs.tasks.types import Array, Column, EpisodeSpec, State, TaskConfig
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
