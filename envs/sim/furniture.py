"""The furniture of one world: boxes that never move, and fittings, which slide or turn on a joint when pushed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pybullet as bullet

from envs.sim.robot import Robot
from envs.sim.workspace import Box, Fitting, WorkspaceConfig

JOINTS = {"slide": bullet.JOINT_PRISMATIC, "turn": bullet.JOINT_REVOLUTE}
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
PARTING = 20  # physics steps: Bullet looks at a tenth of the pairs it holds for near in each, and at one at least
PARKED, APART = -30.0, 20.0  # metres: how deep they wait, and how far from each other
LINK = 0  # of a fitting's body: all its parts in one


class Furniture:
    """Made once in a PyBullet client, about the robot; only the fittings move. visuals: load what is drawn.

    Bullet solves joints in an order that depends on which bodies it takes to be near each other. It learns some steps
    late that they have parted; how late depends on all that was before, and the same seed would give other bits. So a
    fitting is always solved with the robot, and never sleeps; and between episodes all part for `parting` steps.
    """

    def __init__(self, workspace: WorkspaceConfig, robot: Robot, client: int, visuals: bool) -> None:
        self._client, self._visuals, self._robot = client, visuals, robot
        self._boxes = [self._box(box) for box in workspace.furniture.values() if visuals or box.contact]
        self._pass_through(robot.body, robot.fixed_links())
        self._fittings = {self._fitting(fitting): fitting for fitting in workspace.fittings.values()}
        self._stands: dict[int, tuple] = {}
        self.parting = 0
        for body in self._fittings:
            self.join(body)
        self.reset()

    def join(self, body: int) -> None:
        """Let this body, whose one link its joint alone guides, part from all else between episodes as fittings do."""
        self._pass_through(body, [LINK])  # no drawer rubs on its cabinet
        self._tie(body)
        for each in (self._robot.body, body):
            self._stands[each] = bullet.getBasePositionAndOrientation(each, self._client)
        self.parting = PARTING

    def _pass_through(self, body: int, links: Iterable[int]) -> None:
        """Let these links of a body go through the boxes that never move."""
        for box in self._boxes:
            for link in links:
                bullet.setCollisionFilterPair(body, box, link, -1, 0, self._client)

    def _tie(self, body: int) -> None:
        """Join it and the robot by a gear that turns nothing, and Bullet solves them together."""
        ends = (self._robot.body, self._robot.arm[0], body, LINK)
        gear = bullet.createConstraint(
            *ends, bullet.JOINT_GEAR, (0, 0, 1), (0, 0, 0), (0, 0, 0), physicsClientId=self._client
        )
        bullet.changeConstraint(gear, gearRatio=0, maxForce=0, physicsClientId=self._client)

    def park(self) -> None:
        """Where there are fittings or the like, put them and the robot where none touches anything."""
        for i, (body, (_, turned)) in enumerate(self._stands.items()):
            bullet.resetBasePositionAndOrientation(body, (0, APART * i, PARKED), turned, self._client)

    def reset(self) -> None:
        """Put them back, and the fittings to their start, at rest."""
        for body, stand in self._stands.items():
            bullet.resetBasePositionAndOrientation(body, *stand, self._client)
        for body, fitting in self._fittings.items():
            bullet.resetJointState(body, LINK, fitting.start, 0.0, self._client)

    def values(self) -> list[float]:
        """The joint value of each fitting, metres or radians; a blow can put it past its limits by millimetres."""
        return [bullet.getJointState(body, LINK, self._client)[0] for body in self._fittings]

    def _box(self, box: Box) -> int:
        half, shape = [side / 2 for side in box.size], -1
        if box.contact:
            shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=half, physicsClientId=self._client)
        visual = self._drawn([box], box.position)
        return bullet.createMultiBody(0, shape, visual, box.position, physicsClientId=self._client)

    def _drawn(self, boxes: Sequence[Box], origin: Sequence[float]) -> int:
        """The boxes as one visual shape about `origin`; -1 where nothing is drawn."""
        if not self._visuals:
            return -1
        return bullet.createVisualShapeArray(
            shapeTypes=[bullet.GEOM_BOX] * len(boxes),
            halfExtents=[[side / 2 for side in box.size] for box in boxes],
            visualFramePositions=[_offset(box.position, origin) for box in boxes],
            rgbaColors=[[*box.color, 1] for box in boxes],
            physicsClientId=self._client,
        )

    def _touched(self, boxes: Sequence[Box], origin: Sequence[float]) -> int:
        """The boxes with contact as one collision shape about `origin`; -1 for none."""
        solid = [box for box in boxes if box.contact]
        if not solid:
            return -1
        return bullet.createCollisionShapeArray(
            shapeTypes=[bullet.GEOM_BOX] * len(solid),
            halfExtents=[[side / 2 for side in box.size] for box in solid],
            collisionFramePositions=[_offset(box.position, origin) for box in solid],
            physicsClientId=self._client,
        )

    def _fitting(self, fitting: Fitting) -> int:
        """A body whose base stays and whose one link has all the parts."""
        parts, origin = list(fitting.parts.values()), fitting.origin
        body = bullet.createMultiBody(
            0,
            basePosition=origin,
            linkMasses=[fitting.mass],
            linkCollisionShapeIndices=[self._touched(parts, origin)],
            linkVisualShapeIndices=[self._drawn(parts, origin)],
            linkPositions=[[0, 0, 0]],
            linkOrientations=[UPRIGHT],
            linkInertialFramePositions=[_offset(_middle(parts), origin)],
            linkInertialFrameOrientations=[UPRIGHT],
            linkParentIndices=[0],
            linkJointTypes=[JOINTS[fitting.joint]],
            linkJointAxis=[fitting.axis],
            physicsClientId=self._client,
        )
        self._guide(body, fitting)
        return body

    def _guide(self, body: int, fitting: Fitting) -> None:
        """Limits, and a motor that only ever brakes: dry friction."""
        limits = {"jointLowerLimit": fitting.low, "jointUpperLimit": fitting.high}
        bullet.changeDynamics(body, LINK, **limits, physicsClientId=self._client)
        bullet.setJointMotorControl2(
            body, LINK, bullet.VELOCITY_CONTROL, targetVelocity=0, force=fitting.friction, physicsClientId=self._client
        )


def _offset(position: Sequence[float], origin: Sequence[float]) -> list[float]:
    return [a - b for a, b in zip(position, origin, strict=True)]


def _middle(boxes: Sequence[Box]) -> list[float]:
    """The middle of what the boxes span, where the mass is taken to be."""
    position, half = np.array([box.position for box in boxes]), np.array([box.size for box in boxes]) / 2
    return (((position - half).min(0) + (position + half).max(0)) / 2).tolist()
