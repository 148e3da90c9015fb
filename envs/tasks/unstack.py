"""Unstack: take an object down from the top of another one, and put it on the table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from conf.schema import ConfigError
from envs.tasks.geometry import length
from envs.tasks.pick_and_place import PickAndPlace
from envs.tasks.registry import register_task
from envs.tasks.types import Array, Column, EpisodeSpec, State, TaskConfig
from human import Person
from language import Placed, Scene

STACKS = 2  # in an episode
APART = 0.12  # metres between the middle of a free place and all other objects
BESIDE = 1.3  # widths between two objects that stand apart
LEVEL = 0.01  # metres above the table up to which an object stands on it
FREE = 0.3  # metres at which the observed offset to a free place is clipped
GRID = (4, 9)  # places along x and y that are looked at
WORST = 10.0  # metres of way for which a place is worth a metre of clearance less


@register_task("nl_unstack", verb="unstack")
class Unstack(PickAndPlace):
    """ "unstack the red cube": several stacks of two, whose upper objects can be asked for.

    Success: the referent has been picked up and stands on the table, beside all other objects, released and at rest,
    for `hold_steps` steps. A base that is moved is the wrong object.
    Potentials: those of pick and place, with the nearest free place of the table, which is observed, as the target.
    """

    columns = (
        Column("metres along x to where the table is free for it", -FREE, FREE),
        Column("metres along y to where the table is free for it", -FREE, FREE),
    )

    def __init__(
        self, config: TaskConfig, object_area: Sequence[float], num_worlds: int, person: Person | None = None
    ) -> None:
        if len(config.objects) or config.min_objects < 2 * STACKS:
            raise ConfigError(
                f"task.min_objects={config.min_objects} must be at least {2 * STACKS} in task.name={config.name}, and "
                f"task.objects empty: {STACKS} stacks of two are drawn"
            )
        x0, x1, y0, y1 = object_area
        xs, ys = (np.linspace(low, high, count) for low, high, count in zip((x0, y0), (x1, y1), GRID, strict=True))
        self._table = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
        super().__init__(config, object_area, num_worlds, person)

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._free = np.zeros((worlds, self.config.slots, 3))  # where the table is free for each object

    # ---- judging

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        self._raised[worlds] = (state.held == state.referent)[worlds]
        self._free[worlds] = self._free_places(state)[worlds]

    def _free_places(self, state: State) -> Array:
        """(N, K, 3) for each object, a place of the table near it that is free of all others, metres."""
        places, slots = state.objects, np.arange(state.objects.shape[1])
        apart = length(self._table[:, None] - places[:, None, :, :2])  # world, place, object
        others = state.shown[:, None] & (slots != slots[:, None])  # world, object, other
        clear = np.where(others[:, :, None], apart[:, None], np.inf).min(3)  # world, object, place
        worth = apart.transpose(0, 2, 1) + WORST * np.maximum(APART - clear, 0.0)
        best = self._table[worth.argmin(2)]
        return np.concatenate((best, np.full((*best.shape[:2], 1), self.config.object_size / 2)), axis=2)

    def seen(self, state: State) -> Array:
        return (self._free - state.objects)[..., :2]

    def free_places(self) -> Array:
        """(N, K, 3) where the table was free for each object as the episode began, metres."""
        return self._free

    def _goal(self, state: State) -> Array:
        return self._free[self._rows, state.referent]

    def _is_near_goal(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether the referent stands on the table, beside all others."""
        place = self._referent(state)
        others = state.shown.copy()
        others[self._rows, state.referent] = False
        apart = length((state.objects - place[:, None])[..., :2]).min(1, where=others, initial=np.inf)
        level = place[:, 2] < self.config.object_size / 2 + LEVEL
        return level & (apart >= BESIDE * self.config.object_size)

    def relabel(self, placed: Placed, moments: State, rng: Generator) -> EpisodeSpec | None:
        """None: an object that was moved by mistake did not stand on another one."""
        return None

    # ---- drawing

    def _scene(self, rng: Generator) -> Scene:
        """The first objects stand on the next ones."""
        scene = super()._scene(rng)
        places = scene.positions.copy()
        places[:STACKS] = places[STACKS : 2 * STACKS] + [0.0, 0.0, self.config.object_size]
        return scene.moved(places)

    def _movable(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) what stands on another object."""
        return super()._movable(placed) & (placed.scene.positions[:, 2] > self.config.object_size)

    def episode(self, placed: Placed, referent: int, target: int | None, rng: Generator) -> EpisodeSpec:
        """As in other tasks. What stands on others is at rest."""
        episode = super().episode(placed, referent, target, rng)
        return replace(episode, resting=np.ones(len(placed.scene), bool))
