"""The open hand of a person as a body: a flat palm with low borders, which gives way when it is pressed.

The person who is drawn is never touched (`human/body/pybullet_body.py`); this body stands where their palm is drawn.
"""

from __future__ import annotations

from collections.abc import Sequence

import pybullet as bullet

from envs.sim.furniture import LINK, UPRIGHT
from human.body.meshes import Proportions

SIZE = (0.1, 0.09, 0.02)  # metres along x, y and z
BORDER, RIM = 0.006, 0.008  # metres: thickness of the borders, and their height over the palm
GIVE = 0.05  # metres that a palm gives way downwards at most
STRENGTH = 8.0  # N that hold it up; more pushes it down
RETURN_GAIN = 0.1  # part of the way back that it takes in a physics step
MASS = 0.05  # kg
FRICTION = 0.8  # lateral
DRAWN = (0.07, 0.05, 0.012)  # metres: the drawn box, inside the hand of the person
PARKED = (0.0, 0.0, -18.0)  # metres: where it is while no episode shows it
Pose = tuple[tuple[float, ...], tuple[float, ...]]


class Palm:
    """A body with a fixed base and one link on a vertical slide. body: PyBullet's id.

    place: (3,) where the middle of its surface is in this episode while nothing presses it, metres.
    visuals: load a visual shape.
    """

    def __init__(self, client: int, visuals: bool) -> None:
        self._client = client
        self.place: tuple[float, float, float] = PARKED
        shape, drawn = _shape(client), _drawn(client) if visuals else -1
        self.body = bullet.createMultiBody(
            0,
            basePosition=PARKED,
            linkMasses=[MASS],
            linkCollisionShapeIndices=[shape],
            linkVisualShapeIndices=[drawn],
            linkPositions=[[0, 0, 0]],
            linkOrientations=[UPRIGHT],
            linkInertialFramePositions=[[0, 0, 0]],
            linkInertialFrameOrientations=[UPRIGHT],
            linkParentIndices=[0],
            linkJointTypes=[bullet.JOINT_PRISMATIC],
            linkJointAxis=[[0, 0, -1]],
            physicsClientId=client,
        )
        bullet.changeDynamics(
            self.body, LINK, jointLowerLimit=0.0, jointUpperLimit=GIVE, lateralFriction=FRICTION, physicsClientId=client
        )
        bullet.setJointMotorControl2(
            self.body,
            LINK,
            bullet.POSITION_CONTROL,
            targetPosition=0.0,
            positionGain=RETURN_GAIN,
            force=STRENGTH,
            physicsClientId=client,
        )

    def show(self, place: Sequence[float]) -> None:
        """Hold it at place (3,), the middle of its surface, metres."""
        x, y, z = place
        self.place = (x, y, z)
        bullet.resetBasePositionAndOrientation(self.body, self.place, UPRIGHT, self._client)

    def reset(self) -> None:
        """Put its joint to rest at its start."""
        bullet.resetJointState(self.body, LINK, 0.0, 0.0, self._client)

    def pose(self) -> Pose:
        """(position, quaternion) of the middle of its surface, metres."""
        return bullet.getLinkState(self.body, LINK, computeForwardKinematics=1, physicsClientId=self._client)[:2]


def _shape(client: int) -> int:
    """The palm and its four borders as one collision shape about the middle of the surface."""
    x, y, z = SIZE
    half, middle = RIM / 2, BORDER / 2
    boxes = [((x / 2, y / 2, z / 2), (0.0, 0.0, -z / 2))]
    boxes += [((middle, y / 2, half), (side * (x / 2 - middle), 0.0, half)) for side in (-1, 1)]
    boxes += [((x / 2, middle, half), (0.0, side * (y / 2 - middle), half)) for side in (-1, 1)]
    return bullet.createCollisionShapeArray(
        shapeTypes=[bullet.GEOM_BOX] * len(boxes),
        halfExtents=[extents for extents, _ in boxes],
        collisionFramePositions=[place for _, place in boxes],
        physicsClientId=client,
    )


def _drawn(client: int) -> int:
    """A box of skin colour inside the hand. Bullet would draw the collision shape of a body without a visual one."""
    return bullet.createVisualShape(
        bullet.GEOM_BOX,
        halfExtents=[side / 2 for side in DRAWN],
        visualFramePosition=(0.0, 0.0, -SIZE[2] / 2),
        rgbaColor=(*Proportions().skin, 1.0),
        physicsClientId=client,
    )
