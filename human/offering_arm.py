"""The arm that holds out an open hand: joint angles at which the palm lies at a place and faces up.

NumPy alone, like `human/pointing_arm.py`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from human.pointing_arm import Unreachable
from human.pointing_ik import Array, AttachedPoint, PointingChain

JOINTS = (
    "l_shoulder_flexion",
    "l_shoulder_abduction",
    "l_shoulder_rotation",
    "l_elbow_flexion",
    "l_forearm_pronation",
    "l_wrist_flexion",
    "l_wrist_deviation",
)
REST = np.array([0.9, 0.1, -0.2, 0.8, -1.2, 0.2, 0.0])  # radians, of JOINTS: solutions are near this posture
HAND = len(JOINTS) - 1  # the joint that carries the hand
PALM = np.array([0.0, -0.018, -0.055])  # metres in the hand's frame: the middle of the palm's surface
NORMAL = np.array([0.0, -0.1, 0.0])  # metres in the hand's frame, away from the palm
UP = np.array([0.0, 0.0, 0.1])  # metres: the direction of NORMAL if the palm faces up
TOLERANCE = 2e-3  # metres, of the palm and of the end of its normal
MAX_ITERATIONS, MAX_TURN, DAMPING = 150, 0.3, 1e-6  # radians that a joint may turn in one iteration
NULLSPACE_GAIN = 0.1  # share of the way to REST that joints turn in an iteration, as far as the palm does not move


class OfferingArm:
    """The left arm of a person who stands at a fixed place. chain: its seven joints, `JOINTS`."""

    def __init__(self, chain: PointingChain) -> None:
        self._chain = chain

    def solve(self, place: ArrayLike) -> Array:
        """Returns joint angles (7,) at which the palm's middle is at place (3,), metres, and the palm faces up.

        Of several solutions it takes one near REST. Raises Unreachable.
        """
        goal, angles = np.asarray(place, np.float64), REST
        for _ in range(MAX_ITERATIONS):
            frames = self._chain.frames(angles)
            palm, end = (self._chain.place(AttachedPoint(HAND, point), frames) for point in (PALM, PALM + NORMAL))
            error = np.concatenate((goal - palm, UP - (end - palm)))
            if np.abs(error).max() < TOLERANCE:
                return angles
            moved, moved_end = self._chain.point_jacobians(frames, np.array([palm, end]), (HAND, HAND))
            turn = _towards(error, np.concatenate((moved, moved_end - moved)), NULLSPACE_GAIN * (REST - angles))
            turn *= min(1.0, MAX_TURN / max(np.abs(turn).max(), 1e-9))
            angles = np.clip(angles + turn, self._chain.low, self._chain.high)
        x, y, z = goal.tolist()
        raise Unreachable(f"palm=({x:.3f}, {y:.3f}, {z:.3f}) m: the person cannot hold an open hand there")


def _towards(error: Array, jacobian: Array, wish: Array) -> Array:
    """Returns the joint step (J,) that reduces `error` (6,) by damped least squares, and `wish` (J,) in the null space.

    jacobian: (6, J).
    """
    inverse = jacobian.T @ np.linalg.inv(jacobian @ jacobian.T + DAMPING * np.eye(len(error)))
    return np.asarray(inverse @ error + wish - inverse @ (jacobian @ wish))
