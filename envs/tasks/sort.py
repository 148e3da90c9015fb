"""Sort: bring every object of a colour to a marked place, one after another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from conf.schema import ConfigError
from envs.tasks.free_places import FINE_COLUMNS, stands_apart
from envs.tasks.geometry import length
from envs.tasks.movable_objects import SCENES
from envs.tasks.pick_and_place import PickAndPlace
from envs.tasks.registry import register_task
from envs.tasks.spots import Spots, is_sorted
from envs.tasks.types import Array, EpisodeSpec, Said, State, TaskConfig
from human import Person
from language import COLORS, NOUNS, Instruction, ObjectPhrase, Placed, Scene
from language.spacing import keep_apart
from language.verbs import EVERY

ALIKE = (2, 3)  # least and greatest number of objects that have the colour that is said
AROUND = 0.2  # metres between the marked place and all objects as an episode begins
BEGUN = 0.5  # share of the episodes with a curriculum that begin with some of the objects sorted
SPREAD = 0.01  # metres about its spot, standard deviation, at which such an object lies
DRAWN = 60  # places that are drawn for the objects of a scene
FARTHEST = "farthest from"  # names what is left to be sorted, where the task's kinds of phrases do not


@register_task("nl_sort", verb="sort")
class Sort(PickAndPlace):
    """ "sort every red cube to the transparent green cube": an episode is a chain of steps, one for each red cube.

    The policy is given the step: "sort the leftmost red cube to the transparent green cube". After its success the next
    object is named, in the world as it is, until all of the colour have been brought.

    Success of a step: the referent has been picked up and lies on the table, within `SORTED` of the marked place and
    beside all others, released and at rest, for `hold_steps` steps. That of the episode: all steps.
    Potentials: those of pick and place. The target is the nearest of `Spots` that was free as the step began, which is
    observed.
    """

    columns = FINE_COLUMNS
    potentials = PickAndPlace.potentials
    continues = True
    stepwise = True

    def __init__(
        self, config: TaskConfig, object_area: Sequence[float], num_worlds: int, person: Person | None = None
    ) -> None:
        if len(config.objects) or config.min_objects < ALIKE[1] or config.num_targets != 1:
            raise ConfigError(
                f"task.min_objects={config.min_objects} must be at least {ALIKE[1]}, "
                f"task.num_targets={config.num_targets} must be 1, and task.objects empty, in task.name={config.name}"
            )
        self._spots = Spots(object_area, config.object_size)
        super().__init__(config, object_area, num_worlds, person)

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
        """None: where an object was brought, there may be no room for the others."""
        return None

    # ---- drawing

    def _scene(self, rng: Generator) -> Scene:
        """Loose objects, some of the same colour, and as the last one what marks the place, in a colour of its own."""
        config = self.config
        count = int(rng.integers(config.min_objects, config.num_objects + 1))
        alike = int(rng.integers(ALIKE[0], ALIKE[1] + 1))
        said, marked, *rest = rng.permutation(len(COLORS)).tolist()
        colors = [*[said] * alike, *rng.choice(rest, size=count - alike).tolist(), marked]
        nouns = self._nouns[rng.integers(len(self._nouns), size=count + 1)]
        targets = np.arange(count + 1) == count
        places = self._places_around(count, rng)
        return Scene.from_arrays(nouns, colors, places, config.object_size, targets, config.viewpoint)

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
        """A scene in which a first step can be said; others need not be nameable yet."""
        for _ in range(SCENES):
            placed = self._placed(rng)
            if self.config.curriculum.share > 0 and rng.random() < BEGUN:
                placed = placed._replace(scene=self._begun_scene(placed, rng))
            nameable = self._describer.nameable(placed.scene)
            if nameable[placed.scene.targets].all() and (self._movable(placed) & nameable).any():
                return placed, nameable
        raise ConfigError(f"task.kinds={list(self.config.kinds)} cannot name what task.name={self.config.name} sorts")

    def _begun_scene(self, placed: Placed, rng: Generator) -> Scene:
        """The scene with some of the objects of a colour at spots of the marked place, but not all."""
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
        assert target is not None
        step, instruction = self._sentence(self.verb, placed.scene, referent, target, rng)
        whole = replace(instruction, phrase=_every(placed.scene, referent))
        episode = self._episode(placed, referent, self.kind_names.index(instruction.kind), self._say(whole, rng))
        heard = self._heard(step) or step
        return replace(episode, heard=heard, target=target, goals=self._possible_goals(placed))

    def next_instruction(
        self, scene: Scene, held: int, rng: Generator, moved: Array | None = None, last: Said | None = None
    ) -> Said | None:
        """The step for another object of the colour of the last one, which is not at the marked place yet."""
        assert last is not None
        assert last.target is not None
        left = _alike(scene, last.referent) & ~is_sorted(
            scene.positions, scene.positions[last.target], self.config.object_size
        )
        if not left.any():
            return None
        named = left & self._describer.nameable(scene)
        if named.any():
            referent = self._one_of(named, rng)
            step, instruction = self._sentence(self.verb, scene, referent, last.target, rng)
        else:
            away = length((scene.positions - scene.positions[last.target])[:, :2])
            referent = int(np.where(left, away, 0.0).argmax())
            instruction = self._farthest(scene, referent, last.target)
            step = self._say(instruction, rng)
        kind = self.kind_names.index(instruction.kind)
        return Said(kind, referent, last.target, last.sentence, self._heard(step) or step)

    def _farthest(self, scene: Scene, referent: int, target: int) -> Instruction:
        """The step for what stands farthest from the marked place, whose colour no other object has."""
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
