"""Sort: bring all objects of a colour to a marked place, one by one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.errors import ConfigError
from envs.tasks.pick_and_place import PickAndPlace
from envs.tasks.shared.base import register_task
from envs.tasks.shared.free_places import FINE_COLUMNS, LEVEL, stands_apart, ways_to
from envs.tasks.shared.geometry import length
from envs.tasks.shared.manipulation import SCENES
from envs.tasks.shared.task_config import TaskConfig
from envs.tasks.shared.types import Array, EpisodeSpec, GivenInstruction, State
from human import Person
from language import COLORS, NOUNS, Instruction, ObjectPhrase, Placed, Scene
from language.spacing import keep_apart
from language.verbs import EVERY

SORTED = 0.13  # metres beside a marked place within which an object counts as brought to it
ASIDE = 0.1  # metres from a marked place to the spots around it
ANGLES = np.radians([90, 270, 30, 150, 210, 330])  # of them, from x
SPOTS = np.concatenate((np.zeros((1, 2)), ASIDE * np.stack((np.cos(ANGLES), np.sin(ANGLES)), axis=1)))
APART = 0.09  # metres between the middle of a free spot and all other objects
OUTSIDE = 100.0  # ... for which it is worth to lie where objects may stand
ALIKE = (2, 3)  # least and greatest number of objects that have the colour that is said
AROUND = 0.2  # metres between the marked place and all objects as an episode begins
BEGUN = 0.5  # share of the episodes with a curriculum that begin with some of the objects sorted
SPREAD = 0.01  # metres about its spot, standard deviation, at which such an object lies
DRAWN = 60  # places that are drawn for the objects of a scene
FARTHEST = "farthest from"  # names what is left to be sorted, where the task's kinds of phrases do not


class Spots:
    """The middle of a marked place, and six spots around it.

    Args:
        area: x0, x1, y0, y1 of the objects' centres, metres.
        size: of an object, metres.
    """

    def __init__(self, area: Sequence[float], size: float) -> None:
        self._low, self._high = np.reshape(area, (2, 2)).T
        self._height = size / 2

    def inside(self, marks: Array) -> NDArray[np.bool_]:
        """(..., 7) which spots at marked places lie where objects may stand. marks: (..., 2 or more) metres."""
        spots = marks[..., None, :2] + SPOTS
        return np.all((spots >= self._low) & (spots <= self._high), axis=-1)

    def free(self, objects: Array, real: NDArray[np.bool_], marks: Array) -> Array:
        """(N, K, 3) for each object, the middle if it is free of all others, else the nearest spot that is; metres.

        objects: (N, K, 3) metres. real: (N, K), what stands there. marks: (N, 3) metres.
        """
        spots = marks[:, None, :2] + SPOTS
        ways = ways_to(spots, objects, real, APART) + OUTSIDE * ~self.inside(marks)[:, None]
        ways[..., 0] -= ASIDE  # by which another spot is nearer, at most
        best = spots[np.arange(len(spots))[:, None], ways.argmin(2)]
        return np.concatenate((best, np.full((*best.shape[:2], 1), self._height)), axis=2)


def is_sorted(places: Array, marks: Array, size: float) -> NDArray[np.bool_]:
    """(...) whether objects of this size lie on the table at a marked place. places, marks: (..., 3); metres."""
    level = places[..., 2] < size / 2 + LEVEL
    return level & (length((places - marks)[..., :2]) <= SORTED)


@register_task("nl_sort", verb="sort")
class Sort(PickAndPlace):
    """Bring every object of a colour to a marked place, one by one.

    The policy is given a step at a time: "sort the leftmost red cube to the transparent green cube". After its success
    the next object is named, in the world as it is, until all of the colour have been brought.

    Instruction: "sort every red cube to the transparent green cube".
    Success: of a step: the referent has been picked up and lies on the table, within `SORTED` of the marked place and
        beside all others, released and at rest, for `hold_steps` steps. That of the episode: all steps.
    Failure: wrong_object, once another object has been moved.
    Reward terms: approach, grasp, lift, transport and release as of `PickAndPlace`, with the nearest of `Spots` that
        was free as the step began, and is observed, as the target; success (of each step), wrong_object,
        wrong_target and time.
    Config keys: num_objects and min_objects (at least 3), num_targets (1), kinds, max_steps (of each step).
    """

    traits = replace(PickAndPlace.traits, continues=True, stepwise=True)
    columns = FINE_COLUMNS

    def _configure(self, config: TaskConfig, person: Person | None) -> None:
        if len(config.objects) or config.min_objects < ALIKE[1] or config.num_targets != 1:
            raise ConfigError(
                f"task.min_objects={config.min_objects} must be at least {ALIKE[1]}, "
                f"task.num_targets={config.num_targets} must be 1, and task.objects empty, in task.name={config.name}"
            )
        self._spots = Spots(self._area, config.object_size)
        super()._configure(config, person)

    @property
    def most_instructions(self) -> int:
        return 2 * self.config.num_objects  # an object that was moved away again is sorted once more

    # ---- evaluating

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._free = np.zeros((worlds, self.config.slots, 3))  # the free spot for each object

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        marks = state.objects[worlds, state.target[worlds]]
        self._free[worlds] = self._spots.free(state.objects[worlds], state.movable[worlds], marks)
        super()._reset_memory(worlds, state)

    def seen(self, state: State) -> Array:
        offset = self._free - state.objects
        return np.concatenate((offset, offset), axis=-1)

    def described(self, episode: EpisodeSpec) -> Array:
        scene = episode.scene
        free = self._spots.free(scene.positions[None], ~scene.targets[None], scene.positions[scene.targets])[0]
        return np.concatenate((free - scene.positions,) * 2, axis=-1)

    def _goal(self, state: State) -> Array:
        return self._free[self._rows, state.referent]

    def _is_near_goal(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether the referent lies at the marked place, beside all others."""
        mark, size = state.objects[self._rows, state.target], self.config.object_size
        return is_sorted(self._referent(state), mark, size) & stands_apart(state, state.movable, size)

    def relabel(self, placed: Placed, moments: State, rng: Generator) -> EpisodeSpec | None:
        """Return None: the place that an object was brought to may have no room for the others."""
        return None

    # ---- drawing

    def _scene(self, rng: Generator) -> Scene:
        """Draw loose objects, some of the same colour, and last what marks the place, in a colour of its own."""
        config = self.config
        count = self._draw_count(rng)
        alike = int(rng.integers(ALIKE[0], ALIKE[1] + 1))
        said, marked, *rest = rng.permutation(len(COLORS)).tolist()
        colors = [*[said] * alike, *rng.choice(rest, size=count - alike).tolist(), marked]
        nouns = self._nouns[rng.integers(len(self._nouns), size=count + 1)]
        targets = np.arange(count + 1) == count
        places = self._places_around(count, rng)
        return Scene.from_arrays(nouns, colors, places, config.object_size, targets=targets, viewpoint=config.viewpoint)

    def _places_around(self, count: int, rng: Generator) -> Array:
        """(count + 1, 3) where objects stand, and the marked place, which has spots for all that are alike; metres."""
        low, high = np.reshape(self._area, (2, 2)).T
        for _ in range(SCENES):
            mark = rng.uniform(low, high)
            drawn = rng.uniform(low, high, (DRAWN, 2))
            away = drawn[length(drawn - mark) >= AROUND]
            places = keep_apart([(x, y) for x, y in away.tolist()], count, self.config.spacing)
            if len(places) == count and self._spots.inside(mark).sum() >= ALIKE[1]:
                height = np.full((count + 1, 1), self.config.object_size / 2)
                return np.concatenate((np.array([*places, mark]), height), axis=1)
        raise ConfigError(
            f"task.num_objects={count} objects do not fit workspace.object_area={list(self._area)}, {AROUND} metres "
            f"from a place where task.name={self.config.name} has room for them"
        )

    def _draw_scene(self, rng: Generator) -> tuple[Placed, NDArray[np.bool_]]:
        """Draw a scene in which a first step can be said; others need not be nameable yet."""
        for _ in range(SCENES):
            placed = self._placed(rng)
            if self.config.curriculum.share > 0 and rng.random() < BEGUN:
                placed = placed._replace(scene=self._begun_scene(placed, rng))
            nameable = self._sentences.nameable(placed.scene)
            if nameable[placed.scene.targets].all() and (self._movable(placed) & nameable).any():
                return placed, nameable
        raise ConfigError(f"task.kinds={list(self.config.kinds)} cannot name what task.name={self.config.name} sorts")

    def _begun_scene(self, placed: Placed, rng: Generator) -> Scene:
        """Return the scene with some of the objects of a colour at spots of the marked place, but not all."""
        scene = placed.scene
        group = np.flatnonzero(_alike(scene, self._one_of(self._movable(placed), rng)))
        mark, places = scene.positions[scene.targets], scene.positions.copy()
        for index in rng.permutation(group)[: rng.integers(1, len(group))]:
            aside = np.append(rng.normal(0.0, SPREAD, 2), 0.0)
            places[index] = self._spots.free(places[None], ~scene.targets[None], mark)[0, index] + aside
        return scene.moved(places)

    def _movable(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) what shares its colour with another object, and has not been sorted yet."""
        scene = placed.scene
        loose, colors, mark = super()._movable(placed), scene.colors, scene.positions[scene.targets.argmax()]
        left = loose & ~is_sorted(scene.positions, mark, self.config.object_size)
        return left & ((loose & (colors[:, None] == colors)).sum(1) >= ALIKE[0])

    def episode(self, placed: Placed, referent: int, target: int | None, rng: Generator) -> EpisodeSpec:
        """Return the episode that sorts every object of the referent's colour, the referent first."""
        assert target is not None
        step, instruction = self._sentence(placed.scene, referent, target, rng)
        whole = replace(instruction, phrase=_every(placed.scene, referent))
        kind, sentence = self.kind_names.index(instruction.kind), self._sentences.write(whole, rng)
        episode = self._episode(placed, referent=referent, kind=kind, sentence=sentence)
        heard = self._sentences.heard(step) or step
        return replace(episode, heard=heard, target=target, goals=self.possible_goals(placed))

    def next_instruction(
        self,
        scene: Scene,
        held: int,
        rng: Generator,
        *,
        moved: Array | None = None,
        last: GivenInstruction | None = None,
    ) -> GivenInstruction | None:
        """Return the step for another object of the colour of the last one, which is not at the marked place yet."""
        assert last is not None
        assert last.target is not None
        left = _alike(scene, last.referent) & ~is_sorted(
            scene.positions, scene.positions[last.target], self.config.object_size
        )
        if not left.any():
            return None
        named = left & self._sentences.nameable(scene)
        if named.any():
            referent = self._one_of(named, rng)
            step, instruction = self._sentence(scene, referent, last.target, rng)
        else:
            away = length((scene.positions - scene.positions[last.target])[:, :2])
            referent = int(np.where(left, away, 0.0).argmax())
            instruction = self._farthest(scene, referent, last.target)
            step = self._sentences.write(instruction, rng)
        kind = self.kind_names.index(instruction.kind)
        heard = self._sentences.heard(step) or step
        return GivenInstruction(kind=kind, referent=referent, target=last.target, sentence=last.sentence, heard=heard)

    def _farthest(self, scene: Scene, referent: int, target: int) -> Instruction:
        """Return the step for what stands farthest from the marked place, whose colour no other object has."""
        goal = ObjectPhrase(color=list(COLORS)[scene.colors[target]])
        colour = list(COLORS)[scene.colors[referent]]
        return Instruction(self.verb, ObjectPhrase(color=colour, relation=FARTHEST, anchors=(goal,)), goal)


def _alike(scene: Scene, referent: int) -> NDArray[np.bool_]:
    """(K,) which real objects have the colour of the referent."""
    return ~scene.targets & (scene.colors == scene.colors[referent])


def _every(scene: Scene, referent: int) -> ObjectPhrase:
    """ "every red cube", or "every red object" where other things of this colour are no cubes."""
    alike = _alike(scene, referent)
    same = (scene.nouns[alike] == scene.nouns[referent]).all()
    noun = list(NOUNS)[scene.nouns[referent]] if same else None
    return ObjectPhrase(noun, list(COLORS)[scene.colors[referent]], determiner=EVERY)
