"""How far an arm is from the furniture at given joint angles, by the hulls of its links, without a physics step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pybullet as bullet

from envs.sim.kinematics import Array
from envs.sim.robot import Robot
from envs.sim.robot_config import RobotConfig
from envs.sim.workspace import WorkspaceConfig

SLACK = 1e-3  # metres that a link near the table may be nearer to it than at rest


class Clearance:
    """An arm and the solid boxes of a workspace, in a PyBullet client of their own.

    Links that never move are left out. A link that is near the table even at rest, such as the first one of an arm on
    the table, must only stay as far away as there.

    Args:
        robot, workspace: what stands there.
        magnet: whether the robot's magnet is mounted.
        margin: metres that the links keep from the boxes.
    """

    def __init__(self, robot: RobotConfig, workspace: WorkspaceConfig, *, magnet: bool, margin: float) -> None:
        self._client = bullet.connect(bullet.DIRECT)
        self._robot = Robot(robot, self._client, False, magnet)
        self._boxes = [self._box(box.size, box.position) for box in workspace.furniture.values() if box.contact]
        self._moving = range(self._robot.arm[0], bullet.getNumJoints(self._robot.body, self._client))
        self._opening = robot.finger_opening
        self._margins = dict.fromkeys(self._moving, margin)
        for link, distance in self._distances(np.array(robot.rest), margin).items():
            self._margins[link] = min(margin, distance - SLACK)

    def _box(self, size: Sequence[float], position: Sequence[float]) -> int:
        half = [side / 2 for side in size]
        shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=half, physicsClientId=self._client)
        return bullet.createMultiBody(0, shape, basePosition=position, physicsClientId=self._client)

    def _distances(self, angles: Array, within: float) -> dict[int, float]:
        """Return the links that are nearer than `within` metres to a box at angles (J,), each with its distance."""
        self._robot.place(angles.tolist(), self._opening)
        found: dict[int, float] = {}
        for box in self._boxes:
            for point in bullet.getClosestPoints(self._robot.body, box, within, physicsClientId=self._client):
                link, distance = point[3], point[8]
                if link in self._moving:
                    found[link] = min(distance, found.get(link, distance))
        return found

    def missing(self, angles: Array) -> float:
        """Return how many metres the worst link is too near to a box at angles (J,); 0 if none is."""
        near = self._distances(angles, max(self._margins.values()))
        return max([0.0, *(self._margins[link] - distance for link, distance in near.items())])

    def close(self) -> None:
        """Free the client. Idempotent."""
        if self._client >= 0:
            bullet.disconnect(self._client)
        self._client = -1
