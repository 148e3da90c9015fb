"""Data types of the tasks: their config, drawn episodes, the state of all worlds, and the outcome of a step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from conf.schema import Checked, ConfigError, one_of, within
from envs.tasks.held_out import HeldOutConfig
from envs.tasks.training_episodes import CurriculumConfig, RandomizeConfig, Randomized
from human import Gesture
from language import (
    DEVICES,
    KINDS,
    NOUNS,
    SHAPES,
    SPLITS,
    VIEWPOINTS,
    LanguageError,
    Layout,
    ObjectSpec,
    Scene,
    Split,
    from_lists,
)

Array = NDArray[np.float64]
SLOTS = 8  # at most
ROOM_SLOTS = 12  # ... where devices stand beside fittings and loose objects
STACKED_SLOTS = 128  # ... where objects may be stacked
ROUNDING = 1e-9  # metres
NOTHING = -1  # in place of a slot: the gripper is empty


@dataclass(frozen=True, kw_only=True)
class ObjectConfig(Checked):
    """One object that a task lists, as in `ObjectSpec`; area in metres. A noun or color left out is drawn."""

    noun: str | None = None
    color: str | None = None
    area: list[float]  # x0, x1, y0, y1, z0, z1 of its centre
    fixed: bool = False
    random_rotation: bool = False
    role: str | None = None  # left out: "real" for an init, "target" for a goal

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
        """The listed objects, each `size` metres wide, init first; None if none is listed. Raises ConfigError."""
        if not len(self):
            return None
        try:
            return from_lists(
                [each.spec(size, "real") for each in self.init], [each.spec(size, "target") for each in self.goal]
            )
        except LanguageError as error:
            raise ConfigError(f"init: {error}") from None

    def check(self, bounds: Sequence[float]) -> None:
        """Raises ConfigError for an area that reaches out of bounds (x0, x1, y0, y1, z0, z1), metres."""
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

    name: str
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
    verbs: list[str] = field(default_factory=list)  # verbs of the task that instructions use; empty: all
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
            self.says()
        except LanguageError as error:
            raise ConfigError(str(error)) from None
        if not self.nouns:
            raise ConfigError(f"nouns=[] must name at least one of {', '.join(NOUNS)}")
        if self.slots > self.most_slots:
            many = f"num_objects={self.num_objects} and num_targets={self.num_targets}"
            raise ConfigError(f"{many}: at most {self.most_slots} can be shown")
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

    def says(self) -> Split:
        """The split, with what it holds out. Raises LanguageError if no sentence is left."""
        return Split(self.split, self.held_out.held_out())


class Column(NamedTuple):
    """One number in the observation of each object: its name with its unit, and the bounds to which it is clipped."""

    name: str
    low: float
    high: float


@dataclass(frozen=True)
class EpisodeSpec:
    """The beginning of an episode in one world: a scene of K objects, the referent and the sentence."""

    scene: Scene  # its targets are see-through: they touch nothing, and stay where they are
    referent: int  # slot of the object that is meant
    kind: int  # index into the task's kind_names
    sentence: str
    heard: str | None = None  # the sentence that the policy reads; none: `sentence`
    yaw: Array | None = None  # (K,) radians; none: not turned
    fixed: NDArray[np.bool_] | None = None  # (K,) objects that never move when touched; none: all move
    gesture: Gesture | None = None  # how the person points at the referent; none: nobody points
    gesture_switch: GestureSwitch | None = None  # the finger moves on in mid-episode; none: it stays
    target: int | None = None  # slot of the target that the referent is to be brought to; none: to none
    start: GripperStart | None = None  # where the gripper begins; none: at rest
    goals: NDArray[np.bool_] | None = None  # (K,) where the referent could be brought; none: the see-through targets
    shapes: NDArray[np.int64] | None = None  # (K,) indices into the task's `shapes`; none: the nouns of the scene
    resting: NDArray[np.bool_] | None = None  # (K,) objects that begin at rest on top of others; none: none
    shares: Array | None = None  # (K,) in [0, 1], of the ranges of fittings and devices; none: all are at their start
    randomized: Randomized | None = None  # values of domain randomisation; none: it is off


class Said(NamedTuple):
    """An instruction in a scene. kind: index of its verb. heard: the sentence that the policy reads, if another."""

    kind: int
    referent: int
    target: int | None
    sentence: str
    heard: str | None


@dataclass(frozen=True)
class GripperStart:
    """The gripper begins at the referent: offset (3,) metres from where it would hold it; held: whether it holds it."""

    offset: Array
    held: bool


@dataclass(frozen=True)
class GestureSwitch:
    """The finger switches to another object. at: the control step before which it does; referent: its slot."""

    at: int
    referent: int
    gesture: Gesture


@dataclass
class State:
    """All worlds after a control step.

    gripper: (N, 3) metres. objects: (N, K, 3) metres. shown: (N, K). referent: (N,) slots.
    The other fields are empty in tasks that move nothing. target: (N,) slots. movable, goals: (N, K), which objects can
    be moved, and to which the referent could be brought. quaternions: (N, K, 4), x, y, z, w. held: (N,) slots, or -1.
    nouns: (N, K). kind: (N,) of the instruction. yaw: (N, K) radians about the vertical at which objects were placed.
    """

    gripper: Array
    objects: Array
    shown: NDArray[np.bool_]
    referent: NDArray[np.int64]
    target: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    movable: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 0), bool))
    goals: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 0), bool))
    quaternions: Array = field(default_factory=lambda: np.zeros((0, 0, 4)))
    held: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    nouns: NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 0), np.int64))
    kind: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    yaw: Array = field(default_factory=lambda: np.zeros((0, 0)))
