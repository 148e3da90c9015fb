"""NL reach: several objects, and one sentence that names the one to reach."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator

from conf.schema import ConfigError
from envs.tasks.base import Episode, TaskConfig
from envs.tasks.reach import Reach
from human import Person
from language import KINDS, Describer, Placed

TRIES = 1000
EVERYBODY = ("all", "train", "test_paraphrase")  # splits in which every object of a scene can be named


class NLReach(Reach):
    """Reach the object that a sentence names.

    Scenes are drawn until every object in them can be named, and the referent is then drawn evenly among them:
    so nothing but the words tells which one is meant. The splits test_composition and test_length, which can name
    but few, draw evenly among those.
    """

    kind_names = KINDS
    speaks = True

    def __init__(
        self, config: TaskConfig, object_area: Sequence[float], num_worlds: int, person: Person | None = None
    ) -> None:
        if not config.kinds:
            raise ConfigError("task.kinds=[] must name at least one kind of sentence")
        super().__init__(config, object_area, num_worlds, person)
        kinds = ["nested"] if self._split.name == "test_length" else config.kinds
        self._describer = Describer(kinds, self._split)

    def _draw(self, rng: Generator) -> Episode:
        placed, nameable = self._nameable_scene(rng)
        return self.episode(placed, int(rng.choice(np.flatnonzero(nameable))), rng)

    def _each_in_turn(self, rng: Generator) -> list[Episode]:
        placed, nameable = self._nameable_scene(rng)
        named = np.flatnonzero(nameable).tolist()
        return [self._pointed(self.episode(placed, referent, rng), rng) for referent in named]

    def episode(self, placed: Placed, referent: int, rng: Generator) -> Episode:
        """The episode in which this object of the scene is named. Raises LanguageError where it cannot be."""
        instruction = self._describer.describe(placed.scene, referent, rng)
        sentence = self._say(instruction, rng)
        kind = self.kind_names.index(instruction.kind)
        return self._episode(placed, referent, kind, sentence)

    def _nameable_scene(self, rng: Generator) -> tuple[Placed, np.ndarray]:
        """A scene, and which of its objects can be named, (K,) bool."""
        for _ in range(TRIES):
            placed = self._placed(rng)
            nameable = self._describer.nameable(placed.scene)
            if nameable.all() if self.config.split in EVERYBODY else nameable.any():
                return placed, nameable
        within = "" if self.config.split == "all" else f" in task.split={self.config.split}"
        raise ConfigError(
            f"task.kinds={list(self.config.kinds)} cannot name each of {self.config.num_objects} objects{within}"
        )
