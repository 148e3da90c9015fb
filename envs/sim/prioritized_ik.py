"""Inverse kinematics in which the position comes before the orientation, for arms that cannot always have both.

An arm of five joints reaches a place, but not with every orientation. A weighted sum of both errors would leave it
beside the place. Here the orientation gets only the motion that does not move the gripper: the gripper reaches the
place and tilts as little as it can. Joint limits are part of the problem: a joint at its limit is left out.

Sources: Siciliano and Slotine, "A general framework for managing multiple tasks in highly redundant robotic systems",
1991; Flacco, De Luca and Khatib, "Motion control of redundant robots under joint constraints: saturation in the null
space", 2012.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PASSES = 3  # joints that may stop at their limits in one step, one a pass
NULL_DAMPING = 1e-6  # of the null space's projector: so small that turning does not move the gripper
TURN_DAMPING = 0.1
MAX_TURN = 0.05  # radians that turning moves a joint in a step: more would move the gripper in second order
MAX_STEP = 0.3  # radians that a joint goes in a step: the Jacobian is good for about so much


def prioritized_step(joints: Array, jacobian: Array, move: Array, turn: Array, limits: Array, damping: float) -> Array:
    """One step (N, J) that moves the gripper by `move`, and turns it as far towards `turn` as that leaves free.

    Args:
        joints: (N, J) radians.
        jacobian: (N, 6, J), linear rows first.
        move: (N, 3) metres.
        turn: (N, 3) radians about each axis.
        limits: (2, J) lowest and highest joint angles.
        damping: of the least-squares solution for the position.
    """
    linear, angular = jacobian[:, :3], jacobian[:, 3:]
    delta, free = _moved(joints, linear, move, limits, damping)
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


def _moved(joints: Array, linear: Array, move: Array, limits: Array, damping: float) -> tuple[Array, Array]:
    """The step (N, J) for the position alone, and (N, J) 1 for each joint that is not at its limit after it, else 0.

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
    """The damped pseudoinverse (N, J, R) of matrices (N, R, J)."""
    transposed = matrix.transpose(0, 2, 1)
    return transposed @ np.linalg.inv(matrix @ transposed + _damped_identity(damping, matrix.shape[1]))


@cache
def _damped_identity(damping: float, size: int) -> Array:
    return damping**2 * np.eye(size)


def _solved(matrix: Array, task: Array, damping: float) -> Array:
    """The damped least-squares solution (N, J) of matrices (N, R, J) for tasks (N, R)."""
    return _product(_pseudoinverse(matrix, damping), task)


def _product(matrix: Array, vector: Array) -> Array:
    """Matrices (N, R, J) times vectors (N, J)."""
    return (matrix @ vector[..., None])[..., 0]


def _limited(delta: Array, most: float) -> Array:
    """delta (N, J), scaled so that no joint goes further than `most` radians."""
    return delta * np.minimum(1.0, most / np.maximum(np.abs(delta).max(1, keepdims=True), 1e-9))
