"""Reach gesture: several objects, and a finger that points at the one to reach."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.random import Generator

from conf.schema import ConfigError
from envs.tasks.base import TRIES
from envs.tasks.reach import Reach
from envs.tasks.registry import register_task
from envs.tasks.types import EpisodeSpec, TaskConfig
from human import Gesture, NothingPointedAt, Person, Unreachable, pointed_object
from language import Instruction, ObjectPhrase, Placed

SPOTS = ("there", "here", "this", "that")  # words that carry no information without the finger


@register_task("reach_gesture", verb="reach")
class ReachGesture(Reach):
    """The person points in a random direction over the table; the referent is the object nearest to that line.

    The words ("reach there") do not identify it. Raises ConfigError without a person who points.
    """

    kind_names: tuple[str, ...] = SPOTS
    speaks = True

    def __init__(
        self, config: TaskConfig, object_area: Sequence[float], num_worlds: int, person: Person | None = None
    ) -> None:
        if person is None:
            raise ConfigError(f"task.name={config.name} needs a person who points: gesture=ray or gesture=camera")
        super().__init__(config, object_area, num_worlds, person)
        self._person: Person = person

    def _draw(self, rng: Generator) -> EpisodeSpec:
        placed = self._placed(rng)
        return self._spoken(placed, *self._somewhere(placed, rng), rng)

    def _each_in_turn(self, rng: Generator) -> list[EpisodeSpec]:
        placed = self._placed(rng)
        shown = [self._person.show(place, rng) for place in placed.scene.positions]
        return [self._spoken(placed, referent, gesture, rng) for referent, gesture in enumerate(shown)]

    def _spoken(self, placed: Placed, referent: int, gesture: Gesture, rng: Generator) -> EpisodeSpec:
        kind = int(rng.integers(len(SPOTS)))
        sentence = self._say(Instruction("reach", ObjectPhrase(determiner=SPOTS[kind])), rng)
        return self._episode(placed, referent, kind, sentence, gesture)

    def _elsewhere(self, episode: EpisodeSpec, rng: Generator) -> tuple[int, Gesture] | None:
        others = [k for k in range(len(episode.scene)) if k != episode.referent]
        if not others:
            return None
        other = int(rng.choice(others))
        return other, self._person.show(episode.scene.positions[other], rng, always=True)

    def _somewhere(self, placed: Placed, rng: Generator) -> tuple[int, Gesture]:
        """The object nearest to a line to some place over the table, and a finger that shows that place.

        Aims along which nothing lies are drawn again.
        """
        x0, x1, y0, y1 = self._area
        for _ in range(TRIES):
            aim = rng.uniform([x0, y0, 0.0], [x1, y1, self.config.object_size])
            exact = self._person.aim(aim)
            try:
                referent = int(pointed_object(exact.origin, exact.direction, placed.scene.positions))
            except NothingPointedAt:
                continue
            return referent, self._person.show(aim, rng, exact)
        raise Unreachable(f"no object of this scene can be pointed at from {exact.origin.tolist()}")
