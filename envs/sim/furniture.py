"""The furniture of one world: boxes that never move, fittings, which slide or turn when pushed, and a person's palm."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pybullet as bullet

from envs.sim.robot import Robot
from envs.sim.workspace import HANDLE, Box, Fitting, WorkspaceConfig
from human.body.urdf_model import Proportions

JOINTS = {"slide": bullet.JOINT_PRISMATIC, "turn": bullet.JOINT_REVOLUTE}
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
PARTING = 20  # physics steps: in each, Bullet checks a tenth of the pairs that it takes to be near, at least one
PARKED_HEIGHT, PARKED_SPACING = -30.0, 20.0  # metres: where bodies are parked, and how far from each other
LINK = 0  # of a fitting's body: it has all the parts
METAL = (HANDLE, "post")  # parts that keep their colour
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


# ---- boxes and fittings


class Furniture:
    """Furniture is made once, around the robot; only the fittings move. visuals: load visual shapes.

    Bullet solves joints in an order that depends on which bodies it takes to be near each other. It notices some steps
    late that bodies have parted. How late depends on the past, so the same seed would give other bits. So a fitting is
    always solved together with the robot, and never sleeps, and between episodes all are apart for `parting` steps.
    """

    def __init__(self, workspace: WorkspaceConfig, robot: Robot, client: int, visuals: bool) -> None:
        self._client, self._visuals, self._robot = client, visuals, robot
        drawn = workspace.board.cells() if workspace.board and visuals else []
        boxes = [box for box in [*workspace.furniture.values(), *drawn] if visuals or box.contact]
        self.boxes = {self._box(box): box for box in boxes}  # by their bodies
        self._pass_through(robot.body, robot.fixed_links())
        self._fittings = {self._fitting(fitting): fitting for fitting in workspace.fittings.values()}
        self.bodies = dict(zip(workspace.fittings, self._fittings, strict=True))  # by the fittings' names
        self._base_poses: dict[int, tuple] = {}
        self.parting = 0
        for body in self._fittings:
            self.join(body)
        self.reset()

    def join(self, body: int) -> None:
        """Treat this body, which has one link on a joint, as a fitting: apart from all others between episodes."""
        self._pass_through(body, [LINK])  # a drawer does not rub on its cabinet
        self._solve_with_robot(body)
        for each in (self._robot.body, body):
            self._base_poses[each] = bullet.getBasePositionAndOrientation(each, self._client)
        self.parting = PARTING

    def _pass_through(self, body: int, links: Iterable[int]) -> None:
        """Turn off collisions between these links of a body and the boxes that never move."""
        for box in self.boxes:
            for link in links:
                bullet.setCollisionFilterPair(body, box, link, -1, 0, self._client)

    def _solve_with_robot(self, body: int) -> None:
        """Connect the body and the robot by a gear without effect, so that Bullet solves them together."""
        ends = (self._robot.body, self._robot.arm[0], body, LINK)
        gear = bullet.createConstraint(
            *ends, bullet.JOINT_GEAR, (0, 0, 1), (0, 0, 0), (0, 0, 0), physicsClientId=self._client
        )
        bullet.changeConstraint(gear, gearRatio=0, maxForce=0, physicsClientId=self._client)

    def park(self) -> None:
        """Move the robot and all fittings, if there are any, to where none touches anything."""
        for i, (body, (_, quaternion)) in enumerate(self._base_poses.items()):
            bullet.resetBasePositionAndOrientation(
                body, (0, PARKED_SPACING * i, PARKED_HEIGHT), quaternion, self._client
            )

    def reset(self) -> None:
        """Move them back, with the fittings at rest at their start."""
        for body, pose in self._base_poses.items():
            bullet.resetBasePositionAndOrientation(body, *pose, self._client)
        for body, fitting in self._fittings.items():
            bullet.resetJointState(body, LINK, fitting.start, 0.0, self._client)

    def show(self, name: str, share: float, color: Sequence[float]) -> None:
        """Put a fitting to rest, open by this share, with its parts but the handle in this colour (RGBA)."""
        body = self.bodies[name]
        bullet.resetJointState(body, LINK, float(self._fittings[body].value(share)), 0.0, self._client)
        if self._visuals:
            for number, part in enumerate(self._fittings[body].parts):
                if part not in METAL:
                    bullet.changeVisualShape(body, LINK, number, rgbaColor=color, physicsClientId=self._client)

    def handle_pose(self, name: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """(position, quaternion) of a fitting's handle, metres."""
        body = self.bodies[name]
        fitting, value = self._fittings[body], bullet.getJointState(body, LINK, self._client)[0]
        turn = bullet.getQuaternionFromAxisAngle(fitting.axis, value if fitting.joint == "turn" else 0.0)
        return tuple(fitting.handle_at(value).tolist()), turn

    def values(self) -> list[float]:
        """Return each fitting's joint value, metres or radians. A blow can move it past its limits by millimetres."""
        return [bullet.getJointState(body, LINK, self._client)[0] for body in self._fittings]

    def _box(self, box: Box) -> int:
        half, shape = [side / 2 for side in box.size], -1
        if box.contact:
            shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=half, physicsClientId=self._client)
        visual = self._visual_shape([box], box.position)
        return bullet.createMultiBody(0, shape, visual, box.position, physicsClientId=self._client)

    def _visual_shape(self, boxes: Sequence[Box], origin: Sequence[float]) -> int:
        """Return the boxes as one visual shape about `origin`; -1 without visuals."""
        if not self._visuals:
            return -1
        return bullet.createVisualShapeArray(
            shapeTypes=[bullet.GEOM_BOX] * len(boxes),
            halfExtents=[[side / 2 for side in box.size] for box in boxes],
            visualFramePositions=[_offset(box.position, origin) for box in boxes],
            rgbaColors=[[*box.color, 1] for box in boxes],
            physicsClientId=self._client,
        )

    def _collision_shape(self, boxes: Sequence[Box], origin: Sequence[float]) -> int:
        """Return the boxes with contact as one collision shape about `origin`; -1 for none."""
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
        """A body with a fixed base and one link, which has all the parts."""
        parts, origin = list(fitting.parts.values()), fitting.origin
        body = bullet.createMultiBody(
            0,
            basePosition=origin,
            linkMasses=[fitting.mass],
            linkCollisionShapeIndices=[self._collision_shape(parts, origin)],
            linkVisualShapeIndices=[self._visual_shape(parts, origin)],
            linkPositions=[[0, 0, 0]],
            linkOrientations=[UPRIGHT],
            linkInertialFramePositions=[_offset(_centre(parts), origin)],
            linkInertialFrameOrientations=[UPRIGHT],
            linkParentIndices=[0],
            linkJointTypes=[JOINTS[fitting.joint]],
            linkJointAxis=[fitting.axis],
            physicsClientId=self._client,
        )
        self._set_up_joint(body, fitting)
        return body

    def _set_up_joint(self, body: int, fitting: Fitting) -> None:
        """Set the joint's limits, the surface, and a motor that only brakes: dry friction."""
        limits = {"jointLowerLimit": fitting.low, "jointUpperLimit": fitting.high}
        bullet.changeDynamics(body, LINK, **limits, lateralFriction=fitting.grip, physicsClientId=self._client)
        bullet.setJointMotorControl2(
            body, LINK, bullet.VELOCITY_CONTROL, targetVelocity=0, force=fitting.friction, physicsClientId=self._client
        )


def _offset(position: Sequence[float], origin: Sequence[float]) -> list[float]:
    return [a - b for a, b in zip(position, origin, strict=True)]


def _centre(boxes: Sequence[Box]) -> list[float]:
    """Return the centre of the boxes' bounding box, which is taken as the centre of mass."""
    position, half = np.array([box.position for box in boxes]), np.array([box.size for box in boxes]) / 2
    return (((position - half).min(0) + (position + half).max(0)) / 2).tolist()


# ---- the palm


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
    """Return the palm and its four borders as one collision shape about the middle of the surface."""
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
