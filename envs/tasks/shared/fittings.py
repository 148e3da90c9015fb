"""The fittings of a workspace as objects of a scene: how far they are open, and what is in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.errors import ConfigError
from envs.sim.workspace import HANDLE, Fitting
from envs.tasks.shared.geometry import scatter
from envs.tasks.shared.task_config import TaskConfig
from envs.tasks.shared.types import Array, Column
from language import COLORS, FITTINGS, NOUNS, Placed, Scene

OPEN, SHUT = 0.85, 0.05  # shares of its range: from the first on a fitting counts as open, up to the second as shut
AJAR = (0.0, 0.04)  # range of the share by which a fitting that is drawn as shut is open
FITTING_NUMBERS = np.array([list(NOUNS).index(noun) for noun in FITTINGS])
FITTING_COLUMNS = (
    *(Column(f"is a {noun}", 0.0, 1.0) for noun in FITTINGS),
    Column("share by which it is open", 0.0, 1.0),
)


@dataclass(frozen=True, kw_only=True)
class FittingStarts:
    """How far fittings are open as an episode begins.

    shut: share of the fittings that are shut. wide: range of the share by which the others are open.
    """

    shut: float = 0.5
    wide: tuple[float, float] = (0.88, 1.0)


class SceneFittings:
    """The fittings among the objects of scenes. A fitting has a noun and a colour; its position is that of its handle.

    `task.num_objects` counts them, too; the other objects are loose.

    Attributes:
        by_noun: each fitting, by the number of its noun.

    Args:
        config: of the task.
        starts: how far they are open as an episode begins.

    Raises:
        ConfigError: the config lists objects, or has too few for the fittings.
    """

    def __init__(self, config: TaskConfig, starts: FittingStarts) -> None:
        if len(config.objects):
            raise ConfigError(f"task.objects must be empty in task.name={config.name}: its objects are drawn")
        if config.min_objects < len(FITTINGS):
            raise ConfigError(
                f"task.min_objects={config.min_objects} must be at least {len(FITTINGS)} in task.name={config.name}: "
                f"{' and '.join(FITTINGS)} are among them"
            )
        self._config, self._starts = config, starts
        self.by_noun: dict[int, Fitting] = {}

    def furnish(self, fittings: Mapping[str, Fitting]) -> None:
        """Take the workspace's fittings. Raises ConfigError where one is missing, or has no handle."""
        for noun in FITTINGS:
            if noun not in fittings or HANDLE not in fittings[noun].parts:
                raise ConfigError(
                    f"task.name={self._config.name} needs a workspace whose fittings are {' and '.join(FITTINGS)}, "
                    "each with a handle within reach: choose workspace=room"
                )
            self.by_noun[list(NOUNS).index(noun)] = fittings[noun]

    # ---- queries: nouns are numbers (...), places positions (..., 3), of fittings those of their handles, metres

    def shares(self, nouns: NDArray[np.int64], places: Array) -> Array:
        """(...) the share by which fittings are open; 0 for other objects."""
        shares = np.zeros(nouns.shape)
        for noun, fitting in self.by_noun.items():
            which = nouns == noun
            shares[which] = fitting.share(places[which])
        return shares

    def described(self, nouns: NDArray[np.int64], places: Array) -> Array:
        """(..., C) the values of `FITTING_COLUMNS`."""
        shares = self.shares(nouns, places)[..., None]
        return np.concatenate((nouns[..., None] == FITTING_NUMBERS, shares), axis=-1)

    def interiors(self, nouns: NDArray[np.int64], places: Array) -> Array:
        """(..., 2, 3) lowest and highest corner of the space inside each fitting, metres; 0 for other objects."""
        interiors, shares = np.zeros((*nouns.shape, 2, 3)), self.shares(nouns, places)
        for noun, fitting in self.by_noun.items():
            interiors[nouns == noun] = fitting.inside_at(shares[nouns == noun])
        return interiors

    def inside(self, nouns: NDArray[np.int64], places: Array) -> NDArray[np.bool_]:
        """(..., K, K) whether the first of two objects is in the second. nouns: (..., K). places: (..., K, 3)."""
        interiors = self.interiors(nouns, places)
        low, high = interiors[..., 0, :], interiors[..., 1, :]
        at = places[..., :, None, :]
        return np.all((at >= low[..., None, :, :]) & (at <= high[..., None, :, :]), axis=-1)

    def middles(self, nouns: NDArray[np.int64], places: Array) -> Array:
        """(..., 3) where an object lies in the middle of each fitting, metres."""
        interiors = self.interiors(nouns, places)
        low, high = interiors[..., 0, :], interiors[..., 1, :]
        middle = (low + high) / 2
        middle[..., 2] = low[..., 2] + self._config.object_size / 2
        return middle

    def among(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) which objects of the scene are fittings."""
        return np.isin(placed.scene.nouns, list(self.by_noun))

    def are_open(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) the fittings of the scene that are open."""
        return self.among(placed) & (self.shares(placed.scene.nouns, placed.scene.positions) > OPEN)

    def are_shut(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) the fittings of the scene that are shut."""
        return self.among(placed) & (self.shares(placed.scene.nouns, placed.scene.positions) < SHUT)

    # ---- drawing

    def draw_handles(self, rng: Generator) -> Array:
        """(F, 3) where the handles are as an episode begins, metres: each fitting is shut or open."""
        shut = rng.random((len(FITTINGS), 1)) < self._starts.shut
        low, high = np.where(shut, AJAR, self._starts.wide).T
        shares = zip(self.by_noun.values(), rng.uniform(low, high), strict=True)
        return np.array([fitting.handle_at(fitting.value(share)) for fitting, share in shares])

    def draw_scene(self, count: int, area: Sequence[float], nouns: NDArray[np.int64], rng: Generator) -> Scene:
        """Draw a scene of loose objects, and then the fittings.

        Args:
            count: how many objects it has, with the fittings.
            area: x0, x1, y0, y1 of the loose objects' centres, metres.
            nouns: numbers of the nouns that they can have.
            rng: of the draws.
        """
        config, loose = self._config, count - len(FITTINGS)
        drawn = scatter(rng, loose, area=area, spacing=config.spacing, height=config.object_size / 2)
        handles = self.draw_handles(rng)
        numbers = np.concatenate((nouns[rng.integers(len(nouns), size=loose)], list(self.by_noun)))
        colors = rng.integers(len(COLORS), size=len(numbers))
        places = np.concatenate((np.reshape(drawn, (-1, 3)), handles))
        return Scene.from_arrays(numbers, colors, places, config.object_size, viewpoint=config.viewpoint)
