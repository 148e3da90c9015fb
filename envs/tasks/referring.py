"""Tasks whose sentences refer to objects of the scene."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator

from conf.schema import ConfigError
from envs.tasks.base import Task
from envs.tasks.types import TaskConfig
from human import Person
from language import KINDS, MAX_WORDS, Describer, Instruction, Placed, Scene
from language.tokenizer import count_words

TRIES = 1000
PHRASES = 100  # pairs of phrases drawn at most until a sentence is short enough
WHOLE_SCENE_SPLITS = ("all", "train", "test_paraphrase")  # splits in which every object of a scene can be named


class ReferringTask(Task):
    """Scenes are drawn until every object can be named; the referent is then drawn uniformly from them.

    So only the words identify the referent. The splits test_composition and test_length name few objects, and draw
    uniformly from those.
    """

    kind_names: tuple[str, ...] = KINDS
    speaks = True

    def __init__(
        self, config: TaskConfig, object_area: Sequence[float], num_worlds: int, person: Person | None = None
    ) -> None:
        super().__init__(config, object_area, num_worlds, person)
        kinds = ["nested"] if self._split.name == "test_length" else config.kinds
        self._describer = Describer(kinds or KINDS, self._split)

    def _sentence(
        self, verb: str, scene: Scene, referent: int, target: int | None, rng: Generator
    ) -> tuple[str, Instruction]:
        """A sentence of at most MAX_WORDS for these objects, and its instruction."""
        for _ in range(PHRASES):
            phrase = self._describer.phrase(scene, referent, rng)
            goal = None if target is None else self._describer.phrase(scene, target, rng)
            instruction = Instruction(verb, phrase, goal)
            sentence = self._say(instruction, rng)
            if count_words(sentence) <= MAX_WORDS:
                return sentence, instruction
        raise ConfigError(f"task.kinds={list(self.config.kinds)} gives only sentences of more than {MAX_WORDS} words")

    def _nameable_scene(self, rng: Generator) -> tuple[Placed, np.ndarray]:
        """A scene, and (K,) bool whether each of its objects can be named."""
        for _ in range(TRIES):
            placed = self._placed(rng)
            nameable = self._describer.nameable(placed.scene)
            if nameable.all() if self.config.split in WHOLE_SCENE_SPLITS else nameable.any():
                return placed, nameable
        within = "" if self.config.split == "all" else f" in task.split={self.config.split}"
        raise ConfigError(
            f"task.kinds={list(self.config.kinds)} cannot name each of {self.config.num_objects} objects{within}"
        )
