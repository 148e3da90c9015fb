"""The table of tasks, which task classes enter by decorator."""

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
from envs.tasks.shared.geometry import scatter
from envs.tasks.shared.types import (
    Column,
    EpisodeSpec,
    GestureSwitch,
    Outcome,
    Said,
    State,
    TaskConfig,
    check_terms,
    draw_randomized,
)
from human import Person, PointingGesture, Unreachable
from language import (
    COLORS,
    KINDS,
    MAX_WORDS,
    NOUNS,
    SHAPES,
    VERBS,
    Describer,
    Instruction,
    LanguageError,
    Placed,
    Scene,
    Wording,
    parse,
    say,
)
from language.errors import check_known
from language.tokenizer import count_words

TASKS: dict[str, type[Task]] = {}
TaskClass = TypeVar("TaskClass", bound="type[Task]")


def register_task(*names: str, verb: str) -> Callable[[TaskClass], TaskClass]:
    """Class decorator that registers a task.

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
            TASKS[name] = task
        task.verb = verb
        return task

    return register


T = TypeVar("T")
TRIES = 200
SWITCH_STEPS = (4, 16)  # the control step before which a finger switches to another object lies in this range


def unfixed(scene: Scene) -> Placed:
    """The scene with no object rotated or fixed."""
    return Placed(scene, np.zeros(len(scene)), np.zeros(len(scene), bool))


class Task(ABC):
    """N episodes at once.

    verb: the key of `language.VERBS` for its sentences, set by `register_task`.
    terms: the names of its reward terms, in their order. columns: further observations of each object, after its row
    and its offset from the gripper, in tasks that move objects (`moves`).
    """

    verb: str
    terms: tuple[str, ...]
    columns: tuple[Column, ...] = ()
    kind_names: tuple[str, ...] = ("none",)
    speaks = False  # episodes have sentences
    grips = False  # one more number of the action closes the gripper
    turns = False  # one more number of the action turns the gripper about the vertical
    lag = 0  # physics steps from the command to open until the gripper releases
    moves = False  # it moves objects, not only the gripper
    places = False  # the referent is to be brought to a goal
    real_goals = False  # goals are real objects, not see-through targets
    operates = False  # its objects are devices; their positions are those of their handles
    fixtures: tuple[str, ...] = ()  # nouns of devices or fittings among its objects; its first columns mark them
    nouns: tuple[str, ...] = SHAPES  # nouns that its objects can have
    shapes: tuple[str, ...] = SHAPES  # the bodies that its worlds have, in the order in which episodes count them
    stacks = False  # objects stand in the cells of a board, on top of each other
    verbs: tuple[str, ...] = ()  # among which the words choose; (): all sentences have the same verb
    continues = False  # after a success there can be another instruction
    stepwise = False  # an episode is one sentence of several steps, each an instruction, and succeeds with the last one
    marks = False  # the first of its columns marks the referent where no words name it
    stages = 1  # number of stages that `stage` returns

    def __init__(
        self, config: TaskConfig, object_area: Sequence[float], num_worlds: int, person: Person | None = None
    ) -> None:
        check_terms(config, self.terms)
        if not config.kinds and config.num_objects > 1 and person is None and not self.marks:
            raise ConfigError(
                f"task.num_objects={config.num_objects} must be 1 in a task without words, "
                "or nothing would tell which object is meant; try task=nl_reach or task=reach_gesture"
            )
        if person is not None and person.config.switch and type(self)._elsewhere is Task._elsewhere:
            raise ConfigError(
                f"gesture.switch={person.config.switch} needs words that fit another object as well, and those of "
                f"task.name={config.name} do not; take reach_gesture or nl_reach_gesture"
            )
        if config.instructions > 1 and (self.stepwise or not self.continues):
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
        self.config, self._area, self._person = config, object_area, person
        self._split = config.says()
        self._wording = (
            Wording(self._split, MAX_WORDS) if config.varied or self._split.name == "test_paraphrase" else None
        )
        self._layout = config.objects.layout(config.object_size)
        self._nouns = np.array([list(NOUNS).index(noun) for noun in config.nouns])
        self._rows = np.arange(num_worlds)
        self._allocate(num_worlds)

    @abstractmethod
    def _allocate(self, worlds: int) -> None:
        """Allocates the memory that each world keeps between steps."""

    @abstractmethod
    def reset(self, worlds: NDArray[np.int64], state: State) -> None:
        """Begins new episodes in these worlds, or continues with another referent."""

    @abstractmethod
    def step(self, state: State) -> Outcome:
        """Evaluates one control step of all worlds. The environment adds truncation."""

    def stage(self, state: State) -> NDArray[np.int64]:
        """(N,) the stage of each world's episode; independent of the referent and target."""
        return np.zeros(len(self._rows), np.int64)

    @property
    def memory(self) -> NDArray[np.float64]:
        """(N, M) in [0, 1]: values that success depends on and the observation lacks; for privileged critics."""
        return np.zeros((len(self._rows), 0))

    def seen(self, state: State) -> NDArray[np.float64]:
        """(N, K, C) the values of `columns` of each shown object. Hidden slots are undefined."""
        return np.zeros((*state.shown.shape, 0))

    def relabel(self, placed: Placed, moments: State, rng: Generator) -> EpisodeSpec | None:
        """Relabels an episode with a goal that it achieved (HER); None if it achieved no other goal.

        placed: the scene at the beginning. moments: the T + 1 states of the episode in place of N worlds, with the
        scene's K objects as slots. In the returned scene only see-through targets may stand elsewhere: nothing touches
        them, so the episode's physics stays the same. Raises LanguageError if no sentence names the goal.
        """
        return None

    def moved(self, state: State) -> NDArray[np.float64]:
        """(N, K) how far devices are from their start, in shares of their way, where a task `continues`; else 0."""
        return np.zeros(state.shown.shape)

    @property
    def most_instructions(self) -> int:
        """How many instructions an episode can have."""
        return self.config.instructions

    def next_instruction(
        self,
        scene: Scene,
        held: int,
        rng: Generator,
        moved: NDArray[np.float64] | None = None,
        last: Said | None = None,
    ) -> Said | None:
        """Returns the next instruction after a success, in the scene as it is; None if there is none.

        held: the object that the gripper holds, or NOTHING. moved: (K,) of `moved`; None: 0. last: what succeeded.
        """
        return None

    @property
    def draw_state(self) -> dict[str, float]:
        """The state on which `draw` depends beside its generator: named statistics of earlier outcomes."""
        return {}

    def load_draw_state(self, state: Mapping[str, float]) -> None:  # noqa: B027
        """Restores a `draw_state`. Values that it lacks become the initial ones."""

    def furnish(self, fittings: Mapping[str, Fitting]) -> None:
        """Takes note of the workspace's fittings, before anything is drawn. Raises ConfigError where one is missing."""
        return None

    def prepare(self, workspace: WorkspaceConfig) -> None:
        """Reads other parts of the workspace than fittings, before anything is drawn. Raises ConfigError where one is
        missing."""
        return None

    def described(self, episode: EpisodeSpec) -> NDArray[np.float64]:
        """(K, C) the values of `columns` that a scene tells as the episode begins; none of them if C is 0."""
        return np.zeros((len(episode.scene), 0))

    @property
    def points(self) -> bool:
        """Whether a person points at the referent."""
        return self._person is not None

    @property
    def bodies(self) -> tuple[int, int, int]:
        """The largest numbers of free, fixed and see-through objects in an episode."""
        if self._layout is None:
            return self.config.num_objects, 0, self.config.num_targets
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

    def draw(self, rng: Generator) -> EpisodeSpec:
        """Draws an episode for one world, with its gesture. Deterministic given rng."""
        episode = self._retry(lambda: self._pointed(self._draw(rng), rng))
        randomized = draw_randomized(self.config.randomize, rng)
        return episode if randomized is None else replace(episode, randomized=randomized)

    def each_in_turn(self, rng: Generator) -> list[EpisodeSpec]:
        """Episodes of one scene: one for each object that the words or the finger single out."""
        return self._retry(lambda: self._each_in_turn(rng))

    def _each_in_turn(self, rng: Generator) -> list[EpisodeSpec]:
        """As `each_in_turn`, but raises Unreachable if the person cannot point at one of them."""
        return [self._pointed(self._draw(rng), rng)]

    def _retry(self, draw: Callable[[], T]) -> T:
        """The result of `draw`, repeated until the person can point at its objects."""
        for _ in range(TRIES):
            try:
                return draw()
            except Unreachable:
                continue
        area = list(self._area)
        raise ConfigError(f"task.name={self.config.name}: the person cannot point into workspace.object_area={area}")

    def _draw(self, rng: Generator) -> EpisodeSpec:
        """Draws scene, referent and sentence. Raises Unreachable if the person cannot point at the referent."""
        placed = self._placed(rng)
        return self._episode(placed, referent=0, kind=0, sentence="")

    def _pointed(self, episode: EpisodeSpec, rng: Generator) -> EpisodeSpec:
        """The episode with a gesture at the referent, which sometimes switches to another object."""
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

    def _say(self, instruction: Instruction, rng: Generator) -> str:
        """The standard sentence of the instruction or, with `task.varied`, one in random words."""
        if self._wording is None:
            return say(instruction)
        try:
            return self._wording.say(instruction, rng)
        except LanguageError as error:
            raise ConfigError(f"task.split={self.config.split}: {error}; hold out a template of reach") from None

    def _episode(
        self, placed: Placed, referent: int, kind: int, sentence: str, gesture: PointingGesture | None = None
    ) -> EpisodeSpec:
        """The episode of these objects and this referent, with the sentence as the policy reads it."""
        heard = self._heard(sentence)
        return EpisodeSpec(placed.scene, referent, kind, sentence, heard, placed.yaw, placed.fixed, gesture)

    def _heard(self, sentence: str) -> str | None:
        """The sentence as the policy reads it; None: as it is said."""
        return say(parse(sentence)) if sentence and self.config.rephrased else None

    def _elsewhere(self, episode: EpisodeSpec, rng: Generator) -> tuple[int, PointingGesture] | None:
        """Another object that fits the same sentence, and a gesture at it; None if there is no other."""
        return None

    def _placed(self, rng: Generator) -> Placed:
        """The objects that the config lists if any, else a drawn scene."""
        if self._layout is None:
            scene = self._scene(rng)
            return unfixed(scene)
        try:
            return self._layout.draw(rng, self.config.spacing)
        except LanguageError as error:
            raise ConfigError(f"task.objects: {error}") from None

    def _scene(self, rng: Generator) -> Scene:
        config = self.config
        count = config.num_objects
        if config.min_objects < count:
            count = int(rng.integers(config.min_objects, count + 1))
        count += config.num_targets
        places = scatter(rng, count, self._area, config.spacing, config.object_size / 2)
        nouns, colors = self._nouns[rng.integers(len(self._nouns), size=count)], rng.integers(len(COLORS), size=count)
        targets = np.arange(count) >= count - config.num_targets
        return Scene.from_arrays(nouns, colors, places, config.object_size, targets, config.viewpoint)


SENTENCE_TRIES = 1000
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
        for _ in range(SENTENCE_TRIES):
            placed = self._placed(rng)
            nameable = self._describer.nameable(placed.scene)
            if nameable.all() if self.config.split in WHOLE_SCENE_SPLITS else nameable.any():
                return placed, nameable
        within = "" if self.config.split == "all" else f" in task.split={self.config.split}"
        raise ConfigError(
            f"task.kinds={list(self.config.kinds)} cannot name each of {self.config.num_objects} objects{within}"
        )
