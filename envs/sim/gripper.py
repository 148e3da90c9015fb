"""Grippers in one PyBullet client: a magnet on the flange, or fingers or jaws that hold by friction.

`Gripper.release` releases before a control step, `Gripper.update` grips after it, and `Gripper.held` is a query.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pybullet as bullet
from numpy.typing import NDArray

from core.errors import ConfigError
from core.file_cache import file_digest
from core.schema import Checked, one_of, within
from envs.sim.robot import Robot, read_kinematics
from envs.sim.robot_config import RobotConfig, urdf_path

FACE_RADIUS = 0.03  # metres from the gripper centre within which a contact is one with the magnet's face
GEARED_INERTIA = 1e-4  # kg m^2 that motor and gears add to a jaw: of a few grams alone, it would jump into objects
HALVINGS = 8  # of an interval of openings
AGAINST = -0.5  # the greatest cosine between the forces of two jaws that hold an object between them
CONTACT_DISTANCE = 1e-3  # metres: Bullet reports contacts of bodies that are only near each other, too; see also `gap`
FACE_STIFFNESS, FACE_DAMPING = 500.0, 30.0  # N/m and N s/m of a magnet's face
FINGER_FRICTION = 2.0  # lateral, of a fingertip; Bullet multiplies it with the object's
MAX_SLIP = 0.02  # metres that an object may be dragged out of its place under the magnet before it comes off
BASE = -1  # PyBullet's number for the base of a body
Point = Sequence[float] | NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class GripperConfig(Checked):
    """Forces in N: `pull`, with which a magnet holds on, and `force`, with which each finger closes.

    name: own is the robot's first gripper, rod a magnet at the end of a rod. rod: radius and length of that in metres.
    gap: metres that a magnet stays above the tops of objects on the table, so that it pushes nothing aside; it attaches
    objects up to twice as far from its face. With 0 it presses on them.
    """

    name: str = one_of("own", "magnet", "fingers", "hinge", "rod")
    pull: float = within(0.1, 10_000)
    force: float = within(0.1, 1000)
    rod: list[float] = within(0.001, 0.5)
    gap: float = within(0.0, 0.005, default=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.rod) != 2 * (self.name == "rod"):
            wanted = "a radius and a length" if self.name == "rod" else "[]"
            raise ConfigError(f"rod={self.rod} must be {wanted} with name={self.name}")

    def of(self, robot: RobotConfig) -> str:
        """Return the key of GRIPPERS that this robot grips with. Raises ConfigError where it has no such gripper."""
        if self.name == "own":
            return robot.grippers[0]
        name = "magnet" if self.name == "rod" else self.name
        if name not in robot.grippers:
            raise ConfigError(f"gripper={self.name}: robot={robot.name} grips with {' or '.join(robot.grippers)}")
        return name

    def on_rod(self, robot: RobotConfig) -> RobotConfig:
        """Return the robot with its magnet at the end of the rod. Raises ConfigError where its gripper tilts."""
        if robot.position_first:
            raise ConfigError(
                f"gripper.rod={self.rod}: robot={robot.name} tilts its gripper (position_first), and a rod must point "
                "down; choose another robot"
            )
        radius, longer = self.rod
        tip = [offset + longer * way for offset, way in zip(robot.tip_offset, robot.approach, strict=True)]
        return replace(robot, tip_offset=tip, magnet=[radius, sum(robot.magnet[1:]) + longer])


class Holdable(NamedTuple):
    """A thing that grippers hold: a loose body, or the handle on a link of a fitting, which swivels under a magnet.

    pose: gives its (position, quaternion), metres.
    """

    body: int
    pose: Callable[[], tuple[Point, Point]]
    link: int = BASE


class Gripper(ABC):
    """The gripper of the robot in this client. held: the object that it holds, or None."""

    def __init__(self, config: GripperConfig, robot: Robot, client: int) -> None:
        self._config, self._robot, self._client = config, robot, client
        self.held: Holdable | None = None

    @abstractmethod
    def release(self) -> None:
        """Release the held object."""

    @abstractmethod
    def update(self, things: Sequence[Holdable], centre: Point) -> None:
        """After a control step with the gripper closed: hold what is touched, and release what has slipped.

        Args:
            things: those near enough to be gripped.
            centre: the gripper's, metres.
        """

    @abstractmethod
    def attach(self, thing: Holdable, centre: Point) -> None:
        """Hold an object that is already at the gripper. centre: the gripper's, metres."""


