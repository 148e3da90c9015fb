"""Fittings of the workspace over control steps: each is followed along its joint."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.perception.config import PerceptionConfig
from envs.perception.detections import Array, Detections
from envs.sim.workspace import Fitting
from language import COLORS

LEAST = 1e-3  # probability that counts as impossible
KEPT = 0.9  # share of earlier evidence that the next picture leaves
NOISE = 0.001  # metres, standard deviation that every measured place has at least: of the cameras' calibration
JUMP = 6.0  # cost of a thing that has been moved: half the square of a Mahalanobis distance
NEAR = 0.12  # metres from the gripper's centre within which things may be moved
ON_JOINT = 0.06  # metres beside the way of a fitting's handle within which a detection is of that handle


class FollowedFitting:
    """A fitting whose share is followed along its joint. It is there in any case: the furniture is known.

    share: in [0, 1], how far it is open. color: the likeliest.
    """

    def __init__(self, fitting: Fitting) -> None:
        self._fitting, self.share, self._variance, self._strayed = fitting, 0.0, np.inf, False
        self._colors = np.zeros(len(COLORS))

    @property
    def handle(self) -> Array:
        """(3,) the place of its handle, metres."""
        return self._fitting.handle_at(self._fitting.value(self.share))

    @property
    def quaternion(self) -> Array:
        """(4,) of its handle."""
        half = float(self._fitting.value(self.share)) / 2 if self._fitting.joint == "turn" else 0.0
        return np.append(np.sin(half) * np.array(self._fitting.axis), np.cos(half))

    @property
    def color(self) -> int:
        return int(self._colors.argmax())

    @property
    def slides(self) -> bool:
        """Whether its contents move with it."""
        return self._fitting.joint == "slide"

    def holds(self, places: Array) -> NDArray[np.bool_]:
        """(T,) whether places (T, 3), metres, are in it."""
        if not self._fitting.inside:
            return np.zeros(len(places), bool)
        low, high = self._fitting.inside_at(np.array(self.share))
        return np.asarray(((places >= low) & (places <= high)).all(1))

    def carry(self, handle: Array) -> None:
        """Move it to where the gripper has taken its handle, (3,) metres."""
        self.share = float(np.clip(self._fitting.share(handle), 0.0, 1.0))

    def update(self, seen: Detections, gripper: Array, config: PerceptionConfig, *, held: bool = False) -> None:
        """Take what is seen of it after a control step, if anything.

        held: the gripper holds its handle, and hides it in part: where the gripper took it counts more than pictures.
        """
        metres = self._metres()
        near = float(length(self.handle - gripper)) < NEAR and not held
        self._variance += ((config.motion if near or self._strayed else config.drift) / metres) ** 2
        if not len(seen):
            return
        shares = np.clip(self._fitting.share(seen.positions), 0.0, 1.0)
        beside = length(self._fitting.handle_at(self._fitting.value(shares)) - seen.positions)
        best = int(np.where(beside < ON_JOINT, seen.presence, 0.0).argmax())
        if beside[best] >= ON_JOINT:
            return
        error = (np.trace(seen.covariances[best]) / 3 + NOISE**2) / metres**2
        apart = shares[best] - self.share
        strays = apart * apart > 2 * JUMP * (self._variance + error)
        if strays and (held or not (near or self._strayed)):
            self._strayed = not held
            return
        gain = 1.0 if strays or np.isinf(self._variance) else self._variance / (self._variance + error)
        self.share = float(np.clip(self.share + gain * apart, 0.0, 1.0))
        self._variance = error if gain == 1.0 else (1 - gain) * self._variance
        self._strayed = False
        self._colors = KEPT * self._colors + np.log(np.maximum(seen.colors[best], LEAST))

    def _metres(self) -> float:
        """Metres of way for the whole range of the joint, at the present share."""
        low, high = max(0.0, self.share - 0.01), min(1.0, self.share + 0.01)
        ends = self._fitting.handle_at(self._fitting.value([low, high]))
        return float(length(ends[1] - ends[0])) / (high - low)


def length(vectors: Array) -> Array:
    """(...) of vectors (..., 3)."""
    return np.sqrt((vectors * vectors).sum(-1))
