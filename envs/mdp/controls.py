"""Controls: three ways to turn actions in [-1, 1] into joint targets, for all worlds at once.

A control starts from the joint angles last commanded, not from those measured, so that the motion is smooth and the arm
does not sag. Where a joint is held back (the gripper presses on something), the command stays within `MAX_LEAD` of it.

Where a task turns objects, the actions of `StepControl` and `AbsoluteControl` have one more number for the gripper's
yaw: its rotation about the vertical from its orientation at rest.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from core.schema import Checked, one_of, within
from envs.sim.kinematics import Array, Kinematics, Pose

WAYPOINT_DISTANCE = 0.08  # metres
# Share of a joint's speed that a policy's move of 1 is. At full speed kuka's gripper moves by 8 cm in a control step.
PACE = 0.5
SLOW = 0.04  # radians in a control step up to which a joint moves at its full speed, like those of jaco
MAX_LEAD = 0.15  # radians that a command may be ahead of its joint
MAX_YAW = np.pi / 2  # radians that the gripper may be turned about the vertical, each way
MAX_YAW_STEP = 0.1  # ... in one control step
SLIDES = 2  # steps of Newton's method that keep the gripper above the floor of its box: it sinks by less than 1 mm


class Control(ABC):
    """Turns actions into joint targets.

    Attributes:
        box: (2, 3) lowest and highest corner of the gripper box, metres.

    Args:
        config: of the control.
        kinematics: of the arm.
        speed: (J,) greatest motion of each joint, radians per control step.
        box: (2, 3) lowest and highest corner of the gripper box, metres.
        guarded: never send the gripper below the box, even with joint angles as actions.
        turns: the gripper can be turned about the vertical.
        gentle: scripted experts move no faster with `joints` than with the others: jaws would lose what they hold.
    """

    def __init__(
        self,
        config: ControlConfig,
        *,
        kinematics: Kinematics,
        speed: Array,
        box: Array,
        guarded: bool = False,
        turns: bool = False,
        gentle: bool = False,
    ) -> None:
        self._max_move, self._kinematics, self._speed, self.box = config.max_move, kinematics, speed, box
        self._guarded, self._turns = guarded, turns
        self._waypoint = config.max_move if gentle else WAYPOINT_DISTANCE
        self._rotation = kinematics.forward(kinematics.rest[None]).rotation[0]

    @property
    @abstractmethod
    def unit(self) -> Array:
        """(size,) the difference from `hold` that a policy's move of 1 is; the arm reaches it in one control step."""

    @abstractmethod
    def hold(self, angles: Array, gripper: Array) -> Array:
        """Return the action (N, size) that keeps arms at angles (N, J), grippers at (N, 3), where they are."""

    def outside(self, position: Array) -> float:
        """Metres from position (3,) to the gripper box; 0 in it."""
        return float(np.linalg.norm(position - np.clip(position, *self.box)))

    def targets(self, action: Array, commanded: Array, measured: Array) -> Array:
        """Return the joint angles to command.

        Args:
            action: (N, size) in [-1, 1].
            commanded: (N, J) angles last commanded, radians.
            measured: (N, J) angles, radians.

        Returns:
            (N, J) radians, within the limits of speeds and joints.
        """
        start = np.clip(commanded, measured - MAX_LEAD, measured + MAX_LEAD)
        delta = self._limit_speed(self._delta(action, start))
        return np.clip(start + delta, self._kinematics.low, self._kinematics.high)

    @abstractmethod
    def towards(self, position: Array, commanded: Array, yaw: Array | None = None) -> Array:
        """Return the action (N, size) that brings the gripper nearer to position (N, 3), metres, for scripted experts.

        yaw: (N,) radians about the vertical from the orientation at rest, where the gripper can be turned; None: as it
        is turned now.
        """

    @abstractmethod
    def _delta(self, action: Array, start: Array) -> Array:
        """(N, J) the motion of the joints from `start` (N, J) in this control step, before speed limits."""

    def _limit_speed(self, delta: Array) -> Array:
        """Scale the whole motion down to the speed limits, not each joint, so that the gripper keeps its direction."""
        return delta / np.maximum(1.0, np.abs(delta / self._speed).max(1, keepdims=True))

    def _ik_step(
        self, position: Array, start: Array, seen: tuple[Pose, Array] | None = None, yaw: Array | None = None
    ) -> Array:
        """One step of inverse kinematics towards position (N, 3) and yaw (N,); None: the orientation at rest."""
        rotation = self._rotation if yaw is None else about_vertical(yaw) @ self._rotation
        return self._kinematics.step(start, position, rotation, max_move=self._max_move, seen=seen)

    def yaw(self, rotation: Array) -> Array:
        """(N,) radians that grippers with these rotations (N, 3, 3) are turned about the vertical."""
        turned = rotation @ self._rotation.T
        return np.arctan2(turned[:, 1, 0] - turned[:, 0, 1], turned[:, 0, 0] + turned[:, 1, 1])

    def _next_yaw(self, rotation: Array, yaw: Array) -> Array:
        """(N,) the yaw after a control step from these rotations (N, 3, 3) towards yaw (N,)."""
        now = self.yaw(rotation)
        return now + np.clip(np.clip(yaw, -MAX_YAW, MAX_YAW) - now, -MAX_YAW_STEP, MAX_YAW_STEP)


