"""The state that the user interfaces of a session show besides the scene."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
OUTCOMES = ("success", "wrong object", "wrong target", "failed", "out of time")


@dataclass
class ViewStep:
    """A step of the plan that is carried out, in words. state: next, doing, done, failed or dropped."""

    words: str
    state: str = "next"


@dataclass(frozen=True)
class Intent:
    """What an actor would do now. action: (A,) in [-1, 1]. move: (3,) metres, of the gripper in this control step."""

    action: Array
    move: Array


@dataclass
class ViewState:
    """The state that is shown; K is the number of objects in the scene.

    status: the robot's present activity, or how the last instruction ended.
    sentence: the person's last sentence that is or was carried out, or "".
    steps: of the plan that is or was carried out; the list is another one for each plan.
    policy_sentence: the sentence that the policy is given, or "".
    highlighted: index of the referent, then of the target if there is one; () if nothing is being done.
    attention: (K,) in [0, 1], the policy's attention over the objects.
    pointing: (K,) probability that the finger points at each object, summing to 1.
    ray: origin (3,), metres, and unit direction (3,) of the finger's ray.
    intents: of the policy and the expert, by these names, if they are compared.
    rewards: sum of each reward term over the current subtask.
    outcome_counts: number of subtasks that ended with each of OUTCOMES.
    """

    status: str = "Say what to do, or point at something."
    sentence: str = ""
    steps: list[ViewStep] = field(default_factory=list)
    policy_sentence: str = ""
    highlighted: tuple[int, ...] = ()
    attention: Array | None = None
    pointing: Array | None = None
    ray: tuple[Array, Array] | None = None
    intents: dict[str, Intent] = field(default_factory=dict)
    rewards: dict[str, float] = field(default_factory=dict)
    outcome_counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(OUTCOMES, 0))
