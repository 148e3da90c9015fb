"""Reach: bring the gripper to an object, and hold it there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from conf.schema import ConfigError, did_you_mean
from envs.tasks.base import Array, Episode, Outcome, State, TaskConfig, Turn
from envs.tasks.layout import scatter
from human import Gesture, Person, Unreachable
from language import COLORS, NOUNS, Instruction, LanguageError, Placed, Scene, Wording, parse, say

T = TypeVar("T")
TRIES = 200
TURNS = (4, 16)  # control steps before which a finger that moves on does so


def loose(scene: Scene) -> Placed:
    """The scene with nothing turned or held in place."""
    return Placed(scene, np.zeros(len(scene)), np.zeros(len(scene), bool))


class Reach:
    """One object, no words.

    Success: the referent is the object nearest to the gripper, within `radius`, for `hold_steps` steps running.
    As long at another object is a failure, so trying them all in turn never pays.
    Terms: progress (metres nearer to the referent than a step ago), success, wrong_object and time (1 each step).
    """

    terms = ("progress", "success", "wrong_object", "time")
    kind_names: tuple[str, ...] = ("none",)
    speaks = False  # are there words?

    def __init__(
        self, config: TaskConfig, object_area: Sequence[float], num_worlds: int, person: Person | None = None
    ) -> None:
        for name in config.reward:
            if name not in self.terms:
                raise ConfigError(f"task.reward.{name} is not a known term" + did_you_mean(name, self.terms))
        if not config.kinds and config.num_objects > 1 and person is None:
            raise ConfigError(
                f"task.num_objects={config.num_objects} must be 1 in a task without words, "
                "or nothing would tell which object is meant; try task=nl_reach or task=reach_gesture"
            )
        if person is not None and person.config.switch and type(self)._elsewhere is Reach._elsewhere:
            raise ConfigError(
                f"gesture.switch={person.config.switch} needs words that fit another object as well, and those of "
                f"task.name={config.name} do not; take reach_gesture or nl_reach_gesture"
            )
        self.config, self._area, self._person = config, object_area, person
        self._split = config.says()
        self._wording = Wording(self._split) if config.varied or self._split.name == "test_paraphrase" else None
        self._layout = config.objects.layout(config.object_size)
        self._distance = np.zeros(num_worlds)
        self._held = np.zeros(num_worlds, np.int64)
        self._held_other = np.zeros(num_worlds, np.int64)
        self._rows = np.arange(num_worlds)

    @property
    def points(self) -> bool:
        """Whether a person points at the referent."""
        return self._person is not None

    @property
    def bodies(self) -> tuple[int, int, int]:
        """How many objects an episode shows at most that are free, fixed, and see-through."""
        specs = self._layout.specs if self._layout else ()
        targets = sum(spec.role == "target" for spec in specs)
        fixed = sum(spec.role == "real" and spec.fixed for spec in specs)
        return self.config.num_objects - fixed - targets, fixed, targets

    def draw(self, rng: Generator) -> Episode:
        """A fresh episode for one world, with what the person shows in it. All chance comes from rng."""
        return self._tried(lambda: self._pointed(self._draw(rng), rng))

    def each_in_turn(self, rng: Generator) -> list[Episode]:
        """One scene, and an episode for each of its objects that words or finger can tell from the others."""
        return self._tried(lambda: self._each_in_turn(rng))

    def _each_in_turn(self, rng: Generator) -> list[Episode]:
        """The same, but raises Unreachable where the person cannot show one of them."""
        return [self._pointed(self._draw(rng), rng)]

    def _tried(self, draw: Callable[[], T]) -> T:
        """What `draw` gives, once the person can show all that is in it."""
        for _ in range(TRIES):
            try:
                return draw()
            except Unreachable:
                continue
        area = list(self._area)
        raise ConfigError(f"task.name={self.config.name}: the person cannot point into workspace.object_area={area}")

    def _draw(self, rng: Generator) -> Episode:
        """The scene, its referent and the words. Raises Unreachable where the person cannot show it."""
        placed = self._placed(rng)
        return self._episode(placed, referent=0, kind=0, sentence="")

    def _pointed(self, episode: Episode, rng: Generator) -> Episode:
        """The episode with a finger that shows the referent, and sometimes moves on to another."""
        person = self._person
        if person is None:
            return episode
        if episode.gesture is None:
            episode = replace(episode, gesture=person.show(episode.scene.positions[episode.referent], rng))
        assert episode.gesture is not None
        if rng.random() >= person.config.switch or not episode.gesture.shown:
            return episode
        other, at = self._elsewhere(episode, rng), int(rng.integers(*TURNS))
        return episode if other is None else replace(episode, turn=Turn(at, *other))

    def _say(self, instruction: Instruction, rng: Generator) -> str:
        """The instruction in our own words, or in drawn ones where the config wants those."""
        if self._wording is None:
            return say(instruction)
        try:
            return self._wording.say(instruction, rng)
        except LanguageError as error:
            raise ConfigError(f"task.split={self.config.split}: {error}; hold out a template of reach") from None

    def _episode(
        self, placed: Placed, referent: int, kind: int, sentence: str, gesture: Gesture | None = None
    ) -> Episode:
        """These objects, one of which is meant, with what the policy hears of the sentence."""
        heard = say(parse(sentence)) if sentence and self.config.rephrased else None
        return Episode(placed.scene, referent, kind, sentence, heard, placed.yaw, placed.fixed, gesture)

    def _elsewhere(self, episode: Episode, rng: Generator) -> tuple[int, Gesture] | None:
        """Another object that the same words can mean, and how the person points at it; none: there is no other."""
        return None

    def _placed(self, rng: Generator) -> Placed:
        """The listed objects where there are any, else a scene of the task's own."""
        if self._layout is None:
            scene = self._scene(rng)
            return loose(scene)
        try:
            return self._layout.draw(rng, self.config.spacing)
        except LanguageError as error:
            raise ConfigError(f"task.objects: {error}") from None

    def _scene(self, rng: Generator) -> Scene:
        config = self.config
        count = config.num_objects
        if config.min_objects < count:
            count = int(rng.integers(config.min_objects, count + 1))
        places = scatter(rng, count, self._area, config.spacing, config.object_size / 2)
        nouns, colors = rng.integers(len(NOUNS), size=count), rng.integers(len(COLORS), size=count)
        return Scene.from_arrays(nouns, colors, places, size=config.object_size, viewpoint=config.viewpoint)

    def reset(self, worlds: NDArray[np.int64], state: State) -> None:
        """Start these worlds' episodes anew, or go on with another referent."""
        self._distance[worlds] = self._distances(state)[worlds, state.referent[worlds]]
        self._held[worlds] = 0
        self._held_other[worlds] = 0

    def step(self, state: State) -> Outcome:
        """Judge one control step of all worlds."""
        distances = self._distances(state)
        nearest = distances.argmin(1)
        near = distances[self._rows, nearest] <= self.config.radius
        at_goal = near & (nearest == state.referent)
        self._held = np.where(at_goal, self._held + 1, 0)
        self._held_other = np.where(near & ~at_goal, self._held_other + 1, 0)
        success = self._held >= self.config.hold_steps
        wrong_object = self._held_other >= self.config.hold_steps
        distance = distances[self._rows, state.referent]
        progress, self._distance = self._distance - distance, distance
        terms = {
            "progress": progress,
            "success": success.astype(np.float64),
            "wrong_object": wrong_object.astype(np.float64),
            "time": np.ones_like(progress),
        }
        return Outcome(terms, success, wrong_object, at_goal)

    def _distances(self, state: State) -> Array:
        """(N, K) metres from the gripper; infinite where no object is shown."""
        offset = state.objects - state.gripper[:, None]
        return np.where(state.shown, np.sqrt((offset * offset).sum(-1)), np.inf)