class Magnet(Gripper):
    """A fixed constraint, made when the closed magnet touches an object. It is removed if the object is pulled hard."""

    def __init__(self, config: GripperConfig, robot: Robot, client: int) -> None:
        super().__init__(config, robot, client)
        # A compliant face: Bullet would let an arm press a light object right through the table.
        face = {"contactStiffness": FACE_STIFFNESS, "contactDamping": FACE_DAMPING}
        bullet.changeDynamics(robot.body, robot.hand, **face, physicsClientId=client)
        self._reach = max(CONTACT_DISTANCE, 2 * config.gap)  # metres from its face within which it takes hold
        self._constraint = -1
        self._place = np.zeros(3)  # of the held object in the hand's frame, when it was attached

    def release(self) -> None:
        if self.held is not None:
            bullet.removeConstraint(self._constraint, self._client)
            self._set_collision(self.held, True)
            self.held = None

    def update(self, things: Sequence[Holdable], centre: Point) -> None:
        if self.held is not None and self._slip(self.held) > MAX_SLIP:
            self.release()
        if self.held is None:
            touched = next((thing for thing in things if self._touches(thing, centre)), None)
            if touched is not None:
                self.attach(touched, centre)

    def attach(self, thing: Holdable, centre: Point) -> None:
        position, quaternion = self._pose_in_hand(thing)
        pivot: Point = (0, 0, 0)
        if thing.link != BASE:
            link = bullet.getLinkState(thing.body, thing.link, physicsClientId=self._client)[:2]
            pivot = bullet.multiplyTransforms(*bullet.invertTransform(*link), *thing.pose())[0]
        self._constraint = bullet.createConstraint(
            self._robot.body,
            self._robot.hand,
            thing.body,
            thing.link,
            bullet.JOINT_FIXED if thing.link == BASE else bullet.JOINT_POINT2POINT,
            (0, 0, 0),
            position,
            pivot,
            quaternion,
            physicsClientId=self._client,
        )
        bullet.changeConstraint(self._constraint, maxForce=self._config.pull, physicsClientId=self._client)
        self.held, self._place = thing, np.array(position)
        self._set_collision(thing, False)

    def _set_collision(self, thing: Holdable, enabled: bool) -> None:
        """Turn collisions between an object and the hand on or off.

        They are off for a held object: the constraint keeps it in place, in half the time.
        """
        ends = (self._robot.body, thing.body, self._robot.hand, thing.link)
        bullet.setCollisionFilterPair(*ends, int(enabled), self._client)

    def _touches(self, thing: Holdable, centre: Point) -> bool:
        return any(
            contact[3] >= self._robot.hand and _distance(contact[5], centre) <= FACE_RADIUS and contact[8] < self._reach
            for contact in self._contacts(thing)
        )

    def _contacts(self, thing: Holdable) -> Sequence[tuple[Any, ...]]:
        """Bullet's contacts with an object and, with a gap, the point where it is nearest to the hand."""
        bodies = self._robot.body, thing.body
        if not self._config.gap:
            return tuple(bullet.getContactPoints(*bodies, physicsClientId=self._client))
        nearest = bullet.getClosestPoints(*bodies, self._reach, self._robot.hand, physicsClientId=self._client)
        return tuple(nearest)

    def _pose_in_hand(self, thing: Holdable) -> tuple[Point, Point]:
        """Its position and quaternion in the hand's frame for constraints: that of its centre of mass."""
        hand = bullet.getLinkState(self._robot.body, self._robot.hand, physicsClientId=self._client)[:2]
        return bullet.multiplyTransforms(*bullet.invertTransform(*hand), *thing.pose())

    def _slip(self, thing: Holdable) -> float:
        """Metres that the held object has moved in the hand since it was attached."""
        return _distance(self._pose_in_hand(thing)[0], self._place)


