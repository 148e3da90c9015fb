"""Rigid transforms, and a robust least-squares fit of several of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
HUBER = 2.0  # in typical residuals, beyond which a point's weight falls
FLOOR = 0.05  # pixels: a smaller typical residual is taken for this
ITERATIONS = 40
STEP = 1e-6  # radians and metres, of the numeric derivatives


@dataclass(frozen=True)
class RobustFit:
    """A fit of transforms to N points.

    transforms: (4, 4) each. covariance: of the free components, six of each transform: turn, radians, then move,
    metres, in the transform's target frame. offsets: (N, 2) pixels, from where points are seen to where they should be.
    """

    transforms: list[Array]
    covariance: Array
    offsets: Array

    @property
    def errors(self) -> Array:
        """(N,) the lengths of the offsets, pixels."""
        return np.linalg.norm(self.offsets, axis=1)

    @property
    def rms(self) -> float:
        """The root mean square of the errors, pixels."""
        return float(np.sqrt((self.errors**2).mean()))


def transform(turn: Array, move: Array) -> Array:
    """Return the (4, 4) transform of a rotation vector or matrix, and a translation."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation(turn) if np.shape(turn) == (3,) else turn
    matrix[:3, 3] = move
    return matrix


def rotation(vector: Array) -> Array:
    """Return the rotation (3, 3) about a vector (3,) by its length, radians (Rodrigues)."""
    x, y, z = vector
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = float(np.linalg.norm(vector))
    if angle < 1e-8:
        return np.eye(3) + skew
    return np.eye(3) + np.sin(angle) / angle * skew + (1 - np.cos(angle)) / angle**2 * (skew @ skew)


def angle_of(matrix: Array) -> float:
    """Return the angle of a rotation (3, 3), radians."""
    off = np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])
    return float(np.arctan2(np.linalg.norm(off) / 2, (np.trace(matrix) - 1) / 2))


def rotation_vector(matrix: Array) -> Array:
    """Return the rotation vector (3,), radians, of a rotation (3, 3) of less than half a turn."""
    off = np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])
    length = float(np.linalg.norm(off))
    return off * (angle_of(matrix) / length if length > 1e-9 else 0.5)


def inverse(matrix: Array) -> Array:
    """Return the inverse of a rigid transform (4, 4)."""
    return transform(matrix[:3, :3].T, -matrix[:3, :3].T @ matrix[:3, 3])


def mean_rotation(rotations: Array) -> Array:
    """Return the rotation (3, 3) nearest to the mean of rotations (N, 3, 3)."""
    left, _, right = np.linalg.svd(np.mean(rotations, axis=0))
    return left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right


def applied(matrix: Array, points: Array) -> Array:
    """Return points (N, 3) after a rigid transform (4, 4)."""
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def fit(
    offsets: Callable[[Sequence[Array]], Array],
    start: Sequence[Array],
    free: Sequence[bool] | None = None,
    iterations: int = ITERATIONS,
) -> RobustFit:
    """Fit transforms by Levenberg's and Marquardt's method with Huber's weights.

    Args:
        offsets: transforms to the distances (N, 2) of points from where they are seen, pixels.
        start: the first guess.
        free: for each of the six components of each transform, whether it may change; None: all.
        iterations: at most.
    """
    chosen = np.flatnonzero(np.ones(6 * len(start), bool) if free is None else np.asarray(free))
    now, damping = [each.copy() for each in start], 1e-3
    error = offsets(now)
    for _ in range(iterations):
        weights = _weights(error)
        jacobian = _jacobian(offsets, now, chosen, error)
        weighted = jacobian * weights[:, None]
        normal, gradient = jacobian.T @ weighted, weighted.T @ error.ravel()
        cost = float(weights @ error.ravel() ** 2)
        damped = normal + damping * np.diag(np.diag(normal) + 1e-12)
        step = np.asarray(np.linalg.lstsq(damped, -gradient, rcond=None)[0], np.float64)
        tried = _moved(now, chosen, step)
        after = offsets(tried)
        if np.isfinite(after).all() and float(weights @ after.ravel() ** 2) <= cost:
            now, error, damping = tried, after, max(damping / 5, 1e-9)
            if np.abs(step).max() < 1e-8:
                break
        else:
            damping *= 5
            if damping > 1e6:
                break
    return RobustFit(now, _covariance(_jacobian(offsets, now, chosen, error), error), error)


def _weights(error: Array) -> Array:
    """Return Huber's weights (2 N,) of distances (N, 2)."""
    lengths = np.linalg.norm(error, axis=1)
    typical = max(float(np.median(lengths)), FLOOR)
    return np.repeat(np.minimum(1.0, HUBER * typical / np.maximum(lengths, 1e-12)), 2)


def _covariance(jacobian: Array, error: Array) -> Array:
    weights = _weights(error)
    free = max(1, 2 * len(error) - jacobian.shape[1])
    variance = max(float(weights @ error.ravel() ** 2) / free, FLOOR**2)
    return variance * np.linalg.pinv(jacobian.T @ (jacobian * weights[:, None]))


def _jacobian(
    offsets: Callable[[Sequence[Array]], Array], now: Sequence[Array], chosen: NDArray[np.intp], error: Array
) -> Array:
    columns = []
    for index in range(len(chosen)):
        step = np.zeros(len(chosen))
        step[index] = STEP
        columns.append((offsets(_moved(now, chosen, step)) - offsets(_moved(now, chosen, -step))).ravel() / (2 * STEP))
    return np.column_stack(columns) if columns else np.zeros((error.size, 0))


def _moved(now: Sequence[Array], chosen: NDArray[np.intp], step: Array) -> list[Array]:
    """Return transforms after small turns and moves, in the frame into which they transform."""
    whole = np.zeros(6 * len(now))
    whole[chosen] = step
    return [
        transform(rotation(part[:3]) @ each[:3, :3], each[:3, 3] + part[3:])
        for each, part in zip(now, whole.reshape(-1, 6), strict=True)
    ]
