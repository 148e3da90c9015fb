"""The kinematics of an arm: forward kinematics, Jacobians, and inverse kinematics in steps.

An arm of five joints reaches a place, but not with every orientation. A weighted sum of both errors would leave it
beside the place. For such arms the position comes before the orientation (`prioritized_step`): the orientation gets
only the motion that does not move the gripper, so the gripper reaches the place and tilts as little as it can. Joint
limits are part of the problem: a joint at its limit is left out.

Sources: Siciliano and Slotine, "A general framework for managing multiple tasks in highly redundant robotic systems",
1991; Flacco, De Luca and Khatib, "Motion control of redundant robots under joint constraints: saturation in the null
space", 2012.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
PASSES = 3  # joints that may stop at their limits in one step, one a pass
NULL_DAMPING = 1e-6  # of the null space's projector: so small that turning does not move the gripper
TURN_DAMPING = 0.1
MAX_TURN = 0.05  # radians that turning moves a joint in a step: more would move the gripper in second order
MAX_STEP = 0.3  # radians that a joint goes in a step: the Jacobian is good for about so much
RESTING_STEPS = 200  # of inverse kinematics to another rest pose
# Components of the factors of a cross product: those that are added, then those that are subtracted.
LEFT, RIGHT = np.array([1, 2, 0, 2, 0, 1]), np.array([2, 0, 1, 1, 2, 0])


@dataclass(frozen=True)
class Pose:
    """position (N, 3) and rotation (N, 3, 3) of the gripper centre."""

    position: Array
    rotation: Array


class Kinematics:
    """J joints in a row, with one fixed transform before each and one after the last.

    Args:
        fixed: (J + 1, 4, 4) transforms from one joint's frame to the next (the last: to the gripper centre), at zero.
        axes: (J, 3) unit axes of rotation, or of sliding, in the joints' own frames.
        low, high: (J,) lowest and highest angles, radians; of joints that slide, metres.
        rest: (J,) angles at rest, radians, or metres.
        position_first: whether the gripper tilts where the arm cannot have both position and orientation.
        slides: (J,) which joints slide (prismatic); None: all of them turn.
    """

    def __init__(
        self,
        *,
        fixed: Array,
        axes: Array,
        low: Array,
        high: Array,
        rest: Array,
        position_first: bool = False,
        slides: NDArray[np.bool_] | None = None,
    ) -> None:
        self.low, self.high, self.rest = low, high, rest
        self._position_first = position_first
        self._axes = axes
        self._tool = fixed[-1]
        skew = np.zeros((len(axes), 3, 3))
        skew[:, [2, 0, 1], [1, 2, 0]] = axes
        skew[:, [1, 2, 0], [2, 0, 1]] = -axes
        # Rodrigues: fixed @ R(q) = constant + sine * sin(q) + cosine * cos(q), all three known beforehand.
        outer = axes[:, :, None] * axes[:, None, :]
        self._constant = fixed[:-1].copy()
        self._constant[:, :3, :3] = fixed[:-1, :3, :3] @ outer
        self._sine, self._cosine = np.zeros_like(self._constant), np.zeros_like(self._constant)
        self._sine[:, :3, :3] = fixed[:-1, :3, :3] @ skew
        self._cosine[:, :3, :3] = fixed[:-1, :3, :3] @ (np.eye(3) - outer)
        self._slides = slides if slides is not None and slides.any() else None
        if self._slides is not None:
            self._constant[self._slides] = fixed[:-1][self._slides]
            self._sine[self._slides] = self._cosine[self._slides] = 0.0
        self._ways = (fixed[:-1, :3, :3] @ axes[:, :, None])[:, None, :, 0]  # (J, 1, 3): where a joint slides to
        self._constant, self._sine, self._cosine = (
            part[:, None] for part in (self._constant, self._sine, self._cosine)
        )  # (J, 1, 4, 4), for any number of worlds

    def _frames(self, joints: Array) -> tuple[Array, Array]:
        """World transform of each joint's frame, (J, N, 4, 4), and of the gripper, (N, 4, 4)."""
        sine, cosine = (values.T[:, :, None, None] for values in (np.sin(joints), np.cos(joints)))
        local = self._constant + self._sine * sine + self._cosine * cosine
        if self._slides is not None:
            local[self._slides, :, :3, 3] += self._ways[self._slides] * joints.T[self._slides, :, None]
        for j in range(1, len(local)):
            local[j] = local[j - 1] @ local[j]
        return local, local[-1] @ self._tool

    def frames(self, joints: Array) -> Array:
        """(J + 1, N, 4, 4) the frames of the joints and of the gripper, for joints (N, J)."""
        local, gripper = self._frames(joints)
        return np.concatenate((local, gripper[None]))

    def forward(self, joints: Array) -> Pose:
        """joints (N, J) to the gripper's pose."""
        _, gripper = self._frames(joints)
        return Pose(gripper[:, :3, 3], gripper[:, :3, :3])

    def jacobian(self, joints: Array) -> tuple[Pose, Array]:
        """Return the gripper's pose and (N, 6, J): linear, then angular velocity for each unit joint velocity."""
        frames, gripper = self._frames(joints)
        by_world = frames.transpose(1, 0, 2, 3)
        axes = (by_world[:, :, :3, :3] @ self._axes[:, :, None])[..., 0]
        rows = np.empty((*joints.shape, 6))
        _cross(axes, gripper[:, None, :3, 3] - by_world[:, :, :3, 3], out=rows[:, :, :3])
        rows[:, :, 3:] = axes
        if self._slides is not None:
            rows[:, self._slides] = np.concatenate((axes, np.zeros_like(axes)), axis=2)[:, self._slides]
        return Pose(gripper[:, :3, 3], gripper[:, :3, :3]), rows.transpose(0, 2, 1)

    def step(
        self,
        joints: Array,
        position: Array,
        rotation: Array,
        *,
        max_move: float,
        seen: tuple[Pose, Array] | None = None,
        damping: float = 0.02,
    ) -> Array:
        """One damped least-squares step (N, J) from joints (N, J) towards position (N, 3) and rotation (..., 3, 3).

        The gripper moves at most max_move metres. Motion in the null space leads to the rest pose. seen: the result of
        `jacobian` for these joints, if it is known already.
        Source: Buss, "Introduction to inverse kinematics with Jacobian transpose, pseudoinverse and damped least
        squares methods", 2004.
        """
        pose, jacobian = seen or self.jacobian(joints)
        move = position - pose.position
        length = np.sqrt((move * move).sum(1, keepdims=True))
        move *= np.minimum(1.0, max_move / np.maximum(length, 1e-9))
        turn = _turn(pose.rotation, rotation)
        if self._position_first:
            limits = np.stack((self.low, self.high))
            delta = prioritized_step(joints, jacobian, move=move, turn=turn, limits=limits, damping=damping)
            # A second step from there: such an arm is short, and the Jacobian is valid for less than a control step.
            near, jacobian = self.jacobian(joints + delta)
            move, turn = move + pose.position - near.position, _turn(near.rotation, rotation)
            onward = prioritized_step(joints + delta, jacobian, move=move, turn=turn, limits=limits, damping=damping)
            return delta + onward
        task = np.concatenate((move, turn), axis=1)[..., None]
        transposed = jacobian.transpose(0, 2, 1)
        idle = 0.1 * (self.rest - joints)[..., None]
        gram = jacobian @ transposed + _damped_pose(damping)
        delta = idle + transposed @ np.linalg.solve(gram, task - jacobian @ idle)
        return delta[..., 0]

    def resting_at(self, position: Array) -> Kinematics:
        """Return the arm with another rest pose: its gripper at position (3,), metres, oriented as at rest now."""
        rotation, moved = self.forward(self.rest[None]).rotation[0], copy(self)
        moved.rest = self.solve(self.rest[None], position[None], rotation, RESTING_STEPS)[0]
        return moved

    def solve(self, joints: Array, position: Array, rotation: Array, iterations: int = 30) -> Array:
        """Joints (N, J) that bring the gripper to position (N, 3) and rotation (..., 3, 3), starting from `joints`."""
        for _ in range(iterations):
            step = self.step(joints, position, rotation, max_move=0.2)
            joints = np.clip(joints + step, self.low, self.high)
        return joints


