"""Inverse kinematics of pointing: joint angles at which the line through two points of a body meets a target.

NumPy alone, so no simulated body has to be moved. The two points hang on revolute joints in series. Angles are in
radians; positions are in metres in the frame in which the chain was read.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TOLERANCE = math.radians(0.02)  # largest angle between the line and the target
MAX_ITERATIONS = 15
MAX_TURN = 0.7  # radians that a joint may turn in one iteration; larger steps overshoot
DAMPING = 1e-8
NEXT, LAST = np.array([1, 2, 0]), np.array([2, 0, 1])  # cyclic coordinate shifts of a cross product


@dataclass(frozen=True)
class AttachedPoint:
    """A point (3,) in the child frame of joint number `joint` of the chain; joint -1 is the fixed ground."""

    joint: int
    place: Array


class _PointingError(NamedTuple):
    """The angular error of the line from `rear` through `tip`, seen from the tip.

    sine: (2,) sine of the angle between the line and the direction to the target. Beyond a right angle its norm is
        1; otherwise a target behind the hand would have no error.
    across: (2, 3) unit vectors in which the sine is expressed.
    sight: (3,) unit vector from the tip to the target.
    distance: metres from the tip to the target.
    cosine: of the same angle.
    length: metres from the rear point to the tip.
    """

    sine: Array
    across: Array
    sight: Array
    distance: float
    cosine: float
    length: float

    @classmethod
    def of(cls, ends: Array, target: Array) -> _PointingError:
        """ends: (2, 3), the tip and the rear point. target: (3,)."""
        sight, distance = _unit(target - ends[0])
        line, length = _unit(ends[0] - ends[1])
        across, cosine = _orthonormal_pair(line), float(sight @ line)
        sine = across @ sight
        if cosine < 0:
            sine = sine / max(math.sqrt(sine @ sine), 1e-6)
        return cls(sine, across, sight, distance, cosine, length)

    def jacobian(self, ends: Array) -> Array:
        """Returns (2, J), the derivative of `sine` by the joint angles; ends: (2, 3, J), those of tip and rear."""
        tip, rear = ends
        from_shift = self.across @ (tip - self.sight[:, None] * (self.sight @ tip)) / self.distance
        from_turn = self.across @ (tip - rear) / self.length
        return -from_shift - from_turn * (self.cosine if self.cosine > 0.1 else 1.0)


class PointingChain:
    """Revolute joints, each carried by an earlier joint or by the ground.

    Attributes:
        parents: for each joint, the index of the joint that carries it; -1: the ground.
        low, high: (J,) joint limits.
    """

    def __init__(self, parents: Sequence[int], steps: Array, axes: Array, low: Array, high: Array) -> None:
        """Builds the chain of J joints.

        Args:
            parents: for each joint, the index of the joint that carries it; -1: the ground.
            steps: (J, 4, 4) transforms from the parent's child frame to the joint's own frame at angle zero.
            axes: (J, 3) unit vectors in the joint's frame.
            low, high: (J,) joint limits.
        """
        self.parents, self.low, self.high = list(parents), low, high
        self._axes = axes[..., None]
        cross = np.zeros((len(axes), 4, 4))
        cross[:, :3, :3] = np.cross(np.eye(3), axes[:, None])  # matrix of the cross product with the axis
        # Rodrigues' formula: a joint's frame is still + sin * first + (1 - cos) * second.
        self._still, self._first, self._second = steps, steps @ cross, steps @ cross @ cross
        self._carried = np.array([[self._carries(j, k) for j in range(len(axes))] for k in [*range(len(axes)), -1]])

    def _carries(self, joint: int, descendant: int) -> bool:
        while descendant > joint:
            descendant = self.parents[descendant]
        return descendant == joint

    def frames(self, angles: Array) -> Array:
        """Returns the joints' child frames, (J, 4, 4), at angles (J,)."""
        sines, versines = np.sin(angles)[:, None, None], (1 - np.cos(angles))[:, None, None]
        frames = self._still + sines * self._first + versines * self._second
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                np.matmul(frames[parent], frames[joint], out=frames[joint])
        return frames

    def place(self, point: AttachedPoint, frames: Array) -> Array:
        """Returns the position (3,) of a point, given the child frames (J, 4, 4)."""
        if point.joint < 0:
            return point.place
        return frames[point.joint, :3, :3] @ point.place + frames[point.joint, :3, 3]

    def solve(self, start: Array, target: Array, tip: AttachedPoint, rear: AttachedPoint) -> tuple[Array, Array] | None:
        """Finds angles near `start` at which the line from `rear` through `tip` goes on through the target.

        Among the solutions it takes the one with the smallest sum of squared turns from `start`, within the limits.

        Args:
            start: (J,) angles.
            target: (3,) metres.
            tip, rear: the points that define the line.

        Returns:
            Angles (J,) and the positions (2, 3) of tip and rear at these angles; None without convergence.
        """
        angles = start
        for _ in range(MAX_ITERATIONS):
            frames = self.frames(angles)
            ends = np.array([self.place(tip, frames), self.place(rear, frames)])
            error = _PointingError.of(ends, target)
            if error.sine @ error.sine < TOLERANCE**2:
                return angles, ends
            jacobian = error.jacobian(self.point_jacobians(frames, ends, (tip.joint, rear.joint)))
            turn = self._nearest(start, jacobian, jacobian @ angles - error.sine) - angles
            angles = angles + turn * min(1.0, MAX_TURN / max(np.abs(turn).max(), 1e-9))
        return None

    def point_jacobians(self, frames: Array, points: Array, joints: tuple[int, int]) -> Array:
        """Returns (2, 3, J), the derivatives of two points (2, 3) that hang on these joints by the joint angles."""
        axes = (frames[:, :3, :3] @ self._axes)[..., 0].T
        arms = points[:, :, None] - frames[:, :3, 3].T
        # np.cross takes three times as long.
        moved = axes.take(NEXT, 0) * arms.take(LAST, 1) - axes.take(LAST, 0) * arms.take(NEXT, 1)
        return moved * self._carried.take(joints, 0)[:, None]

    def _nearest(self, start: Array, jacobian: Array, goal: Array) -> Array:
        """Returns the angles nearest to `start`, within the limits, at which jacobian @ angles = goal.

        A joint that would pass its limit is fixed there, and the remaining joints are solved again.
        """
        base, free = start, jacobian
        for _ in range(len(start)):
            (a, b), (_, d) = (free @ free.T).tolist()
            wanted = (goal - jacobian @ base).tolist()
            scale = 1 / ((a + DAMPING) * (d + DAMPING) - b * b)
            x, y = wanted[0] * scale, wanted[1] * scale
            angles = base + ((d + DAMPING) * x - b * y) * free[0] + ((a + DAMPING) * y - b * x) * free[1]
            clipped = np.minimum(np.maximum(angles, self.low), self.high)
            at_limit = clipped != angles
            if not at_limit.any():
                break
            base = np.where(at_limit, clipped, base)
            free = np.where(at_limit, 0.0, free)
        return clipped


def _unit(vector: Array) -> tuple[Array, float]:
    """Returns the vector's direction and length; the length is at least 1e-9, so that a zero vector does not divide."""
    length = max(math.sqrt(vector @ vector), 1e-9)
    return vector / length, length


def _orthonormal_pair(line: Array) -> Array:
    """Returns two unit vectors (2, 3), orthogonal to the unit vector `line` and to each other.

    Source: Duff et al., "Building an Orthonormal Basis, Revisited", 2017.
    """
    x, y, z = line.tolist()
    sign = math.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    return np.array([[1.0 + sign * x * x * a, sign * b, -sign * x], [b, sign + y * y * a, -y]])