class Fingers(Gripper):
    """Two fingers that close with a limited force. They hold an object that both of them touch."""

    def __init__(self, config: GripperConfig, robot: Robot, client: int) -> None:
        super().__init__(config, robot, client)
        robot.limit_fingers(config.force)
        # A gear couples both fingers: otherwise a held object would slide from side to side with them.
        gear = bullet.createConstraint(
            robot.body,
            robot.fingers[0],
            robot.body,
            robot.fingers[1],
            bullet.JOINT_GEAR,
            (1, 0, 0),
            (0, 0, 0),
            (0, 0, 0),
            physicsClientId=client,
        )
        bullet.changeConstraint(gear, gearRatio=-1, erp=0.1, maxForce=50, physicsClientId=client)
        for finger in robot.fingers:
            friction = {"lateralFriction": FINGER_FRICTION, "spinningFriction": 0.01}
            bullet.changeDynamics(robot.body, finger, **friction, physicsClientId=client)

    def release(self) -> None:
        self.held = None

    def update(self, things: Sequence[Holdable], centre: Point) -> None:
        self.held = next((thing for thing in things if self._touched_by_all(thing)), None)

    def attach(self, thing: Holdable, centre: Point) -> None:
        self.held = thing

    def _touched_by_all(self, thing: Holdable) -> bool:
        return all(
            bullet.getContactPoints(self._robot.body, thing.body, finger, physicsClientId=self._client)
            for finger in self._robot.fingers
        )


class Hinge(Gripper):
    """Two jaws, one of them part of the hand. They hold an object that both press from opposite sides."""

    def __init__(self, config: GripperConfig, robot: Robot, client: int) -> None:
        super().__init__(config, robot, client)
        robot.limit_fingers(config.force)
        self._jaws = (robot.fingers[0], robot.hand)
        inertia = bullet.getDynamicsInfo(robot.body, robot.fingers[0], client)[2]
        geared = [moment + GEARED_INERTIA for moment in inertia]
        bullet.changeDynamics(robot.body, robot.fingers[0], localInertiaDiagonal=geared, physicsClientId=client)
        for jaw in self._jaws:
            friction = {"lateralFriction": FINGER_FRICTION, "spinningFriction": 0.01}
            bullet.changeDynamics(robot.body, jaw, **friction, physicsClientId=client)

    def release(self) -> None:
        self.held = None

    def update(self, things: Sequence[Holdable], centre: Point) -> None:
        self.held = next((thing for thing in things if self._is_between(thing)), None)

    def attach(self, thing: Holdable, centre: Point) -> None:
        self.held = thing

    def _is_between(self, thing: Holdable) -> bool:
        turning, fixed = (self._normals(thing, jaw) for jaw in self._jaws)
        return any(float(np.dot(a, b)) < AGAINST for a in turning for b in fixed)

    def _normals(self, thing: Holdable, jaw: int) -> list[Point]:
        """Return the direction of each contact between an object and a jaw, from the object to the jaw."""
        contacts = bullet.getContactPoints(self._robot.body, thing.body, jaw, physicsClientId=self._client)
        return [contact[7] for contact in contacts if contact[8] < CONTACT_DISTANCE]


GRIPPERS: dict[str, type[Gripper]] = {"magnet": Magnet, "fingers": Fingers, "hinge": Hinge}


def opening_around(config: RobotConfig, size: float) -> float:
    """Return the opening at which fingers or jaws touch an object of this size in their middle, metres or radians."""
    if not config.on_hinge:
        return size / 2
    key = (repr(config), size, file_digest(urdf_path(config)))
    if key not in _openings:
        _openings[key] = _measured_opening(config, size)
    return _openings[key]


_openings: dict[tuple[str, float, str], float] = {}  # by robot, size, and content of the URDF


def _measured_opening(config: RobotConfig, size: float) -> float:
    """Return the least opening of the jaws at which a cube between them does not touch the one that turns."""
    client = bullet.connect(bullet.DIRECT)
    try:
        robot = Robot(config, client, visuals=False)
        shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=[size / 2] * 3, physicsClientId=client)
        centre = read_kinematics(config).forward(np.array([config.rest])).position[0]
        cube = bullet.createMultiBody(0, shape, basePosition=centre, physicsClientId=client)
        low, high = 0.0, config.finger_opening
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            robot.place(config.rest, middle)
            touches = bullet.getClosestPoints(robot.body, cube, 0.0, robot.fingers[0], physicsClientId=client)
            low, high = (middle, high) if touches else (low, middle)
    finally:
        bullet.disconnect(client)
    return high


def _distance(a: Point, b: Point) -> float:
    return float(np.linalg.norm(np.subtract(a, b)))
