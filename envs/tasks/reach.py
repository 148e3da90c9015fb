"""Reach: bring the gripper to an object, and hold it there; the object is named, pointed at, or both."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.errors import ConfigError, did_you_mean
from envs.tasks.shared.base import POINTING_TRIES, Task, register_task, unfixed
from envs.tasks.shared.geometry import groups
from envs.tasks.shared.task_config import TaskConfig
from envs.tasks.shared.types import NOTHING, Array, EpisodeSpec, State, StepOutcome, TaskTraits
from human import NothingPointedAt, Person, PointingGesture, Unreachable, pointed_object, visibility
from language import COLORS, KINDS, NOUNS, SHAPES, Instruction, ObjectPhrase, Placed, Scene

NEAR = 0.7  # of the radius: greatest height over an object's centre, so that there is room to its sides
SPOTS = ("there", "here", "this", "that")  # words that carry no information without the finger
SHOWING = ("this", "that")
SAID = {"color": [False, True], "shape": [True, False], "color_shape": [True, True]}  # whether noun and colour are said


def reaching_height(config: TaskConfig, clearance: float) -> float:
    """Metres over an object's centre at which a gripper is to reach it: `clearance` over its top, within the radius."""
    return min(config.object_size / 2 + clearance, NEAR * config.radius)


@register_task("reach", verb="reach")
class Reach(Task):
    """Reach the only object.

    The environment keeps the gripper above the `reaching_height` of objects on the table, so that it pushes none.

    Instruction: none.
    Success: the referent is the object nearest to the gripper, within `radius`, for `hold_steps` consecutive steps.
    Failure: wrong_object, after the same time at another object, so that trying all objects in turn does not pay.
    Reward terms: progress (metres nearer to the referent than a step ago), success, wrong_object and time.
    Config keys: radius, hold_steps.
    """

    terms = ("progress", "success", "wrong_object", "time")

    def _allocate(self, worlds: int) -> None:
        self._distance = np.zeros(worlds)
        self._held = np.zeros(worlds, np.int64)
        self._held_other = np.zeros(worlds, np.int64)

    def reset(self, worlds: NDArray[np.int64], state: State) -> None:
        self._distance[worlds] = self._distances(state)[worlds, state.referent[worlds]]
        self._held[worlds] = 0
        self._held_other[worlds] = 0

    def step(self, state: State) -> StepOutcome:
        distances = self._distances(state)
        nearest = distances.argmin(1)
        near = distances[self._rows, nearest] <= self.config.success_radius
        at_goal = near & (nearest == state.referent)
        self._held = np.where(at_goal, self._held + 1, 0)
        self._held_other = np.where(near & ~at_goal, self._held_other + 1, 0)
        success = self._held >= self.config.success_steps
        wrong_object = self._held_other >= self.config.success_steps
        distance = distances[self._rows, state.referent]
        progress, self._distance = self._distance - distance, distance
        terms = {
            "progress": progress,
            "success": success.astype(np.float64),
            "wrong_object": wrong_object.astype(np.float64),
            "time": np.ones_like(progress),
        }
        return StepOutcome(terms=terms, success=success, wrong_object=wrong_object, at_goal=at_goal)

    def _distances(self, state: State) -> Array:
        """(N, K) metres from the gripper; infinite where no object is shown."""
        offset = state.objects - state.gripper[:, None]
        return np.where(state.shown, np.sqrt((offset * offset).sum(-1)), np.inf)


@register_task("nl_reach", verb="reach")
class NLReach(Reach):
    """Reach the object that a sentence names.

    The referent is drawn uniformly from the objects that can be named, so only the words identify it.

    Instruction: "reach the red cube".
    Success: as of `Reach`.
    Failure: as of `Reach`: wrong_object.
    Reward terms: as of `Reach`: progress, success, wrong_object and time.
    Config keys: num_objects, kinds (at least one), varied, split, held_out, viewpoint, radius, hold_steps.
    """

    traits = TaskTraits(speaks=True)
    kind_names: tuple[str, ...] = KINDS

    def _configure(self, config: TaskConfig, person: Person | None) -> None:
        if not config.kinds:
            raise ConfigError("task.kinds=[] must name at least one kind of sentence")
        super()._configure(config, person)

    def _draw(self, rng: Generator) -> EpisodeSpec:
        placed, nameable = self._sentences.nameable_scene(lambda: self._placed(rng))
        return self.episode(placed, int(rng.choice(np.flatnonzero(nameable))), rng)

    def _each_in_turn(self, rng: Generator) -> list[EpisodeSpec]:
        placed, nameable = self._sentences.nameable_scene(lambda: self._placed(rng))
        named = np.flatnonzero(nameable).tolist()
        return [self._pointed(self.episode(placed, referent, rng), rng) for referent in named]

    def episode(self, placed: Placed, referent: int, rng: Generator) -> EpisodeSpec:
        """Return the episode in which this object of the scene is named. Raises LanguageError where it cannot be."""
        instruction = self._sentences.describe(self.verb, placed.scene, referent, rng)
        sentence = self._sentences.write(instruction, rng)
        kind = self.kind_names.index(instruction.kind)
        return self._episode(placed, referent=referent, kind=kind, sentence=sentence)

    def relabel(self, placed: Placed, moments: State, rng: Generator) -> EpisodeSpec | None:
        """Name the object at which the gripper ended."""
        apart = np.linalg.norm(moments.objects[-1] - moments.gripper[-1], axis=1)
        nearest = int(apart.argmin())
        if apart[nearest] > self.config.success_radius or nearest == moments.referent[-1]:
            return None
        return self.episode(placed, nearest, rng)


