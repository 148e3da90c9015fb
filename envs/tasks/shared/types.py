"""What tasks and environment hand to each other: traits of a task, episodes, states, and outcomes of control steps."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from human import PointingGesture
from language import Scene

Array = NDArray[np.float64]
NOTHING = -1  # in place of a slot: the gripper is empty


@dataclass(frozen=True, kw_only=True)
class TaskTraits:
    """What kind of task a class is. Environment, experts and demo read it in place of the class.

    Attributes:
        speaks: episodes have sentences. In tasks that move objects it follows from `task.kinds`.
        moves: the task moves objects, not only the gripper; observations have columns for that.
        grips: one more number of the action closes the gripper.
        turns: one more number of the action turns the gripper about the vertical.
        places: the referent is to be brought to a goal. It follows from the number of goals.
        real_goals: goals are real objects, not see-through targets.
        operates: all objects are devices; their positions are those of their handles.
        stacks: objects stand in the cells of a board, on top of each other.
        marks: the first of the task's columns marks the referent where no words name it.
        continues: after a success there can be another instruction.
        stepwise: an episode is one sentence of several steps, each an instruction, and succeeds with the last one.
        fails: an episode also ends once success has become impossible, as `failed`.
    """

    speaks: bool = False
    moves: bool = False
    grips: bool = False
    turns: bool = False
    places: bool = False
    real_goals: bool = False
    operates: bool = False
    stacks: bool = False
    marks: bool = False
    continues: bool = False
    stepwise: bool = False
    fails: bool = False


class Column(NamedTuple):
    """One number in the observation of each object: its name with its unit, and the bounds to which it is clipped."""

    name: str
    low: float
    high: float


# ---- an episode


@dataclass(frozen=True, kw_only=True)
class Randomized:
    """The values of one episode. mass, friction: factors. delay: control steps. noise: seed of its noise."""

    mass: float
    friction: float
    delay: int
    noise: int


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
    gesture: PointingGesture


@dataclass(frozen=True, kw_only=True)
class EpisodeSpec:
    """The beginning of an episode in one world: a scene of K objects, the referent and the sentence."""

    scene: Scene  # its targets are see-through: they touch nothing, and stay where they are
    referent: int  # slot of the object that is meant
    kind: int = 0  # index into the task's kind_names
    sentence: str = ""
    heard: str | None = None  # the sentence that the policy reads; none: `sentence`
    yaw: Array | None = None  # (K,) radians; none: not turned
    fixed: NDArray[np.bool_] | None = None  # (K,) objects that never move when touched; none: all move
    gesture: PointingGesture | None = None  # how the person points at the referent; none: nobody points
    gesture_switch: GestureSwitch | None = None  # the finger moves on in mid-episode; none: it stays
    target: int | None = None  # slot of the target that the referent is to be brought to; none: to none
    start: GripperStart | None = None  # where the gripper begins; none: at rest
    goals: NDArray[np.bool_] | None = None  # (K,) where the referent could be brought; none: the see-through targets
    shapes: NDArray[np.int64] | None = None  # (K,) indices into the task's `shapes`; none: the nouns of the scene
    resting: NDArray[np.bool_] | None = None  # (K,) objects that begin at rest on top of others; none: none
    shares: Array | None = None  # (K,) in [0, 1], of the ranges of fittings and devices; none: all are at their start
    randomized: Randomized | None = None  # values of domain randomisation; none: it is off


@dataclass(frozen=True, kw_only=True)
class GivenInstruction:
    """An instruction that was given in a scene.

    kind: index into the task's kind_names. referent, target: numbers of objects; target None: there is none.
    heard: the sentence that the policy reads; None: `sentence`.
    """

    kind: int
    referent: int
    target: int | None
    sentence: str
    heard: str | None


# ---- a control step


@dataclass(kw_only=True)
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


@dataclass(frozen=True, kw_only=True)
class StepOutcome:
    """Outcome of a control step, (N,) each. terms: unweighted reward terms by name.

    wrong_target: the referent was brought to another target; None if the task has no targets.
    failed: success has become impossible in another way; None if the task cannot fail so.
    """

    terms: dict[str, Array]
    success: NDArray[np.bool_]
    wrong_object: NDArray[np.bool_]
    at_goal: NDArray[np.bool_]
    wrong_target: NDArray[np.bool_] | None = None
    failed: NDArray[np.bool_] | None = None

    @property
    def terminated(self) -> NDArray[np.bool_]:
        """(N,) whether the instruction has ended in success or failure; time limits do not count."""
        ends = (self.success, self.wrong_object, self.wrong_target, self.failed)
        return np.any([flags for flags in ends if flags is not None], axis=0)
