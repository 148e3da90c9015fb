"""The base class of tasks, and the table that they enter by decorator."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.errors import ConfigError, did_you_mean
from envs.sim.workspace import Fitting, WorkspaceConfig
from envs.tasks.shared.fittings import FittingStarts, SceneFittings
from envs.tasks.shared.geometry import scatter
from envs.tasks.shared.sentences import SentenceWriter
from envs.tasks.shared.task_config import TaskConfig, check_terms
from envs.tasks.shared.types import (
    Column,
    EpisodeSpec,
    GestureSwitch,
    GivenInstruction,
    State,
    StepOutcome,
    TaskTraits,
)
from human import Person, PointingGesture, Unreachable
from language import COLORS, FITTINGS, NOUNS, SHAPES, VERBS, LanguageError, Placed, Scene
from language.errors import check_known

POINTING_TRIES = 200  # episodes drawn at most until the person can point at their objects
SWITCH_STEPS = (4, 16)  # the control step before which a finger switches to another object lies in this range
T = TypeVar("T")
TaskClass = TypeVar("TaskClass", bound="type[Task]")

# ---- the table of tasks

TASKS: dict[str, type[Task]] = {}  # the class of each `name` in conf/task/*.yaml
TASK_VERBS: dict[str, str] = {}  # the key of `language.VERBS` for its sentences


def register_task(*names: str, verb: str) -> Callable[[TaskClass], TaskClass]:
    """Class decorator that registers a task. A class that serves several verbs is decorated once for each.

    Args:
        names: The values of `name` in conf/task/*.yaml that select the class.
        verb: The key of `language.VERBS` for the task's sentences.

    Raises:
        LanguageError: The verb is unknown.
        ValueError: A name is taken.
    """
    check_known("verb", verb, VERBS)

    def register(task: TaskClass) -> TaskClass:
        for name in names:
            if name in TASKS:
                raise ValueError(f"task {name!r} is registered already, as {TASKS[name].__name__}")
            TASKS[name], TASK_VERBS[name] = task, verb
        return task

    return register


# ---- the base class


class Task(ABC):
    """The goals, rewards and ends of N episodes at once.

    Attributes:
        traits: what kind of task it is. An instance's may follow from its config: see `_configure`.
        terms: the names of its reward terms, in their order.
        columns: further observations of each object, after its row and its offset from the gripper, in tasks that move
            objects.
        kind_names: the kinds of its sentences.
        fixtures: nouns of devices or fittings among its objects; its first columns mark them.
        fitting_starts: how far the workspace's fittings are open as an episode begins, where they are among its
            objects; None: they are not.
        nouns: nouns that its objects can have.
        shapes: the bodies that its worlds have, in the order in which episodes count them.
        verbs: among which the words choose; (): all sentences have the same verb.
        stages: number of stages that `stage` returns.
        release_lag: physics steps from the command to open until the gripper releases.
        perceived: whether policies know of its objects what cameras see.

    Args:
        config: of the task.
        object_area: x0, x1, y0, y1 of the objects' centres, metres.
        num_worlds: N.
        person: who points at the referent; None: nobody.
    """

    traits = TaskTraits()
    terms: tuple[str, ...]
    columns: tuple[Column, ...] = ()
    kind_names: tuple[str, ...] = ("none",)
    fixtures: tuple[str, ...] = ()
    fitting_starts: FittingStarts | None = None
    nouns: tuple[str, ...] = SHAPES
    shapes: tuple[str, ...] = SHAPES
    verbs: tuple[str, ...] = ()
    stages = 1
    release_lag = 0
    perceived = False

    def __init__(
        self, config: TaskConfig, object_area: Sequence[float], num_worlds: int, person: Person | None = None
    ) -> None:
        self.config, self.verb = config, TASK_VERBS[config.name]
        self._area, self._person = object_area, person
        self.fittings = SceneFittings(config, self.fitting_starts) if self.fitting_starts else None
        check_terms(config, self.terms)
        self._configure(config, person)
        self._sentences = SentenceWriter(config)
        self._layout = config.objects.layout(config.object_size)
        self._nouns = np.array([list(NOUNS).index(noun) for noun in config.nouns])
        self._rows = np.arange(num_worlds)
        self._allocate(num_worlds)

    def _configure(self, config: TaskConfig, person: Person | None) -> None:
        """Set the attributes that follow from the config. Raises ConfigError where it does not fit the task."""
        if not config.kinds and config.num_objects > 1 and person is None and not self.traits.marks:
            raise ConfigError(
                f"task.num_objects={config.num_objects} must be 1 in a task without words, "
                "or nothing would tell which object is meant; try task=nl_reach or task=reach_gesture"
            )
        if person is not None and person.config.switch and type(self)._elsewhere is Task._elsewhere:
            raise ConfigError(
                f"gesture.switch={person.config.switch} needs words that fit another object as well, and those of "
                f"task.name={config.name} do not; take reach_gesture or nl_reach_gesture"
            )
        if config.instructions > 1 and (self.traits.stepwise or not self.traits.continues):
            raise ConfigError(
                f"task.instructions={config.instructions} must be 1 in task.name={config.name}: take task=anything for "
                "one instruction after another"
            )
        if config.curriculum.automatic and not self.verbs:
            raise ConfigError(
                f"task.curriculum.automatic=true needs several verbs, and task.name={config.name} has one: take "
                "task=anything, or false"
            )
        if not set(config.nouns) <= set(self.nouns):
            raise ConfigError(f"task.nouns={config.nouns} must be of {list(self.nouns)} in task.name={config.name}")
        if unknown := [verb for verb in config.verbs if verb not in self.verbs]:
            known = f"of {', '.join(self.verbs)}" if self.verbs else "empty"
            raise ConfigError(
                f"task.verbs={config.verbs} must be {known} in task.name={config.name}"
                + did_you_mean(unknown[0], self.verbs)
            )

    @abstractmethod
    def _allocate(self, worlds: int) -> None:
        """Allocate the memory that each world keeps between steps."""

    # ---- the workspace

    def furnish(self, fittings: Mapping[str, Fitting]) -> None:
        """Take note of the workspace's fittings, before anything is drawn. Raises ConfigError where one is missing."""
        if self.fittings is not None:
            self.fittings.furnish(fittings)

    def prepare(self, workspace: WorkspaceConfig) -> None:
        """Read other parts of the workspace than fittings, before anything is drawn. Raises ConfigError where one is
        missing."""
        return None

    @property
    def points(self) -> bool:
        """Whether a person points at the referent."""
        return self._person is not None

    @property
    def bodies(self) -> tuple[int, int, int]:
        """The largest numbers of free, fixed and see-through objects in an episode."""
        if self._layout is None:
            fittings = 0 if self.fittings is None else len(FITTINGS)
            return self.config.num_objects - fittings, 0, self.config.num_targets
        specs = self._layout.specs
        targets = sum(spec.role == "target" for spec in specs)
        fixed = sum(spec.role == "real" and spec.fixed for spec in specs)
        return len(specs) - fixed - targets, fixed, targets

    @property
    def devices(self) -> tuple[str, ...]:
        """The nouns of the devices that an episode can show."""
        return ()

    @property
    def device_width(self) -> float:
        """Metres across a device."""
        return self.config.object_size

    # ---- evaluating

    @abstractmethod
    def reset(self, worlds: NDArray[np.int64], state: State) -> None:
        """Begin new episodes in these worlds, or continue with another referent."""

    def notice(self, world: int, slots: NDArray[np.int64], state: State) -> None:
        """Begin the memory of objects that are seen only now in these slots (S,); that of all others goes on.

        The memory are the arrays of `_allocate`: (N, K, ...) by slot, and (N, ...).
        """
        kept = {name: values[world].copy() for name, values in self._memory_arrays().items()}
        self.reset(np.array([world]), state)
        others = np.setdiff1d(np.arange(state.shown.shape[1]), slots)
        for name, values in self._memory_arrays().items():
            if values.shape[1:2] == state.shown.shape[1:]:
                values[world, others] = kept[name][others]
            else:
                values[world] = kept[name]

    def _memory_arrays(self) -> dict[str, NDArray]:
        """Return the arrays of the memory by name."""
        count = len(self._rows)
        arrays = {name: values for name, values in vars(self).items() if isinstance(values, np.ndarray)}
        return {name: values for name, values in arrays.items() if name != "_rows" and values.shape[:1] == (count,)}

    @abstractmethod
    def step(self, state: State) -> StepOutcome:
        """Evaluate one control step of all worlds. The environment adds truncation."""

    def stage(self, state: State) -> NDArray[np.int64]:
        """(N,) the stage of each world's episode; independent of the referent and target."""
        return np.zeros(len(self._rows), np.int64)

    @property
    def memory(self) -> NDArray[np.float64]:
        """(N, M) in [0, 1]: values that success depends on and the observation lacks; for privileged critics."""
        return np.zeros((len(self._rows), 0))

    def seen(self, state: State) -> NDArray[np.float64]:
        """(N, K, C) the values of `columns` of each shown object. Hidden slots are undefined."""
        if self.fittings is not None:
            return self.fittings.described(state.nouns, state.objects)
        return np.zeros((*state.shown.shape, 0))

    def described(self, episode: EpisodeSpec) -> NDArray[np.float64]:
        """(K, C) the values of `columns` that a scene tells as the episode begins; none of them if C is 0."""
        if self.fittings is not None:
            return self.fittings.described(episode.scene.nouns, episode.scene.positions)
        return np.zeros((len(episode.scene), 0))

    def possible_goals(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) which objects could be the goal."""
        return placed.scene.targets

    def moved(self, state: State) -> NDArray[np.float64]:
        """(N, K) how far devices are from their start, in shares of their way, where a task `continues`; else 0."""
        return np.zeros(state.shown.shape)

    # ---- relabelling, and further instructions

    def relabel(self, placed: Placed, moments: State, rng: Generator) -> EpisodeSpec | None:
        """Relabel an episode with a goal that it achieved (HER); None if it achieved no other goal.

        placed: the scene at the beginning. moments: the T + 1 states of the episode in place of N worlds, with the
        scene's K objects as slots. In the returned scene only see-through targets may stand elsewhere: nothing touches
        them, so the episode's physics stays the same. Raises LanguageError if no sentence names the goal.
        """
        return None

    @property
    def most_instructions(self) -> int:
        """How many instructions an episode can have."""
        return self.config.instructions

    def next_instruction(
        self,
        scene: Scene,
        held: int,
        rng: Generator,
        *,
        moved: NDArray[np.float64] | None = None,
        last: GivenInstruction | None = None,
    ) -> GivenInstruction | None:
        """Return the next instruction after a success, in the scene as it is; None if there is none.

        held: the object that the gripper holds, or NOTHING. moved: (K,) of `moved`; None: 0. last: what succeeded.
        """
        return None

    # ---- drawing

    @property
    def draw_state(self) -> dict[str, float]:
        """The state on which `draw` depends beside its generator: named statistics of earlier outcomes."""
        return {}

    def load_draw_state(self, state: Mapping[str, float]) -> None:  # noqa: B027
        """Restore a `draw_state`. Values that it lacks become the initial ones."""

    def draw(self, rng: Generator) -> EpisodeSpec:
        """Draw an episode for one world, with its gesture. Deterministic given rng."""
        episode = self._retry(lambda: self._pointed(self._draw(rng), rng))
        randomized = self.config.randomize.draw(rng)
        return episode if randomized is None else replace(episode, randomized=randomized)

    def each_in_turn(self, rng: Generator) -> list[EpisodeSpec]:
        """Draw episodes of one scene: one for each object that the words or the finger single out."""
        return self._retry(lambda: self._each_in_turn(rng))

    def _each_in_turn(self, rng: Generator) -> list[EpisodeSpec]:
        """As `each_in_turn`, but raises Unreachable if the person cannot point at one of them."""
        return [self._pointed(self._draw(rng), rng)]

    def _retry(self, draw: Callable[[], T]) -> T:
        """Return the result of `draw`, repeated until the person can point at its objects."""
        for _ in range(POINTING_TRIES):
            try:
                return draw()
            except Unreachable:
                continue
        area = list(self._area)
        raise ConfigError(f"task.name={self.config.name}: the person cannot point into workspace.object_area={area}")

    def _draw(self, rng: Generator) -> EpisodeSpec:
        """Draw scene, referent and sentence. Raises Unreachable if the person cannot point at the referent."""
        return self._episode(self._placed(rng), referent=0)

    def _pointed(self, episode: EpisodeSpec, rng: Generator) -> EpisodeSpec:
        """Return the episode with a gesture at the referent, which sometimes switches to another object."""
        person = self._person
        if person is None:
            return episode
        if episode.gesture is None:
            episode = replace(episode, gesture=person.show(episode.scene.positions[episode.referent], rng))
        assert episode.gesture is not None
        if rng.random() >= person.config.switch or not episode.gesture.shown:
            return episode
        other, at = self._elsewhere(episode, rng), int(rng.integers(*SWITCH_STEPS))
        return episode if other is None else replace(episode, gesture_switch=GestureSwitch(at, *other))

    def _elsewhere(self, episode: EpisodeSpec, rng: Generator) -> tuple[int, PointingGesture] | None:
        """Return another object that fits the same sentence, and a gesture at it; None if there is no other."""
        return None

    def _episode(
        self,
        placed: Placed,
        *,
        referent: int,
        kind: int = 0,
        sentence: str = "",
        gesture: PointingGesture | None = None,
    ) -> EpisodeSpec:
        """Return the episode of these objects and this referent, with the sentence as the policy reads it."""
        return EpisodeSpec(
            scene=placed.scene,
            referent=referent,
            kind=kind,
            sentence=sentence,
            heard=self._sentences.heard(sentence),
            yaw=placed.yaw,
            fixed=placed.fixed,
            gesture=gesture,
        )

    def _placed(self, rng: Generator) -> Placed:
        """Draw the objects that the config lists if any, else a scene."""
        if self._layout is None:
            return unfixed(self._scene(rng))
        try:
            return self._layout.draw(rng, self.config.spacing)
        except LanguageError as error:
            raise ConfigError(f"task.objects: {error}") from None

    def _scene(self, rng: Generator) -> Scene:
        """Draw a scene of objects with random nouns, colours and places."""
        config, count = self.config, self._draw_count(rng)
        if self.fittings is not None:
            return self.fittings.draw_scene(count, self._area, self._nouns, rng)
        count += config.num_targets
        places = scatter(rng, count, area=self._area, spacing=config.spacing, height=config.object_size / 2)
        nouns, colors = self._nouns[rng.integers(len(self._nouns), size=count)], rng.integers(len(COLORS), size=count)
        targets = np.arange(count) >= count - config.num_targets
        return Scene.from_arrays(nouns, colors, places, config.object_size, targets=targets, viewpoint=config.viewpoint)

    def _draw_count(self, rng: Generator) -> int:
        """Draw how many real objects a scene has. A number that is always the same takes nothing from `rng`."""
        least, most = self.config.min_objects, self.config.num_objects
        return most if least == most else int(rng.integers(least, most + 1))


def unfixed(scene: Scene) -> Placed:
    """Return the scene with no object rotated or fixed."""
    return Placed(scene, np.zeros(len(scene)), np.zeros(len(scene), bool))
