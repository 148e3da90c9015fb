"""The sentences of a task's episodes: names for objects, wordings, and what the policy reads."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.errors import ConfigError
from envs.tasks.shared.task_config import TaskConfig
from language import (
    KINDS,
    MAX_WORDS,
    Describer,
    Instruction,
    LanguageError,
    ObjectPhrase,
    Placed,
    Scene,
    Wording,
    parse,
    say,
)
from language.tokenizer import count_words

SCENE_TRIES = 1000  # scenes drawn at most until their objects can be named
PHRASE_TRIES = 100  # pairs of phrases drawn at most until a sentence is short enough
WHOLE_SCENE_SPLITS = ("all", "train", "test_paraphrase")  # splits in which every object of a scene can be named


class SentenceWriter:
    """Writes sentences within the split of a task's config, and in the kinds of phrases that it lists."""

    def __init__(self, config: TaskConfig) -> None:
        self._config, self._split = config, config.sentence_split()
        varied = config.varied or self._split.name == "test_paraphrase"
        self._wording = Wording(self._split, MAX_WORDS) if varied else None

    @cached_property
    def _describer(self) -> Describer:
        kinds = ["nested"] if self._split.name == "test_length" else self._config.kinds
        return Describer(kinds or KINDS, self._split)

    def write(self, instruction: Instruction, rng: Generator) -> str:
        """Return the standard sentence of the instruction or, with `task.varied`, one in random words."""
        if self._wording is None:
            return say(instruction)
        try:
            return self._wording.say(instruction, rng)
        except LanguageError as error:
            raise ConfigError(f"task.split={self._config.split}: {error}; hold out a template of reach") from None

    def heard(self, sentence: str) -> str | None:
        """Return the sentence as the policy reads it; None: as it is said."""
        return say(parse(sentence)) if sentence and self._config.rephrased else None

    def describe(self, verb: str, scene: Scene, referent: int, rng: Generator) -> Instruction:
        """Return an instruction about the referent alone. Raises LanguageError where no words name it."""
        return self._describer.describe(scene, referent, rng, verb)

    def instruct(
        self, verb: str, scene: Scene, *, referent: int, target: int | None, rng: Generator
    ) -> tuple[str, Instruction]:
        """Return a sentence of at most MAX_WORDS for these objects of the scene, and its instruction."""
        for _ in range(PHRASE_TRIES):
            phrase: ObjectPhrase = self._describer.phrase(scene, referent, rng)
            goal = None if target is None else self._describer.phrase(scene, target, rng)
            instruction = Instruction(verb, phrase, goal)
            sentence = self.write(instruction, rng)
            if count_words(sentence) <= MAX_WORDS:
                return sentence, instruction
        kinds = list(self._config.kinds)
        raise ConfigError(f"task.kinds={kinds} gives only sentences of more than {MAX_WORDS} words")

    def nameable(self, scene: Scene) -> NDArray[np.bool_]:
        """(K,) whether each object of the scene can be named."""
        return self._describer.nameable(scene)

    def nameable_scene(self, draw: Callable[[], Placed]) -> tuple[Placed, NDArray[np.bool_]]:
        """Return a scene, drawn until its objects can be named, and (K,) whether each of them can be.

        Each object must be nameable, so that nothing but words identifies the referent. The splits test_composition and
        test_length name few objects; there, one is enough.
        """
        for _ in range(SCENE_TRIES):
            placed = draw()
            nameable = self.nameable(placed.scene)
            if nameable.all() if self._config.split in WHOLE_SCENE_SPLITS else nameable.any():
                return placed, nameable
        within = "" if self._config.split == "all" else f" in task.split={self._config.split}"
        raise ConfigError(
            f"task.kinds={list(self._config.kinds)} cannot name each of {self._config.num_objects} objects{within}"
        )
