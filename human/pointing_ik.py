"""Which joint angles put a target on the line through two points of a body. Numpy alone, so no body has to be moved.

The points hang on joints that turn one after the other; angles in radians, positions in metres in the frame in which
the chain was read.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ACCURACY = math.radians(0.02)  # between the line and the target
ITERATIONS = 15
MAX_TURN = 0.7  # radians that a joint turns in one iteration, or far steps overshoot
DAMPING = 1e-8
NEXT, LAST = np.array([1, 2, 0]), np.array([2, 0, 1])  # of a cross product's coordinates


@dataclass(frozen=True)
class AttachedPoint:
    """A place (3,) in the frame of a joint's child, whose index among the chain's joints is `joint`; -1: the ground."""

    joint: int
    place: Array


class _Miss(NamedTuple):
    """How far a target lies beside the line from rear through tip.

    beside: (2,) the sine of the angle at the tip between the line and the direction to the target; of more than a right
    angle, 1, or what lies behind would not miss. across: (2, 3) the units that it is taken along. sight: (3,) the unit
    towards the target, `far` metres away. ahead: the angle's cosine. length: metres from rear to tip.
    """

    beside: Array
    across: Array
    sight: Array
    far: float
    ahead: float
    length: float

    @classmethod
    def of(cls, ends: Array, target: Array) -> _Miss:
        """ends: (2, 3), tip and rear."""
        sight, far = _unit(target - ends[0])
        line, length = _unit(ends[0] - ends[1])
        across, ahead = _across(line), float(sight @ line)
        beside = across @ sight
        if ahead < 0:
            beside = beside / max(math.sqrt(beside @ beside), 1e-6)
        return cls(beside, across, sight, far, ahead, length)

    def slopes(self, ends: Array) -> Array:
        """The derivative (2, J) of beside; ends: (2, 3, J), that of tip and rear."""
        tip, rear = ends
        shifting = self.across @ (tip - self.sight[:, None] * (self.sight @ tip)) / self.far
        turning = self.across @ (tip - rear) / self.length
        return -shifting - turning * (self.ahead if self.ahead > 0.1 else 1.0)


class PointingChain:
    """Revolute joints, each after the one that carries it.

    parents: index of the joint that carries each; -1: the ground. steps: (J, 4, 4), from the parent's child frame to
    the joint's own at angle zero. axes: (J, 3) units in the joint's frame. low, high: (J,).
    """

    def __init__(self, parents: Sequence[int], steps: Array, axes: Array, low: Array, high: Array) -> None:
        self.parents, self.low, self.high = list(parents), low, high
        self._axes = axes[..., None]
        turn = np.zeros((len(axes), 4, 4))
        turn[:, :3, :3] = np.cross(np.eye(3), axes[:, None])  # by the axis, from the left
        # Rodrigues' formula: a joint's frame is still + sin * first + (1 - cos) * second.
        self._still, self._first, self._second = steps, steps @ turn, steps @ turn @ turn
        self._carried = np.array([[self._carries(j, k) for j in range(len(axes))] for k in [*range(len(axes)), -1]])

    def _carries(self, joint: int, descendant: int) -> bool:
        while descendant > joint:
            descendant = self.parents[descendant]
        return descendant == joint

    def frames(self, angles: Array) -> Array:
        """The joints' child frames (J, 4, 4) at angles (J,)."""
        sines, versines = np.sin(angles)[:, None, None], (1 - np.cos(angles))[:, None, None]
        frames = self._still + sines * self._first + versines * self._second
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                np.matmul(frames[parent], frames[joint], out=frames[joint])
        return frames

    def place(self, point: AttachedPoint, frames: Array) -> Array:
        if point.joint < 0:
            return point.place
        return frames[point.joint, :3, :3] @ point.place + frames[point.joint, :3, 3]

    def aim(self, start: Array, target: Array, tip: AttachedPoint, rear: AttachedPoint) -> tuple[Array, Array] | None:
        """Angles (J,) near `start` at which the line from rear through tip goes on through target (3,).

        Of the angles that do, those with the smallest sum of squared turns from `start`, as far as limits let them.
        With them where tip and rear then are, (2, 3). None where it does not get there.
        """
        angles = start
        for _ in range(ITERATIONS):
            frames = self.frames(angles)
            ends = np.array([self.place(tip, frames), self.place(rear, frames)])
            miss = _Miss.of(ends, target)
            if miss.beside @ miss.beside < ACCURACY**2:
                return angles, ends
            slopes = miss.slopes(self._slopes(frames, ends, (tip.joint, rear.joint)))
            turn = self._nearest(start, slopes, slopes @ angles - miss.beside) - angles
            angles = angles + turn * min(1.0, MAX_TURN / max(np.abs(turn).max(), 1e-9))
        return None

    def _slopes(self, frames: Array, ends: Array, joints: tuple[int, int]) -> Array:
        """(2, 3, J): how two points (2, 3) that hang on these joints move as the joints turn."""
        axes = (frames[:, :3, :3] @ self._axes)[..., 0].T
        arms = ends[:, :, None] - frames[:, :3, 3].T
        # np.cross takes three times as long.
        moved = axes.take(NEXT, 0) * arms.take(LAST, 1) - axes.take(LAST, 0) * arms.take(NEXT, 1)
        return moved * self._carried.take(joints, 0)[:, None]

    def _nearest(self, start: Array, slopes: Array, goal: Array) -> Array:
        """The angles nearest to start within the limits at which slopes @ angles = goal.

        A joint that would pass its limit is stopped there, and the others go on without it.
        """
        base, free = start, slopes
        for _ in range(len(start)):
            (a, b), (_, d) = (free @ free.T).tolist()
            wanted = (goal - slopes @ base).tolist()
            scale = 1 / ((a + DAMPING) * (d + DAMPING) - b * b)
            x, y = wanted[0] * scale, wanted[1] * scale
            angles = base + ((d + DAMPING) * x - b * y) * free[0] + ((a + DAMPING) * y - b * x) * free[1]
            kept = np.minimum(np.maximum(angles, self.low), self.high)
            stopped = kept != angles
            if not stopped.any():
                break
            base = np.where(stopped, kept, base)
            free = np.where(stopped, 0.0, free)
        return kept


def _unit(vector: Array) -> tuple[Array, float]:
    """Its direction and its length; of no length: of almost none."""
    length = max(math.sqrt(vector @ vector), 1e-9)
    return vector / length, length


def _across(line: Array) -> Array:
    """Two unit vectors (2, 3) that stand on the unit vector line (3,) and on each other."""
    x, y, z = line.tolist()
    sign = math.copysign(1.0, z)  # after Duff et al., "Building an Orthonormal Basis, Revisited", 2017
    a = -1.0 / (sign + z)
    b = x * y * a
    return np.array([[1.0 + sign * x * x * a, sign * b, -sign * x], [b, sign + y * y * a, -y]])