class StepControl(Control):
    """Each action moves the gripper, pointing down, by up to max_move along each axis of the workspace frame.

    The yaw changes by up to MAX_YAW_STEP.
    """

    @property
    def unit(self) -> Array:
        return np.ones(3 + self._turns)

    def hold(self, angles: Array, gripper: Array) -> Array:
        return np.zeros((len(angles), 3 + self._turns))

    def _delta(self, action: Array, start: Array) -> Array:
        seen = self._kinematics.jacobian(start)
        goal = seen[0].position + action[:, :3] * self._max_move
        yaw = None
        if self._turns:
            yaw = np.clip(self.yaw(seen[0].rotation) + action[:, 3] * MAX_YAW_STEP, -MAX_YAW, MAX_YAW)
        return self._ik_step(np.clip(goal, *self.box), start, seen, yaw)

    def towards(self, position: Array, commanded: Array, yaw: Array | None = None) -> Array:
        pose = self._kinematics.forward(commanded)
        move = (position - pose.position) / self._max_move
        move /= np.maximum(1.0, np.abs(move).max(1, keepdims=True))
        if not self._turns:
            return move
        now = self.yaw(pose.rotation)
        turn = np.zeros(len(move)) if yaw is None else (self._next_yaw(pose.rotation, yaw) - now) / MAX_YAW_STEP
        return np.concatenate((move, turn[:, None]), axis=1)


class AbsoluteControl(Control):
    """Each action is a position in the gripper box, approached by up to max_move per control step, pointing down.

    The yaw is from -MAX_YAW to MAX_YAW, approached by up to MAX_YAW_STEP per control step.
    """

    @property
    def unit(self) -> Array:
        low, high = self.box
        return np.append(2 * self._max_move / (high - low), [MAX_YAW_STEP / MAX_YAW] * self._turns)

    def hold(self, angles: Array, gripper: Array) -> Array:
        return self._with_yaw(self._scaled(gripper), angles)

    def _with_yaw(self, place: Array, angles: Array, yaw: Array | None = None) -> Array:
        """Return the action (N, size) for scaled positions (N, 3). yaw: (N,); None: that of arms at angles (N, J)."""
        if not self._turns:
            return place
        if yaw is None:
            yaw = self.yaw(self._kinematics.forward(angles).rotation)
        return np.concatenate((place, np.clip(yaw / MAX_YAW, -1.0, 1.0)[:, None]), axis=1)

    def _scaled(self, position: Array) -> Array:
        low, high = self.box
        return np.clip(2 * (position - low) / (high - low) - 1, -1.0, 1.0)

    def _delta(self, action: Array, start: Array) -> Array:
        low, high = self.box
        place = low + (action[:, :3] + 1) / 2 * (high - low)
        if not self._turns:
            return self._ik_step(place, start)
        seen = self._kinematics.jacobian(start)
        return self._ik_step(place, start, seen, self._next_yaw(seen[0].rotation, action[:, 3] * MAX_YAW))

    def towards(self, position: Array, commanded: Array, yaw: Array | None = None) -> Array:
        return self._with_yaw(self._scaled(position), commanded, yaw)


