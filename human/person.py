"""The person as a task knows them: asked to point at a place, they show a gesture, with the errors people make."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from human.body.pybullet_body import read_arm
from human.config import GestureConfig, HumanConfig
from human.pointing import Array, add_aiming_noise

FARTHEST = 3.0  # times as far as the target: where a finger that strays upwards meets the target's height no sooner


@dataclass(frozen=True)
class Gesture:
    """An arm (J,), radians, and the ray from its fingertip: origin (3,), metres, and unit direction (3,).

    shown: is the arm raised? Where it hangs, the ray is the one that it would have shown.
    """

    joints: Array
    origin: Array
    direction: Array
    shown: bool = True


class Person:
    """Somebody who is only ever asked how they would point. Raises ConfigError."""

    def __init__(self, human: HumanConfig, config: GestureConfig) -> None:
        self.config, self._arm = config, read_arm(human)
        self.eyes = self._arm.eyes

    def aim(self, target: ArrayLike) -> Gesture:
        """The gesture whose ray goes through target (3,), metres. Raises Unreachable."""
        return Gesture(*self._arm.aim(target, self.config.style))

    def show(self, target: ArrayLike, rng: Generator, exact: Gesture | None = None, always: bool = False) -> Gesture:
        """The gesture for target (3,), metres, as this person makes it: strayed, or not shown, unless it `always` is.

        exact: what `aim` gives for the target, where it is known already. Raises Unreachable.
        """
        exact = exact or self.aim(target)
        shown = bool(rng.random() >= self.config.dropout) or always
        direction = add_aiming_noise(exact.direction, self.config.noise_deg, rng)
        if not shown:
            return Gesture(self._arm.hanging, exact.origin, exact.direction, shown=False)
        if self.config.noise_deg == 0:
            return exact
        return self.aim(exact.origin + direction * _reach(exact.origin, direction, np.asarray(target, np.float64)))


def _reach(origin: Array, direction: Array, target: Array) -> float:
    """Metres along the ray at which the finger is aimed: to the target's height, or as far as the target is.

    The posture shows, faintly, how far away its aim is. As far as the target in all cases, that would tell which of
    several objects at one height is meant, beyond what the ray does.
    """
    far = float(np.linalg.norm(target - origin))
    level = float((target - origin)[2] / direction[2]) if direction[2] != 0 else math.inf
    return level if 0 < level < FARTHEST * far else far