@register_task("reach_gesture", verb="reach")
class ReachGesture(Reach):
    """Reach the object that the person points at.

    The person points in a random direction over the table; the words do not identify the object.

    Instruction: "reach there", and a gesture.
    Success: as of `Reach`; the referent is the object nearest to the line of the finger.
    Failure: as of `Reach`: wrong_object.
    Reward terms: as of `Reach`: progress, success, wrong_object and time.
    Config keys: num_objects, radius, hold_steps; needs a person who points (gesture=ray or gesture=camera).
    """

    traits = TaskTraits(speaks=True)
    kind_names: tuple[str, ...] = SPOTS
    _person: Person

    def _configure(self, config: TaskConfig, person: Person | None) -> None:
        if person is None:
            raise ConfigError(f"task.name={config.name} needs a person who points: gesture=ray or gesture=camera")
        super()._configure(config, person)

    def _draw(self, rng: Generator) -> EpisodeSpec:
        placed = self._placed(rng)
        referent, gesture = self._somewhere(placed, rng)
        return self._spoken(placed, referent, gesture, rng)

    def _each_in_turn(self, rng: Generator) -> list[EpisodeSpec]:
        placed = self._placed(rng)
        shown = [self._person.show(place, rng) for place in placed.scene.positions]
        return [self._spoken(placed, referent, gesture, rng) for referent, gesture in enumerate(shown)]

    def _spoken(self, placed: Placed, referent: int, gesture: PointingGesture, rng: Generator) -> EpisodeSpec:
        """Return the episode of this gesture at the referent, with words that name nothing."""
        kind = int(rng.integers(len(SPOTS)))
        sentence = self._sentences.write(Instruction("reach", ObjectPhrase(determiner=SPOTS[kind])), rng)
        return self._episode(placed, referent=referent, kind=kind, sentence=sentence, gesture=gesture)

    def _elsewhere(self, episode: EpisodeSpec, rng: Generator) -> tuple[int, PointingGesture] | None:
        others = [k for k in range(len(episode.scene)) if k != episode.referent]
        if not others:
            return None
        other = int(rng.choice(others))
        return other, self._person.show(episode.scene.positions[other], rng, always=True)

    def _somewhere(self, placed: Placed, rng: Generator) -> tuple[int, PointingGesture]:
        """Draw the object nearest to a line to some place over the table, and a finger that shows that place.

        Aims along which nothing lies are drawn again.
        """
        x0, x1, y0, y1 = self._area
        for _ in range(POINTING_TRIES):
            aim = rng.uniform([x0, y0, 0.0], [x1, y1, self.config.object_size])
            exact = self._person.aim(aim)
            try:
                referent = int(pointed_object(exact.origin, exact.direction, placed.scene.positions))
            except NothingPointedAt:
                continue
            return referent, self._person.show(aim, rng, exact)
        raise Unreachable(f"no object of this scene can be pointed at from {exact.origin.tolist()}")