def _turn(rotation: Array, goal: Array) -> Array:
    """(N, 3) the rotation vector from rotations (N, 3, 3) to goal (..., 3, 3), to first order."""
    return 0.5 * _cross(rotation.transpose(0, 2, 1), np.swapaxes(goal, -1, -2)).sum(1)


def _cross(a: Array, b: Array, out: Array | None = None) -> Array:
    """np.cross over the last axis, without its overhead."""
    products = a.take(LEFT, -1) * b.take(RIGHT, -1)
    return np.subtract(products[..., :3], products[..., 3:], out=out)


@cache
def _damped_pose(damping: float) -> Array:
    return damping**2 * np.eye(6)


# ---- position before orientation


def prioritized_step(
    joints: Array, jacobian: Array, *, move: Array, turn: Array, limits: Array, damping: float
) -> Array:
    """Return one step (N, J) that moves the gripper by `move`, and turns it as far towards `turn` as that leaves free.

    Args:
        joints: (N, J) radians.
        jacobian: (N, 6, J), linear rows first.
        move: (N, 3) metres.
        turn: (N, 3) radians about each axis.
        limits: (2, J) lowest and highest joint angles.
        damping: of the least-squares solution for the position.
    """
    linear, angular = jacobian[:, :3], jacobian[:, 3:]
    delta, free = _moved(joints, linear, move=move, limits=limits, damping=damping)
    stops = np.ones_like(free, bool)
    for _ in range(PASSES):
        if stops.any():  # else the matrices are those of the last pass
            inverse = _pseudoinverse(_without_moving(linear, angular, free), TURN_DAMPING)
        change = _limited(_product(inverse, turn - _product(angular, delta)), MAX_TURN)
        share = _share_to_limits(joints + delta, change, limits)
        least = share.min(1, keepdims=True)
        delta = delta + least * change
        stops = (share < 1) & (share <= least)
        free = np.where(stops, 0.0, free)
    return _limited(delta, MAX_STEP)


