"""The person of the tests: configuration, body and measurements."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pybullet as bullet

from human.body import Body
from human.config import HumanConfig

REST = {
    "r_shoulder_flexion": 0.58,
    "r_shoulder_abduction": 0.02,
    "r_shoulder_rotation": 0.12,
    "r_elbow_flexion": 0.62,
    "r_forearm_pronation": 1.0,
    "r_wrist_flexion": 0.15,
    "r_wrist_deviation": 0.0,
}


def config(**changes: Any) -> HumanConfig:
    given: dict[str, Any] = {"urdf": None, "position": [1.35, -0.15, -0.74], "yaw": 180.0, "rest": REST, "camera": None}
    return HumanConfig(**given | changes)


@contextmanager
def standing(**changes: Any) -> Iterator[Body]:
    """Yields a person in a PyBullet client of their own, with gravity."""
    client = bullet.connect(bullet.DIRECT)
    try:
        bullet.setGravity(0, 0, -9.81, client)
        bullet.setPhysicsEngineParameter(deterministicOverlappingPairs=1, physicsClientId=client)
        yield Body(config(**changes), client)
    finally:
        bullet.disconnect(client)


def table(count: int) -> np.ndarray:
    """Returns places (count^2, 3) all over the table top, at the height of a small object's centre."""
    x, y = np.meshgrid(np.linspace(-0.35, 0.95, count), np.linspace(-0.7, 0.7, count))
    return np.stack([x.ravel(), y.ravel(), np.full(x.size, 0.025)], 1)


def off(body: Body, target: Any, style: str = "finger") -> float:
    """Returns the angle between the person's line, from PyBullet's links, and the target, in degrees."""
    origin, direction = body.drawn(style)
    sight = np.asarray(target) - origin
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(direction, sight)), direction @ sight)))


def angles(body: Body) -> list[float]:
    """Returns the angles of all joints of the body."""
    return [
        bullet.getJointState(body.body, j, body.client)[0] for j in range(bullet.getNumJoints(body.body, body.client))
    ]


def step(body: Body, count: int) -> None:
    for _ in range(count):
        bullet.stepSimulation(body.client)
        if body.moving:
            body.advance()
