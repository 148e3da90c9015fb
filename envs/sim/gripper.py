"""Grippers in one PyBullet client: a magnet on the flange, or two fingers that rub.

`Gripper.open` lets go before a control step; `Gripper.feel` looks after it what is held.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pybullet as bullet
from numpy.typing import NDArray

from conf.schema import Checked, ConfigError, one_of, within
from envs.sim.robot import Robot, RobotConfig
from envs.tasks.types import NOTHING

FACE = 0.03  # metres from the gripper centre within which a touched object is touched by the magnet
PAD, DAMPING = 500.0, 30.0  # N/m and N s/m of a magnet's face
RUBBER = 2.0  # friction of a fingertip; Bullet multiplies it with the object's
SLACK = 0.02  # metres that an object may be dragged out of its place under the magnet before it comes off
Point = Sequence[float] | NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class GripperConfig(Checked):
    """Forces in N: pull, with which a magnet holds on, and force, with which each finger closes."""

    name: str = one_of("own", "magnet", "fingers")
    pull: float = within(0.1, 10_000)
    force: float = within(0.1, 1000)

    def of(self, robot: RobotConfig) -> str:
        """The key of GRIPPERS that this robot grips with. Raises ConfigError where it has no such gripper."""
        if self.name == "own":
            return robot.grippers[0]
        if self.name not in robot.grippers:
            raise ConfigError(f"gripper={self.name}: robot={robot.name} grips with {' or '.join(robot.grippers)}")
        return self.name


class Gripper(ABC):
    """What the robot in this client grips with. held: the body that it holds, or NOTHING."""

    def __init__(self, config: GripperConfig, robot: Robot, client: int) -> None:
        self._config, self._robot, self._client = config, robot, client
        self.held = NOTHING

    @abstractmethod
    def open(self) -> None:
        """Let go of what is held."""

    @abstractmethod
    def feel(self, bodies: Sequence[int], centre: Point) -> int:
        """The body that a closed gripper holds after a control step, or NOTHING.

        bodies: those near enough to be gripped. centre: the gripper's, metres.
        """

    @abstractmethod
    def seize(self, body: int, centre: Point) -> None:
        """Hold the body from the start of an episode: it has been put in its place at the gripper."""


class Magnet(Gripper):
    """A fixed constraint, made when a closed magnet touches something; what is held back too hard comes off."""

    def __init__(self, config: GripperConfig, robot: Robot, client: int) -> None:
        super().__init__(config, robot, client)
        # A pad that gives way: Bullet would let an arm press what is light right through the table.
        pad = {"contactStiffness": PAD, "contactDamping": DAMPING}
        bullet.changeDynamics(robot.body, robot.hand, **pad, physicsClientId=client)
        self._constraint = NOTHING
        self._place = np.zeros(3)  # of the held body in the frame of the hand

    def open(self) -> None:
        if self.held != NOTHING:
            bullet.removeConstraint(self._constraint, self._client)
            self._let_through(False)
            self.held = NOTHING

    def feel(self, bodies: Sequence[int], centre: Point) -> int:
        if self.held != NOTHING and self._has_slipped():
            self.open()
        if self.held == NOTHING:
            for body in bodies:
                if self._touches(body, centre):
                    self.seize(body, centre)
                    break
        return self.held

    def seize(self, body: int, centre: Point) -> None:
        place, turn = self._in_hand(body)
        self._constraint = bullet.createConstraint(
            self._robot.body,
            self._robot.hand,
            body,
            -1,
            bullet.JOINT_FIXED,
            (0, 0, 0),
            place,
            (0, 0, 0),
            turn,
            physicsClientId=self._client,
        )
        bullet.changeConstraint(self._constraint, maxForce=self._config.pull, physicsClientId=self._client)
        self.held, self._place = body, np.array(place)
        self._let_through(True)

    def _let_through(self, free: bool) -> None:
        """Whether what is held passes through the hand: the constraint keeps it in place, in half the time."""
        ends = (self._robot.body, self.held, self._robot.hand, -1)
        bullet.setCollisionFilterPair(*ends, int(not free), self._client)

    def _touches(self, body: int, centre: Point) -> bool:
        contacts = bullet.getContactPoints(self._robot.body, body, physicsClientId=self._client)
        return any(
            contact[3] >= self._robot.hand and _distance(contact[5], centre) <= FACE and contact[8] < 1e-3
            for contact in contacts
        )

    def _in_hand(self, body: int) -> tuple[Point, Point]:
        """The body's pose in the frame that constraints take the hand's to be: that of its centre of mass."""
        hand = bullet.getLinkState(self._robot.body, self._robot.hand, physicsClientId=self._client)[:2]
        pose = bullet.getBasePositionAndOrientation(body, self._client)
        return bullet.multiplyTransforms(*bullet.invertTransform(*hand), *pose)

    def _has_slipped(self) -> bool:
        return _distance(self._in_hand(self.held)[0], self._place) > SLACK


class Fingers(Gripper):
    """Two fingers that close with a limited force; they hold what both of them touch."""

    def __init__(self, config: GripperConfig, robot: Robot, client: int) -> None:
        super().__init__(config, robot, client)
        robot.limit_fingers(config.force)
        # One rack moves both fingers: or what they hold would slide from side to side with them.
        rack = bullet.createConstraint(
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
        bullet.changeConstraint(rack, gearRatio=-1, erp=0.1, maxForce=50, physicsClientId=client)
        for finger in robot.fingers:
            bullet.changeDynamics(
                robot.body, finger, lateralFriction=RUBBER, spinningFriction=0.01, physicsClientId=client
            )

    def open(self) -> None:
        self.held = NOTHING

    def feel(self, bodies: Sequence[int], centre: Point) -> int:
        self.held = next((body for body in bodies if self._touched_by_all(body)), NOTHING)
        return self.held

    def seize(self, body: int, centre: Point) -> None:
        self.held = body

    def _touched_by_all(self, body: int) -> bool:
        return all(
            bullet.getContactPoints(self._robot.body, body, finger, physicsClientId=self._client)
            for finger in self._robot.fingers
        )


GRIPPERS: dict[str, type[Gripper]] = {"magnet": Magnet, "fingers": Fingers}


def _distance(a: Point, b: Point) -> float:
    return float(np.linalg.norm(np.subtract(a, b)))
