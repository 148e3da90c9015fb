"""NL reach gesture: words that fit two objects, and a finger too inaccurate to distinguish neighbours."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator

from conf.schema import ConfigError, did_you_mean
from envs.tasks.base import unfixed
from envs.tasks.object_layout import groups
from envs.tasks.reach_gesture import ReachGesture
from envs.tasks.registry import register_task
from envs.tasks.types import EpisodeSpec, TaskConfig
from human import Gesture, Person, visibility
from language import COLORS, NOUNS, SHAPES, Instruction, ObjectPhrase, Scene

SAID = {"color": [False, True], "shape": [True, False], "color_shape": [True, True]}  # whether noun and colour are said
SHOWING = ("this", "that")


@register_task("nl_reach_gesture", verb="reach")
class NLReachGesture(ReachGesture):
    """Two groups of objects stand apart, and in each the words ("that red one") fit exactly one.

    So the words leave two candidates, the finger one object and its neighbours, and both together a single object. Both
    groups are drawn alike, and the referent is drawn uniformly from the two candidates, or by `visibility` if one is
    hidden, so nothing else identifies it. Objects 0 and 1 of a scene are the candidates.
    """

    kind_names = tuple(SAID)

    def __init__(
        self, config: TaskConfig, object_area: Sequence[float], num_worlds: int, person: Person | None = None
    ) -> None:
        for kind in config.kinds:
            if kind not in SAID:
                raise ConfigError(f"task.kinds={kind} is not said in {config.name}" + did_you_mean(kind, SAID))
        if not config.kinds or config.min_objects < 2:
            raise ConfigError(
                f"task.name={config.name} needs task.kinds of {', '.join(SAID)} and task.min_objects of at least 2, "
                f"one in each group, not kinds={list(config.kinds)} and min_objects={config.min_objects}"
            )
        if len(config.objects):
            raise ConfigError(f"task.objects cannot be listed in {config.name}, which draws two groups alike")
        super().__init__(config, object_area, num_worlds, person)

    def _draw(self, rng: Generator) -> EpisodeSpec:
        kind = self.config.kinds[rng.integers(len(self.config.kinds))]
        scene = self._groups(SAID[kind], rng)
        seen = visibility(self._person.eyes, scene.positions, self.config.object_size)[:2]
        sentence = self._say(Instruction("reach", self._phrase(scene, kind, rng)), rng)
        return self._shown(scene, kind, sentence, int(rng.choice(2, p=seen / seen.sum())), rng)

    def _each_in_turn(self, rng: Generator) -> list[EpisodeSpec]:
        kind = self.config.kinds[rng.integers(len(self.config.kinds))]
        scene = self._groups(SAID[kind], rng)
        sentence = self._say(Instruction("reach", self._phrase(scene, kind, rng)), rng)
        return [self._shown(scene, kind, sentence, referent, rng) for referent in range(2)]

    def _shown(self, scene: Scene, kind: str, sentence: str, referent: int, rng: Generator) -> EpisodeSpec:
        gesture = self._person.show(scene.positions[referent], rng)
        return self._episode(unfixed(scene), referent, self.kind_names.index(kind), sentence, gesture)

    def _elsewhere(self, episode: EpisodeSpec, rng: Generator) -> tuple[int, Gesture] | None:
        other = 1 - episode.referent
        return other, self._person.show(episode.scene.positions[other], rng, always=True)

    def _phrase(self, scene: Scene, kind: str, rng: Generator) -> ObjectPhrase:
        says_noun, says_color = SAID[kind]
        noun = list(NOUNS)[scene.nouns[0]] if says_noun else None
        color = list(COLORS)[scene.colors[0]] if says_color else None
        return ObjectPhrase(noun, color, determiner=SHOWING[rng.integers(2)])

    def _groups(self, said: list[bool], rng: Generator) -> Scene:
        """A scene whose objects 0 and 1, one in each group, share the words' attributes; no other object does."""
        config = self.config
        count = int(rng.integers(config.min_objects, config.num_objects + 1))
        looks = np.stack((rng.integers(len(SHAPES), size=count), rng.integers(len(COLORS), size=count)), axis=1)
        looks[1, said] = looks[0, said]
        while (same := self._same(looks, said)).any():
            fresh = np.stack((rng.integers(len(SHAPES), size=count), rng.integers(len(COLORS), size=count)), axis=1)
            looks[2:][same] = fresh[2:][same]
        places = groups(rng, count, self._area, config.spacing, config.object_size / 2)
        nouns, colors = looks.T
        return Scene.from_arrays(nouns, colors, places, size=config.object_size, viewpoint=config.viewpoint)

    @staticmethod
    def _same(looks: np.ndarray, said: list[bool]) -> np.ndarray:
        """Which of objects 2, 3, ... the words would fit as well."""
        return (looks[2:, said] == looks[0, said]).all(1)
