"""Unstack: take an object down from the top of another one, and put it on the table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from conf.schema import ConfigError
from envs.tasks.free_places import COLUMNS, ToTable
from envs.tasks.registry import register_task
from envs.tasks.types import EpisodeSpec, State, TaskConfig
from human import Person
from language import Placed, Scene

STACKS = 2  # in an episode


@register_task("nl_unstack", verb="unstack")
class Unstack(ToTable):
    """ "unstack the red cube": several stacks of two, whose upper objects can be asked for.

    Success: the referent has been picked up and stands on the table, beside all other objects, released and at rest,
    for `hold_steps` steps. A base that is moved is the wrong object.
    """

    columns = COLUMNS

    def __init__(
        self, config: TaskConfig, object_area: Sequence[float], num_worlds: int, person: Person | None = None
    ) -> None:
        if len(config.objects) or config.min_objects < 2 * STACKS:
            raise ConfigError(
                f"task.min_objects={config.min_objects} must be at least {2 * STACKS} in task.name={config.name}, and "
                f"task.objects empty: {STACKS} stacks of two are drawn"
            )
        super().__init__(config, object_area, num_worlds, person)

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
        """(K,) which objects stand on another one."""
        return super()._movable(placed) & (placed.scene.positions[:, 2] > self.config.object_size)

    def episode(self, placed: Placed, referent: int, target: int | None, rng: Generator) -> EpisodeSpec:
        """As in other tasks. Objects on others are at rest."""
        episode = super().episode(placed, referent, target, rng)
        return replace(episode, resting=np.ones(len(placed.scene), bool))