class JointControl(Control):
    """Each action is an angle for every joint, scaled to its limits, approached at the joints' speeds."""

    @property
    def unit(self) -> Array:
        move = np.maximum(PACE * self._speed, np.minimum(self._speed, SLOW))
        return 2 * move / (self._kinematics.high - self._kinematics.low)

    def hold(self, angles: Array, gripper: Array) -> Array:
        return np.clip(self._scaled(angles), -1.0, 1.0)

    def _scaled(self, angles: Array) -> Array:
        low, high = self._kinematics.low, self._kinematics.high
        return 2 * (angles - low) / (high - low) - 1

    def _delta(self, action: Array, start: Array) -> Array:
        low, high = self._kinematics.low, self._kinematics.high
        delta = np.clip(low + (action + 1) / 2 * (high - low) - start, -self._speed, self._speed)
        return self._above_floor(start, delta) if self._guarded else delta

    def _above_floor(self, start: Array, delta: Array) -> Array:
        """(N, J) the motion without the part that leads the gripper below the box, so that it slides along the floor.

        Newton's method for the smallest change of the joints. A gripper that begins below does not sink further.
        """
        least = np.minimum(self._kinematics.forward(start).position[:, 2], self.box[0, 2])
        for _ in range(SLIDES):
            pose, jacobian = self._kinematics.jacobian(start + delta)
            missing = np.maximum(least - pose.position[:, 2], 0.0)
            if not missing.any():
                break
            rise = jacobian[:, 2]  # metres that a radian of each joint lifts the gripper
            delta = delta + rise * (missing / np.maximum((rise * rise).sum(1), 1e-9))[:, None]
        return delta

    def towards(self, position: Array, commanded: Array, yaw: Array | None = None) -> Array:
        pose = self._kinematics.forward(commanded)
        start = pose.position
        move = np.clip(position, *self.box) - start
        length = np.sqrt((move * move).sum(1, keepdims=True))
        # A near waypoint: a far one would be reached on an arc through joint space that can sweep over the table.
        near = start + move * np.minimum(1.0, self._waypoint / np.maximum(length, 1e-9))
        rotation = self._rotation
        if self._turns:
            wish = self.yaw(pose.rotation) if yaw is None else yaw
            rotation = about_vertical(self._next_yaw(pose.rotation, wish)) @ rotation
        joints = self._kinematics.solve(commanded, near, rotation)
        joints = commanded + self._limit_speed(
            joints - commanded
        )  # else each joint would move at its own speed, off the line
        return self._scaled(joints)


def about_vertical(yaw: Array) -> Array:
    """(N, 3, 3) rotations about the vertical by yaw (N,), radians."""
    rotation = np.zeros((len(yaw), 3, 3))
    rotation[:, 0, 0] = rotation[:, 1, 1] = np.cos(yaw)
    rotation[:, 1, 0] = np.sin(yaw)
    rotation[:, 0, 1] = -rotation[:, 1, 0]
    rotation[:, 2, 2] = 1.0
    return rotation


CONTROLS: dict[str, type[Control]] = {
    "joints": JointControl,
    "absolute": AbsoluteControl,
    "step": StepControl,
}


@dataclass(frozen=True, kw_only=True)
class ControlConfig(Checked):
    """name: a key of CONTROLS. max_move: greatest motion of the gripper in one control step, metres."""

    name: str = one_of(*CONTROLS)
    max_move: float = within(0.001, 0.2)