@register_task("nl_reach_gesture", verb="reach")
class NLReachGesture(ReachGesture):
    """Reach the object that words and finger together single out.

    Two groups of objects stand apart, and in each the words fit exactly one. So the words leave two candidates, the
    finger one object and its neighbours, and both together a single object. Both groups are drawn alike, and the
    referent is drawn uniformly from the two candidates, or by `visibility` if one is hidden, so nothing else identifies
    it. Objects 0 and 1 of a scene are the candidates.

    Instruction: "reach that red one", and a gesture.
    Success: as of `Reach`.
    Failure: as of `Reach`: wrong_object.
    Reward terms: as of `Reach`: progress, success, wrong_object and time.
    Config keys: num_objects and min_objects (at least 2), kinds (of `SAID`), radius; needs a person who points.
    """

    kind_names = tuple(SAID)

    def _configure(self, config: TaskConfig, person: Person | None) -> None:
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
        super()._configure(config, person)

    def _draw(self, rng: Generator) -> EpisodeSpec:
        kind = self.config.kinds[rng.integers(len(self.config.kinds))]
        scene = self._groups(SAID[kind], rng)
        seen = visibility(self._person.eyes, scene.positions, self.config.object_size)[:2]
        sentence = self._sentences.write(Instruction("reach", self._phrase(scene, kind, rng)), rng)
        referent = int(rng.choice(2, p=seen / seen.sum()))
        return self._shown(scene, kind=kind, sentence=sentence, referent=referent, rng=rng)

    def _each_in_turn(self, rng: Generator) -> list[EpisodeSpec]:
        kind = self.config.kinds[rng.integers(len(self.config.kinds))]
        scene = self._groups(SAID[kind], rng)
        sentence = self._sentences.write(Instruction("reach", self._phrase(scene, kind, rng)), rng)
        return [self._shown(scene, kind=kind, sentence=sentence, referent=one, rng=rng) for one in range(2)]

    def _shown(self, scene: Scene, *, kind: str, sentence: str, referent: int, rng: Generator) -> EpisodeSpec:
        """Return the episode with a gesture at the referent. kind: of the sentence."""
        gesture, number = self._person.show(scene.positions[referent], rng), self.kind_names.index(kind)
        return self._episode(unfixed(scene), referent=referent, kind=number, sentence=sentence, gesture=gesture)

    def _elsewhere(self, episode: EpisodeSpec, rng: Generator) -> tuple[int, PointingGesture] | None:
        other = 1 - episode.referent
        return other, self._person.show(episode.scene.positions[other], rng, always=True)

    def _phrase(self, scene: Scene, kind: str, rng: Generator) -> ObjectPhrase:
        """Draw the words for the two candidates."""
        says_noun, says_color = SAID[kind]
        noun = list(NOUNS)[scene.nouns[0]] if says_noun else None
        color = list(COLORS)[scene.colors[0]] if says_color else None
        return ObjectPhrase(noun, color, determiner=SHOWING[rng.integers(2)])

    def _groups(self, said: list[bool], rng: Generator) -> Scene:
        """Draw a scene whose objects 0 and 1, one in each group, share the words' attributes; no other object does."""
        config = self.config
        count = int(rng.integers(config.min_objects, config.num_objects + 1))
        looks = np.stack((rng.integers(len(SHAPES), size=count), rng.integers(len(COLORS), size=count)), axis=1)
        looks[1, said] = looks[0, said]
        while (same := self._same(looks, said)).any():
            fresh = np.stack((rng.integers(len(SHAPES), size=count), rng.integers(len(COLORS), size=count)), axis=1)
            looks[2:][same] = fresh[2:][same]
        places = groups(rng, count, area=self._area, spacing=config.spacing, height=config.object_size / 2)
        nouns, colors = looks.T
        return Scene.from_arrays(nouns, colors, places, size=config.object_size, viewpoint=config.viewpoint)

    @staticmethod
    def _same(looks: np.ndarray, said: list[bool]) -> np.ndarray:
        """Return which of objects 2, 3, ... the words would fit as well."""
        return (looks[2:, said] == looks[0, said]).all(1)


class ReachNext(NLReach):
    """Reach after another instruction. The object at which the gripper begins counts only after the gripper left it."""

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._first = np.full(worlds, NOTHING)  # the slot at which it begins, until it leaves it

    def reset(self, worlds: NDArray[np.int64], state: State) -> None:
        super().reset(worlds, state)
        distances = self._distances(state)[worlds]
        nearest = distances.argmin(1)
        self._first[worlds] = np.where(distances.min(1) <= self.config.success_radius, nearest, NOTHING)

    def _distances(self, state: State) -> Array:
        """With devices, see-through targets do not count: none is a referent, and objects may stand at their places."""
        distances = super()._distances(state)
        return np.where(state.movable, distances, np.inf) if self.config.devices else distances

    def step(self, state: State) -> StepOutcome:
        distances = self._distances(state)
        stays = (distances.argmin(1) == self._first) & (distances.min(1) <= self.config.success_radius)
        self._first = np.where(stays, self._first, NOTHING)
        self._held_other = np.where(stays, -1, self._held_other)
        return super().step(state)
