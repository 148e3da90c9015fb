"""What an action means: three ways to turn actions in [-1, 1] into joint targets, for all worlds at once.

A control is given the joint angles last commanded, not those measured, so that the motion is smooth and nothing
sags; where a joint is held back (the gripper presses on something), the command stays within LEASH of it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from conf.schema import Checked, one_of, within
from envs.kinematics import Array, Kinematics, Pose

WAYPOINT = 0.08  # metres
LEASH = 0.15  # radians that a command may run ahead of its joint


@dataclass(frozen=True, kw_only=True)
class ControlConfig(Checked):
    """name: a key of CONTROLS. max_move: metres the gripper moves at most in one control step."""

    name: str = one_of("joints", "absolute", "step")
    max_move: float = within(0.001, 0.2)


class Control(ABC):
    """speed: (J,) radians a control step. box: (2, 3), lowest and highest corner of the gripper box, metres."""

    def __init__(self, config: ControlConfig, chain: Kinematics, speed: Array, box: Array) -> None:
        self._max_move, self._chain, self._speed, self._box = config.max_move, chain, speed, box
        self._rotation = chain.forward(chain.rest[None]).rotation[0]

    @property
    @abstractmethod
    def unit(self) -> Array:
        """(size,) how far an action may be from `hold` to be carried out within one control step."""

    @abstractmethod
    def hold(self, angles: Array, gripper: Array) -> Array:
        """The action (N, size) that keeps arms at angles (N, J), grippers at (N, 3), where they are."""

    def targets(self, action: Array, commanded: Array, measured: Array) -> Array:
        """action (N, size), joints last commanded and measured (N, J) to the joints to command now (N, J)."""
        start = np.clip(commanded, measured - LEASH, measured + LEASH)
        delta = self._slowed(self._delta(action, start))
        return np.clip(start + delta, self._chain.low, self._chain.high)

    @abstractmethod
    def towards(self, position: Array, commanded: Array) -> Array:
        """The action (N, size) that brings the gripper nearer to position (N, 3): what an expert would do."""

    @abstractmethod
    def _delta(self, action: Array, start: Array) -> Array:
        """How far the joints (N, J) should go from `start` in this control step, speed limits aside."""

    def _slowed(self, delta: Array) -> Array:
        """Slower as a whole, not joint by joint, so that the gripper keeps its direction."""
        return delta / np.maximum(1.0, np.abs(delta / self._speed).max(1, keepdims=True))

    def _reach(self, position: Array, start: Array, seen: tuple[Pose, Array] | None = None) -> Array:
        return self._chain.step(start, position, self._rotation, self._max_move, seen)


class Step(Control):
    """Each action moves the gripper, pointing down, by up to max_move along each axis of the workspace frame."""

    @property
    def unit(self) -> Array:
        return np.ones(3)

    def hold(self, angles: Array, gripper: Array) -> Array:
        return np.zeros((len(angles), 3))

    def _delta(self, action: Array, start: Array) -> Array:
        seen = self._chain.jacobian(start)
        goal = seen[0].position + action * self._max_move
        return self._reach(np.clip(goal, *self._box), start, seen)

    def towards(self, position: Array, commanded: Array) -> Array:
        move = (position - self._chain.forward(commanded).position) / self._max_move
        return move / np.maximum(1.0, np.abs(move).max(1, keepdims=True))


class Absolute(Control):
    """Each action is a place in the gripper box, approached by up to max_move a control step, pointing down."""

    @property
    def unit(self) -> Array:
        low, high = self._box
        return 2 * self._max_move / (high - low)

    def hold(self, angles: Array, gripper: Array) -> Array:
        return self._scaled(gripper)

    def _scaled(self, position: Array) -> Array:
        low, high = self._box
        return np.clip(2 * (position - low) / (high - low) - 1, -1.0, 1.0)

    def _delta(self, action: Array, start: Array) -> Array:
        low, high = self._box
        return self._reach(low + (action + 1) / 2 * (high - low), start)

    def towards(self, position: Array, commanded: Array) -> Array:
        return self._scaled(position)


class Joints(Control):
    """Each action is an angle for every joint, scaled to its limits, approached at the joints' speeds."""

    @property
    def unit(self) -> Array:
        return 2 * self._speed / (self._chain.high - self._chain.low)

    def hold(self, angles: Array, gripper: Array) -> Array:
        return np.clip(self._scaled(angles), -1.0, 1.0)

    def _scaled(self, angles: Array) -> Array:
        low, high = self._chain.low, self._chain.high
        return 2 * (angles - low) / (high - low) - 1

    def _delta(self, action: Array, start: Array) -> Array:
        low, high = self._chain.low, self._chain.high
        return np.clip(low + (action + 1) / 2 * (high - low) - start, -self._speed, self._speed)

    def towards(self, position: Array, commanded: Array) -> Array:
        start = self._chain.forward(commanded).position
        move = np.clip(position, *self._box) - start
        length = np.sqrt((move * move).sum(1, keepdims=True))
        # A near waypoint: far ones are reached on an arc through joint space that can sweep over the table.
        near = start + move * np.minimum(1.0, WAYPOINT / np.maximum(length, 1e-9))
        joints = self._chain.solve(commanded, near, self._rotation)
        joints = commanded + self._slowed(joints - commanded)  # else each joint at its own speed, off the line
        return self._scaled(joints)


CONTROLS: dict[str, type[Control]] = {"joints": Joints, "absolute": Absolute, "step": Step}
