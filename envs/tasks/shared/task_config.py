"""The configuration of tasks: `TaskConfig`, which the YAML files of conf/task fill in, and its parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.random import Generator

from core.errors import ConfigError, did_you_mean
from core.schema import Checked, checked_by, one_of, within, word
from envs.tasks.shared.types import Randomized
from language import (
    DEVICES,
    KINDS,
    NOUNS,
    SHAPES,
    SPLITS,
    VIEWPOINTS,
    HeldOut,
    LanguageError,
    Layout,
    ObjectSpec,
    Split,
    from_lists,
    whose_left,
)

SLOTS = 8  # the most objects and targets of an episode
ROOM_SLOTS = 12  # ... where devices stand beside fittings and loose objects
STACKED_SLOTS = 128  # ... where objects may be stacked
MOST_DELAY = 10  # control steps that an action may be late
OFF = [1.0, 1.0]  # the range of a factor that is not randomised
ROUNDING = 1e-9  # metres


def _range(low: float, high: float, off: Sequence[float]) -> Any:
    """Declare a field: the two ends of a range within [low, high]; `off`, if it is left out."""
    return field(default_factory=lambda: list(off), metadata={"within": (low, high), "count": 2})


@dataclass(frozen=True, kw_only=True)
class HeldOutConfig(Checked):
    """Words and phrases that the split train never uses, as in `language.HeldOut`."""

    color_noun: list[list[str]] = checked_by("language.HeldOut")
    relation_noun: list[list[str]] = checked_by("language.HeldOut")
    phrases: list[str] = checked_by("language.HeldOut")

    def __post_init__(self) -> None:
        super().__post_init__()
        self.held_out()

    def held_out(self) -> HeldOut:
        """As a `language.HeldOut`. Raises ConfigError."""
        for name in ("color_noun", "relation_noun"):
            for pair in getattr(self, name):
                if len(pair) != 2:
                    raise ConfigError(f"{name}={pair} must be pairs, like [red, cube] or [left of, cube]")
        pairs = {name: tuple((a, b) for a, b in getattr(self, name)) for name in ("color_noun", "relation_noun")}
        try:
            return HeldOut(**pairs, phrases=tuple(self.phrases))
        except LanguageError as error:
            raise ConfigError(str(error)) from None


@dataclass(frozen=True, kw_only=True)
class CurriculumConfig(Checked):
    """Shares of training episodes that begin nearer to success, how they succeed and end, and the draw of verbs.

    Evaluations never use them.
    """

    near: float = within(0, 1)  # the gripper is just over the object
    held: float = within(0, 1)  # the gripper holds the object, somewhere over the table
    placed: float = within(0, 1)  # the gripper has just let go of the object at its target
    radius: float = within(0, 1, default=0.0)  # metres, in place of task.radius if smaller; 0: task.radius
    hold_steps: int = within(0, 1000, default=0)  # control steps, in place of task.hold_steps if fewer; 0: as there
    max_steps: int = within(0, 100_000, default=0)  # control steps, in place of task.max_steps if fewer; 0: as there
    # Metres along x and y that an object that is held from the start may be off the middle of a magnet, which takes
    # hold wherever it touches. Without, a policy may bring its middle to the target instead of the object.
    off_centre: float = within(0, 0.05, default=0.0)
    # Whether verbs that failed recently are drawn more often, in tasks with several. The draws of a world then depend
    # on the outcomes in the other worlds of its process.
    automatic: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.share > 1:
            raise ConfigError(f"near={self.near}, held={self.held} and placed={self.placed} must come to 1 at most")

    @property
    def share(self) -> float:
        """The sum of the three shares."""
        return self.near + self.held + self.placed


NO_CURRICULUM = CurriculumConfig(near=0.0, held=0.0, placed=0.0)


@dataclass(frozen=True, kw_only=True)
class RandomizeConfig(Checked):
    """Domain randomisation: each training episode draws these values, uniformly from [low, high].

    If low equals high, every episode has that value. Evaluations are not randomised.
    """

    start: float = within(0, 1, default=0.0)  # greatest distance of joints from rest, radians; 0: task.reset_noise
    mass: list[float] = _range(0.01, 100, OFF)  # factor of the objects' mass
    friction: list[float] = _range(0.01, 10, OFF)  # factor of the objects' lateral friction
    action_noise: float = within(0, 1, default=0.0)  # std of the arm's motion, as a share of a control step's motion
    observation_noise: float = within(0, 0.1, default=0.0)  # std of the objects' observed positions, metres
    delay: list[int] = _range(0, MOST_DELAY, [0, 0])  # control steps after which an action is carried out

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("mass", "friction", "delay"):
            low, high = getattr(self, name)
            if low > high:
                raise ConfigError(f"{name}={[low, high]} must be a range: the lower end first")

    @property
    def is_on(self) -> bool:
        """Whether an episode draws anything but where the arm begins."""
        ranges = self.mass != OFF or self.friction != OFF or self.delay != [0, 0]
        return ranges or self.action_noise > 0 or self.observation_noise > 0

    def draw(self, rng: Generator) -> Randomized | None:
        """Draw the values of an episode; None if it is off. `rng` does not advance: scenes do not depend on them."""
        if not self.is_on:
            return None
        rng = Generator(rng.bit_generator.jumped())  # type: ignore[attr-defined]
        mass, friction = (float(rng.uniform(low, high)) for low, high in (self.mass, self.friction))
        delay = int(rng.integers(self.delay[0], self.delay[1] + 1))
        return Randomized(mass=mass, friction=friction, delay=delay, noise=int(rng.integers(2**31)))


@dataclass(frozen=True, kw_only=True)
class ObjectConfig(Checked):
    """One object that a task lists, as in `ObjectSpec`; area in metres. A noun or color left out is drawn."""

    noun: str | None = checked_by("language.ObjectSpec", default=None)
    color: str | None = checked_by("language.ObjectSpec", default=None)
    area: list[float] = checked_by("language.ObjectSpec")  # x0, x1, y0, y1, z0, z1 of its centre
    fixed: bool = False
    random_rotation: bool = False
    role: str | None = checked_by(
        "language.ObjectSpec", default=None
    )  # left out: "real" for an init, "target" for a goal

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.noun in DEVICES:
            raise ConfigError(f"noun={self.noun} cannot be listed: choose from {', '.join(SHAPES)}; devices are drawn")
        try:
            self.spec(0.05, "real")
        except LanguageError as error:
            raise ConfigError(str(error)) from None

    def spec(self, size: float, role: str) -> ObjectSpec:
        """As an ObjectSpec, `size` metres wide; role: if the config names none."""
        role = self.role or role
        return ObjectSpec(self.noun, self.color, self.area, size, self.fixed, self.random_rotation, role)


@dataclass(frozen=True, kw_only=True)
class ObjectsConfig(Checked):
    """The objects of every episode: those of init may be brought to those of goal. Empty: the task draws them."""

    init: list[ObjectConfig]
    goal: list[ObjectConfig]

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self) > SLOTS:
            raise ConfigError(f"init and goal list {len(self)} objects: at most {SLOTS} can be shown")
        self.layout(0.05)

    def __len__(self) -> int:
        return len(self.init) + len(self.goal)

    def layout(self, size: float) -> Layout | None:
        """Return the listed objects, `size` metres wide, init first; None if none is listed. Raises ConfigError."""
        if not len(self):
            return None
        try:
            return from_lists(
                [each.spec(size, "real") for each in self.init], [each.spec(size, "target") for each in self.goal]
            )
        except LanguageError as error:
            raise ConfigError(f"init: {error}") from None

    def check(self, bounds: Sequence[float]) -> None:
        """Raise ConfigError for an area that reaches out of bounds (x0, x1, y0, y1, z0, z1), metres."""
        low, high = np.reshape(bounds, (3, 2)).T
        for name, listed in (("init", self.init), ("goal", self.goal)):
            for index, each in enumerate(listed):
                area = np.reshape(each.area, (3, 2))
                if (area < low[:, None]).any() or (area > high[:, None]).any():
                    raise ConfigError(
                        f"task.objects.{name}.{index}.area={each.area} must lie in workspace.bounds={list(bounds)}"
                    )


@dataclass(frozen=True, kw_only=True)
class TaskConfig(Checked):
    """Lengths in metres, angles in radians, steps in control steps.

    If objects are listed, num_objects and min_objects are their number and num_targets is 0, whatever was given.
    """

    name: str = word()
    objects: ObjectsConfig
    num_objects: int = within(1, STACKED_SLOTS)
    min_objects: int = within(1, STACKED_SLOTS)  # an episode shows this many to num_objects
    drawn_objects: int = within(0, STACKED_SLOTS, default=0)  # up to so many in scenes that are not simulated, if more
    num_targets: int = within(0, SLOTS)  # see-through places, beside the objects
    levels: int = within(1, STACKED_SLOTS)  # objects in a stack, at most
    devices: int = within(0, 3, default=0)  # number of devices among the objects, in tasks with fittings
    hand: bool = False  # whether one of the objects is the open hand of a person, where a task has devices
    nouns: list[str] = one_of(*NOUNS)  # nouns of drawn objects
    kinds: list[str] = one_of(*KINDS)  # of sentences; empty: no words
    viewpoint: str = one_of(*VIEWPOINTS)  # whose left and right are meant
    split: str = one_of(*SPLITS)  # which sentences are drawn
    held_out: HeldOutConfig
    varied: bool  # sentences use every synonym and template, not only the first of each
    rephrased: bool  # the policy reads each sentence as the parser repeats it
    radius: float = within(0.001, 1)
    hold_steps: int = within(1, 1000)
    max_steps: int = within(1, 100_000)
    object_size: float = within(0.01, 0.2)
    spacing: float = within(0, 1)  # between the centres of two objects, at reset
    reset_noise: float = within(0, 1)
    curriculum: CurriculumConfig
    randomize: RandomizeConfig = field(default_factory=RandomizeConfig)  # configs of older versions lack it
    instructions: int = within(1, 1000, default=1)  # per episode: after a success the next one is given
    verbs: list[str] = word(default=())  # verbs of the task that instructions use; empty: all
    reward: dict[str, float] = within(-1000, 1000)  # the weight of every reward term of the task, by name

    def __post_init__(self) -> None:
        listed = len(self.objects)
        for name, value in (("num_objects", listed), ("min_objects", listed), ("num_targets", 0)) if listed else ():
            object.__setattr__(self, name, value)
        super().__post_init__()
        for name, least in (("num_objects", 1), ("min_objects", 1), ("drawn_objects", 0)):
            if (value := getattr(self, name)) > self.most_slots:
                raise ConfigError(f"{name}={value} is out of range: it must be in [{least}, {self.most_slots}]")
        try:
            self.sentence_split()
        except LanguageError as error:
            raise ConfigError(str(error)) from None
        if not self.nouns:
            raise ConfigError(f"nouns=[] must name at least one of {', '.join(NOUNS)}")
        if self.slots > self.most_slots:
            many = f"num_objects={self.num_objects} and num_targets={self.num_targets}"
            raise ConfigError(f"{many}: at most {self.most_slots} can be shown")
        if self.hold_steps > self.max_steps:
            raise ConfigError(f"hold_steps={self.hold_steps} must be at most max_steps={self.max_steps}")
        if self.min_objects > self.num_objects:
            raise ConfigError(f"min_objects={self.min_objects} must be at most num_objects={self.num_objects}")
        if self.spacing < 2 * self.radius and self.slots > 1:
            raise ConfigError(
                f"spacing={self.spacing} must be at least {2 * self.radius:g}, twice the radius, "
                "or the gripper could be at two objects at once"
            )
        if self.spacing < 1.5 * self.object_size - ROUNDING and self.slots > 1:
            raise ConfigError(
                f"spacing={self.spacing} must be at least {1.5 * self.object_size:g}, 1.5 times the object_size, "
                "or objects would stand in each other"
            )

    @property
    def success_radius(self) -> float:
        """Metres from its goal within which an episode of this config can succeed: less in training, if so set."""
        return min(self.curriculum.radius or self.radius, self.radius)

    @property
    def success_steps(self) -> int:
        """Control steps for which an end must last in an episode of this config: fewer in training, if so set."""
        return min(self.curriculum.hold_steps or self.hold_steps, self.hold_steps)

    @property
    def most_steps(self) -> int:
        """Control steps for each instruction of an episode of this config: fewer in training, if so set."""
        return min(self.curriculum.max_steps or self.max_steps, self.max_steps)

    @property
    def slots(self) -> int:
        """The largest number of objects and targets in an episode."""
        return self.num_objects + self.num_targets

    @property
    def most_slots(self) -> int:
        """How many objects and targets an episode can show."""
        if self.levels > 1:
            return STACKED_SLOTS
        return ROOM_SLOTS + self.hand if self.devices else SLOTS

    @property
    def whose_left(self) -> str:
        """Whose left, right and front are meant, in words."""
        return whose_left(self.viewpoint)

    def sentence_split(self) -> Split:
        """Return the split of the sentences, with what it holds out. Raises LanguageError if no sentence is left."""
        return Split(self.split, self.held_out.held_out())


def check_terms(config: TaskConfig, terms: Sequence[str]) -> None:
    """Raise ConfigError unless the config weights each reward term of the task, and no other."""
    for name in config.reward:
        if name not in terms:
            raise ConfigError(
                f"task.reward.{name} is not a known term of task.name={config.name}" + did_you_mean(name, terms)
            )
    for name in terms:
        if name not in config.reward:
            raise ConfigError(
                f"task.reward.{name} has no value: task.name={config.name} needs a weight for each of "
                f"{', '.join(terms)}; +task.reward.{name}=0 switches it off, also for runs and policies from before it"
            )
