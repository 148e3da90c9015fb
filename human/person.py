"""The person as tasks use them: they show gestures for given targets, with aiming errors and dropouts."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from human.body import read_arm
from human.config import GestureConfig, HumanConfig
from human.pointing import Array, add_aiming_noise

MAX_REACH = 3.0  # limit of the aim distance, as a multiple of the distance to the target (`_aim_distance`)


@dataclass(frozen=True)
class PointingGesture:
    """A posture of the arm and the ray from its fingertip.

    joints: (J,) radians. origin: (3,) metres. direction: (3,), a unit vector.
    shown: whether the arm is raised. For a lowered arm, the ray is the one that the person would have shown.
    """

    joints: Array
    origin: Array
    direction: Array
    shown: bool = True


class Person:
    """A person who computes gestures; nothing moves. Raises ConfigError for a body that cannot be loaded."""

    def __init__(self, human: HumanConfig, config: GestureConfig) -> None:
        self.config, self._arm = config, read_arm(human)
        self.eyes = self._arm.eyes

    def aim(self, target: ArrayLike) -> PointingGesture:
        """Return the exact gesture, whose ray goes through target (3,), metres. Raises Unreachable."""
        return PointingGesture(*self._arm.aim(target, self.config.style))

    def show(
        self, target: ArrayLike, rng: Generator, exact: PointingGesture | None = None, always: bool = False
    ) -> PointingGesture:
        """Return a gesture for the target with this person's errors: aiming noise, and sometimes no gesture.

        Args:
            target: (3,) metres.
            rng: source of the errors.
            exact: the result of `aim` for the target, if known.
            always: whether a gesture is certainly shown.

        Raises:
            Unreachable: no posture points at the target, or at the place to which the noise moves it.
        """
        exact = exact or self.aim(target)
        shown = bool(rng.random() >= self.config.dropout) or always
        direction = add_aiming_noise(exact.direction, self.config.noise_deg, rng)
        if not shown:
            return PointingGesture(self._arm.hanging, exact.origin, exact.direction, shown=False)
        if self.config.noise_deg == 0:
            return exact
        distance = _aim_distance(exact.origin, direction, np.asarray(target, np.float64))
        return self.aim(exact.origin + direction * distance)


def _aim_distance(origin: Array, direction: Array, target: Array) -> float:
    """Return metres along the noisy ray at which the finger is aimed: up to the target's height.

    The posture depends slightly on the distance of its aim. If that distance were always the target's, the posture
    would reveal which of several objects at one height is the referent, beyond the information in the ray. Rays that do
    not reach the target's height within MAX_REACH times the target's distance are aimed at the target's distance.
    """
    far = float(np.linalg.norm(target - origin))
    level = float((target - origin)[2] / direction[2]) if direction[2] != 0 else math.inf
    return level if 0 < level < MAX_REACH * far else far
