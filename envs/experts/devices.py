"""Press, switch and turn: move above the device, down beside its handle, and along its path until it is operated."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

from envs.experts.base import OVER, AimingExpert, Array, Slots, choose_rows, register_expert
from envs.sim.devices import DEVICES, facing
from envs.tasks import Task
from envs.tasks.devices import OperateDevice
from envs.tasks.shared.device_motion import lever_way, wheel_way
from envs.tasks.shared.geometry import length
from envs.workspace_env import WorkspaceEnv

ABOVE = 0.13  # metres above the table at which a gripper travels: over every device
ENOUGH = 0.92  # share of its range at which the expert stops
STEP = 0.015  # metres that a handle is pushed in a control step
BEHIND = 0.046  # metres from the middle of a handle at which a gripper goes down beside it
CLOSE = 0.025  # metres behind the middle of a knob from which thin fingers may touch it
RISE = 0.02  # metres that they follow it up or down at most: their friction would otherwise hold it back
LOW = 0.004  # metres below the middle of a handle at which it is pushed: a wide flange passes over it
ASIDE = 0.015  # metres beside its line at which a pushing gripper goes back for another try
LEAD = 0.35  # radians by which the aim leads the gripper around a wheel
APART = 1.15  # radians round a wheel from the peg at which a gripper goes down
SLOWLY = 0.03  # metres that a gripper goes down in a control step; if faster, the joints leave the line
REACHED = 0.012  # metres above the pushing height from which a gripper pushes


class DeviceExpert(AimingExpert):
    """Operates the referent, then keeps still. shut_within: metres beside it within which fingers are shut."""

    shut_within = np.inf

    def __init__(self, env: WorkspaceEnv, task: Task | None = None) -> None:
        super().__init__(env, task)
        assert isinstance(self._task, OperateDevice)
        self._operated = self._task

    def aim(self, referent: Slots, target: Slots) -> tuple[Array, NDArray[np.bool_]]:
        state, task = self._env.state, self._operated
        way, before = task.travel(state)[self._rows, referent], task.before(referent)
        place, turn = self._place(referent), state.quaternions[self._rows, referent]
        done = np.abs(way) >= ENOUGH
        shut = length((place - self._env.gripper)[:, :2]) < self.shut_within
        shut &= self._env.grip_depth == 0  # fingers push while shut; a magnet holds nothing
        return choose_rows(done, self._env.gripper, self._operate(place, turn, way, before)), shut

    @abstractmethod
    def _operate(self, place: Array, turn: Array, way: Array, before: Array) -> Array:
        """Return where the gripper goes (N, 3).

        place, turn, way: (N, 3), (N, 4) and (N,) of the handles. before: (N,) of `OperateDevice.before`.
        """

    def _down(self, start: Array) -> Array:
        """Return where the gripper goes (N, 3): up, over the start (N, 3), and down to it."""
        gripper = self._env.gripper
        offset = start - gripper
        over = length(offset[:, :2]) < OVER
        down = gripper + offset * np.minimum(1.0, SLOWLY / np.maximum(length(offset), 1e-9))[:, None]
        travel, up = start.copy(), gripper.copy()
        travel[:, 2] = up[:, 2] = ABOVE
        return choose_rows(over, down, choose_rows(gripper[:, 2] > ABOVE - 0.03, travel, up))


@register_expert("press", "nl_press")
class PressExpert(DeviceExpert):
    """Moves down onto the button and goes on until it is pressed."""

    def _operate(self, place: Array, turn: Array, way: Array, before: Array) -> Array:
        below = place.copy()
        below[:, 2] = np.minimum(place, self._env.gripper)[:, 2] - STEP
        return self._down(below)


@register_expert("switch", "nl_switch")
class SwitchExpert(DeviceExpert):
    """Moves down behind the lever's knob, then along the knob's path; from in front of it where the lever is over."""

    def _operate(self, place: Array, turn: Array, way: Array, before: Array) -> Array:
        side = lever_way(before)
        ahead, level = side[:, None] * _flat(facing(turn)), place - [0.0, 0.0, LOW]
        offset = self._env.gripper - level
        along = (offset * ahead).sum(1)
        aside = offset - along[:, None] * ahead
        pushing = (np.abs(along + BEHIND) < 0.035) & (length(aside[:, :2]) < ASIDE) & (offset[:, 2] < REACHED)
        onward = self._env.gripper - aside + STEP * ahead
        onward[:, 2] += np.where(along > -CLOSE, self._rise(way, side), 0.0)
        return choose_rows(pushing, onward, self._down(level - BEHIND * ahead))

    def _rise(self, way: Array, side: Array) -> NDArray[np.float64]:
        """(N,) metres by which a gripper that touches a knob follows it up or down. side: (N,) 1 or -1."""
        lever = DEVICES["lever"]
        return -RISE * np.sin(lever.start + lever.way * side * way)


@register_expert("turn", "nl_turn")
class TurnExpert(DeviceExpert):
    """Moves down beside the wheel's peg, then around the axis with it."""

    def __init__(self, env: WorkspaceEnv, task: Task | None = None) -> None:
        super().__init__(env, task)
        device = DEVICES["wheel"]
        self._radius = self._task.device_width * float(np.subtract(device.handle, device.pivot)[0])

    def _operate(self, place: Array, turn: Array, way: Array, before: Array) -> Array:
        out, gripper = _flat(facing(turn)), self._env.gripper
        centre = place - self._radius * out - [0.0, 0.0, LOW]
        offset = gripper - centre
        ahead = _angle(out, offset)  # of the peg; the gripper pushes it away from itself
        nearer = np.where(np.abs(way) > 0.02, np.sign(way), -np.sign(ahead + 1e-9))
        onward = wheel_way(before)
        side = -np.where(onward == 0, nearer, onward)
        behind = side * ahead
        ring = np.abs(length(offset[:, :2]) - self._radius) < ASIDE
        pushing = ring & (behind > 0.4) & (behind < 1.6) & (offset[:, 2] < REACHED)
        angle = np.where(pushing, ahead - side * LEAD, side * APART)
        return choose_rows(pushing, self._round(centre, out, angle), self._down(self._round(centre, out, angle)))

    def _round(self, centre: Array, out: Array, angle: NDArray[np.float64]) -> Array:
        """(N, 3) points on the peg's circle, at `angle` (N,) radians from the peg."""
        across = np.stack((-out[:, 1], out[:, 0], out[:, 2]), axis=1)
        return centre + self._radius * (np.cos(angle)[:, None] * out + np.sin(angle)[:, None] * across)


def _flat(vectors: Array) -> Array:
    """Horizontal vectors (N, 3) of vectors (N, 2): z is 0."""
    return np.column_stack((vectors, np.zeros(len(vectors))))


def _angle(one: Array, other: Array) -> NDArray[np.float64]:
    """(N,) radians from one (N, 3) to the other, seen from above."""
    cross = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    return np.arctan2(cross, (one * other)[:, :2].sum(1))
