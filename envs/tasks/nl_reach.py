"""NL reach: several objects, and one sentence that names the one to reach."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.random import Generator

from conf.schema import ConfigError
from envs.tasks.base import Episode, TaskConfig
from envs.tasks.reach import Reach
from language import Describer, say

TRIES = 1000


class NLReach(Reach):
    """Reach the object that a sentence names.

    Scenes are drawn until every object in them can be named, and the referent is then drawn evenly among them:
    so nothing but the words tells which one is meant.
    """

    def __init__(self, config: TaskConfig, object_area: Sequence[float], num_worlds: int) -> None:
        if not config.kinds:
            raise ConfigError("task.kinds=[] must name at least one kind of sentence")
        super().__init__(config, object_area, num_worlds)
        self.kind_names = tuple(config.kinds)
        self._describer = Describer(config.kinds)

    def draw(self, rng: Generator) -> Episode:
        for _ in range(TRIES):
            scene = self._scene(rng)
            if self._describer.nameable(scene).all():
                break
        else:
            raise ConfigError(
                f"task.kinds={list(self.config.kinds)} cannot name each of {self.config.num_objects} objects"
            )
        referent = int(rng.integers(len(scene)))
        instruction = self._describer.describe(scene, referent, rng)
        kind = self.kind_names.index(instruction.phrase.kind)
        return Episode(scene, referent, kind, say(instruction))