def _moved(joints: Array, linear: Array, *, move: Array, limits: Array, damping: float) -> tuple[Array, Array]:
    """Return the step (N, J) for the position alone, and (N, J) 1 for joints that are not at their limits after it.

    A joint that would go beyond its limit stops there, and the others make up for it.
    """
    free, stopped = np.ones_like(joints), np.zeros_like(joints)
    for _ in range(PASSES):
        delta = stopped + _solved(linear * free[:, None], move - _product(linear, stopped), damping)
        allowed = np.clip(joints + delta, *limits) - joints
        beyond = np.abs(delta - allowed) > 1e-9
        if not beyond.any():  # another pass would give the same
            break
        free, stopped = np.where(beyond, 0.0, free), np.where(beyond, allowed, stopped)
    return delta, free


def _without_moving(linear: Array, angular: Array, free: Array) -> Array:
    """(N, 3, J) how the free joints turn the gripper by motion that leaves it where it is."""
    usable, turning = linear * free[:, None], angular * free[:, None]
    return turning - turning @ _pseudoinverse(usable, NULL_DAMPING) @ usable


def _share_to_limits(joints: Array, change: Array, limits: Array) -> Array:
    """(N, J) the share in [0, 1] of change (N, J) after which each joint is at its limit; 1 where it gets to none."""
    moves = np.abs(change) > 1e-9
    room = np.where(change > 0, limits[1], limits[0]) - joints
    return np.where(moves, np.clip(room / np.where(moves, change, 1.0), 0.0, 1.0), 1.0)


def _pseudoinverse(matrix: Array, damping: float) -> Array:
    """Return the damped pseudoinverse (N, J, R) of matrices (N, R, J)."""
    transposed = matrix.transpose(0, 2, 1)
    return transposed @ np.linalg.inv(matrix @ transposed + _damped_identity(damping, matrix.shape[1]))


@cache
def _damped_identity(damping: float, size: int) -> Array:
    return damping**2 * np.eye(size)


def _solved(matrix: Array, task: Array, damping: float) -> Array:
    """Return the damped least-squares solution (N, J) of matrices (N, R, J) for tasks (N, R)."""
    return _product(_pseudoinverse(matrix, damping), task)


def _product(matrix: Array, vector: Array) -> Array:
    """Matrices (N, R, J) times vectors (N, J)."""
    return (matrix @ vector[..., None])[..., 0]


def _limited(delta: Array, most: float) -> Array:
    """delta (N, J), scaled so that no joint goes further than `most` radians."""
    return delta * np.minimum(1.0, most / np.maximum(np.abs(delta).max(1, keepdims=True), 1e-9))
