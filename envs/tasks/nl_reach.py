"""NL reach: several objects, and a sentence that names the one to reach."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator

from conf.schema import ConfigError
from envs.tasks.reach import Reach
from envs.tasks.referring import ReferringTask
from envs.tasks.registry import register_task
from envs.tasks.types import EpisodeSpec, State, TaskConfig
from human import Person
from language import Placed


@register_task("nl_reach", verb="reach")
class NLReach(ReferringTask, Reach):
    """Reach the object that a sentence names."""

    def __init__(
        self, config: TaskConfig, object_area: Sequence[float], num_worlds: int, person: Person | None = None
    ) -> None:
        if not config.kinds:
            raise ConfigError("task.kinds=[] must name at least one kind of sentence")
        super().__init__(config, object_area, num_worlds, person)

    def _draw(self, rng: Generator) -> EpisodeSpec:
        placed, nameable = self._nameable_scene(rng)
        return self.episode(placed, int(rng.choice(np.flatnonzero(nameable))), rng)

    def _each_in_turn(self, rng: Generator) -> list[EpisodeSpec]:
        placed, nameable = self._nameable_scene(rng)
        named = np.flatnonzero(nameable).tolist()
        return [self._pointed(self.episode(placed, referent, rng), rng) for referent in named]

    def episode(self, placed: Placed, referent: int, rng: Generator) -> EpisodeSpec:
        """The episode in which this object of the scene is named. Raises LanguageError where it cannot be."""
        instruction = self._describer.describe(placed.scene, referent, rng)
        sentence = self._say(instruction, rng)
        kind = self.kind_names.index(instruction.kind)
        return self._episode(placed, referent, kind, sentence)

    def relabel(self, placed: Placed, moments: State, rng: Generator) -> EpisodeSpec | None:
        """Names the object at which the gripper ended."""
        apart = np.linalg.norm(moments.objects[-1] - moments.gripper[-1], axis=1)
        nearest = int(apart.argmin())
        if apart[nearest] > self.config.success_radius or nearest == moments.referent[-1]:
            return None
        return self.episode(placed, nearest, rng)
