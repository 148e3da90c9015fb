"""What every task has in common: what it declares, what an episode starts from, what a step means."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conf.schema import Checked, ConfigError, one_of, within
from language import KINDS, Scene

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class TaskConfig(Checked):
    """Lengths in metres, angles in radians, steps in control steps."""

    name: str
    num_objects: int = within(1, 8)  # slots
    min_objects: int = within(1, 8)  # an episode shows this many to num_objects
    kinds: list[str] = one_of(*KINDS)  # of sentences; none: no words
    radius: float = within(0.001, 1)
    hold_steps: int = within(1, 1000)
    max_steps: int = within(1, 100_000)
    object_size: float = within(0.01, 0.2)
    spacing: float = within(0, 1)  # between the centres of two objects, at reset
    reset_noise: float = within(0, 1)
    reward: dict[str, float] = within(-1000, 1000)  # the weight of each named term

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.min_objects > self.num_objects:
            raise ConfigError(f"min_objects={self.min_objects} must be at most num_objects={self.num_objects}")
        if self.spacing < 2 * self.radius and self.num_objects > 1:
            raise ConfigError(
                f"spacing={self.spacing} must be at least {2 * self.radius:g}, twice the radius, "
                "or the gripper could be at two objects at once"
            )
        if self.spacing < 1.5 * self.object_size and self.num_objects > 1:
            raise ConfigError(
                f"spacing={self.spacing} must be at least {1.5 * self.object_size:g}, 1.5 times the object_size, "
                "or objects would stand in each other"
            )


@dataclass(frozen=True)
class Episode:
    """What one world starts from. Only the first `len(scene)` slots are shown."""

    scene: Scene
    referent: int  # slot of the object that is meant
    kind: int  # index into the task's kind_names
    sentence: str


@dataclass
class State:
    """All worlds after a control step: gripper (N, 3), objects (N, K, 3), shown (N, K) bool, referent (N,) slots."""

    gripper: Array
    objects: Array
    shown: NDArray[np.bool_]
    referent: NDArray[np.int64]


@dataclass(frozen=True)
class Outcome:
    """What a control step came to, each (N,). terms: unweighted reward terms by name."""

    terms: dict[str, Array]
    success: NDArray[np.bool_]
    wrong_object: NDArray[np.bool_]
    at_goal: NDArray[np.bool_]
