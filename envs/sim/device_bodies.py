"""The devices of one world as bodies, which are made once and placed on the table in each episode."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pybullet as bullet

from envs.sim.devices import DEVICES, Device, DevicePart, Point
from envs.sim.furniture import JOINTS, LINK, UPRIGHT

PARKED_HEIGHT = -15.0  # metres: where devices stand that the episode does not show
PARKED_SPACING = 2.0  # metres between those
MASS = 0.05  # kg, of the moving part
BASE_COLOR, MARK_COLOR = (0.25, 0.25, 0.28, 1.0), (0.95, 0.95, 0.95, 1.0)  # RGBA
SPRING_GAIN = 0.1  # part of the way back that a free spring takes in a physics step
CYLINDER_ROTATIONS = {"x": (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)), "y": (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))}
Pose = tuple[tuple[float, ...], tuple[float, ...]]


@dataclass(frozen=True)
class DeviceSpec:
    """The devices that an episode shows at most: the noun of each, and their width, metres."""

    nouns: Sequence[str] = ()
    width: float = 1.0


class DeviceBodies:
    """bodies: one for each noun of `spec`. shown: those of the current episode, in the order of its devices.

    visuals: load visual shapes.
    """

    def __init__(self, spec: DeviceSpec, client: int, visuals: bool) -> None:
        self._width, self._client, self._visuals = spec.width, client, visuals
        nouns = spec.nouns
        self._devices = [DEVICES[noun] for noun in nouns]
        self.bodies = [self._body(device, -PARKED_SPACING * i) for i, device in enumerate(self._devices)]
        self._nouns, self.shown = list(nouns), self.bodies[:0]

    def pose(self, body: int) -> Pose:
        """(position, quaternion) of a device's handle."""
        return bullet.getLinkState(body, LINK, computeForwardKinematics=1, physicsClientId=self._client)[:2]

    def _body(self, device: Device, y: float) -> int:
        """A body with a fixed base and one link. The link's centre of mass, and so its measured pose, is at the handle;
        its orientation is upright at the start."""
        upright = bullet.getQuaternionFromAxisAngle(device.axis, -device.start * (device.joint == "turn"))
        body = bullet.createMultiBody(
            0,
            self._collision_shape(device.base, (0, 0, 0)),
            self._visual_shape(device.base + device.mark, (0, 0, 0)),
            basePosition=(0.0, y, PARKED_HEIGHT),
            linkMasses=[MASS],
            linkCollisionShapeIndices=[self._collision_shape(device.moving, device.pivot)],
            linkVisualShapeIndices=[self._visual_shape(device.drawn or device.moving, device.pivot)],
            linkPositions=[self._metres(device.pivot)],
            linkOrientations=[UPRIGHT],
            linkInertialFramePositions=[self._metres(np.subtract(device.handle, device.pivot))],
            linkInertialFrameOrientations=[upright],
            linkParentIndices=[0],
            linkJointTypes=[JOINTS[device.joint]],
            linkJointAxis=[device.axis],
            physicsClientId=self._client,
        )
        self._set_up_joint(body, device)
        if self._visuals:
            for part in range(len(device.base) + len(device.mark)):
                color = BASE_COLOR if part < len(device.base) else MARK_COLOR
                bullet.changeVisualShape(body, -1, part, rgbaColor=color, physicsClientId=self._client)
        return body

    def _set_up_joint(self, body: int, device: Device) -> None:
        """Set the joint's limits, and a permanent motor: dry friction, or a spring of constant force."""
        scale = device.scale(self._width)
        limits = {"jointLowerLimit": device.low * scale, "jointUpperLimit": device.high * scale}
        bullet.changeDynamics(body, LINK, **limits, physicsClientId=self._client)
        motor = {"controlMode": bullet.VELOCITY_CONTROL, "targetVelocity": 0, "force": device.friction}
        if device.spring:
            motor = {
                "controlMode": bullet.POSITION_CONTROL,
                "targetPosition": device.start * scale,
                "positionGain": SPRING_GAIN,
                "force": device.spring,
            }
        bullet.setJointMotorControl2(body, LINK, **motor, physicsClientId=self._client)

    def show(
        self,
        *,
        nouns: Sequence[str],
        places: Sequence[Sequence[float]],
        yaw: Sequence[float],
        colors: Sequence[Sequence[float]],
        shares: Sequence[float] | None = None,
    ) -> None:
        """Place devices on the table.

        Args:
            nouns: one for each device.
            places: of their handles, metres.
            yaw: radians.
            colors: RGBA.
            shares: of their joints' ranges; None: they are at their start.
        """
        unused = {
            noun: [body for body, of in zip(self.bodies, self._nouns, strict=True) if of == noun] for noun in nouns
        }
        self.shown = [unused[noun].pop(0) for noun in nouns]
        for number, (body, noun, place, angle) in enumerate(zip(self.shown, nouns, places, yaw, strict=True)):
            value = None if shares is None else float(DEVICES[noun].value(shares[number]))
            if value is not None:
                bullet.resetJointState(body, LINK, value * DEVICES[noun].scale(self._width), 0.0, self._client)
            x, y, _ = DEVICES[noun].grip(self._width, value)
            forward, left = math.cos(angle), math.sin(angle)
            stand = (place[0] - forward * x + left * y, place[1] - left * x - forward * y, 0.0)
            turned = (0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2))
            bullet.resetBasePositionAndOrientation(body, stand, turned, self._client)
            if self._visuals:
                bullet.changeVisualShape(body, LINK, rgbaColor=colors[number], physicsClientId=self._client)

    def reset(self) -> None:
        """Put all joints to rest at their start."""
        for body, device in zip(self.bodies, self._devices, strict=True):
            start = device.start * device.scale(self._width)
            bullet.resetJointState(body, LINK, start, 0.0, self._client)

    def poses(self) -> list[Pose]:
        """(position, quaternion) of the handle of each shown device."""
        return [self.pose(body) for body in self.shown]

    def _collision_shape(self, parts: Sequence[DevicePart], origin: Point) -> int:
        """Return the parts as one collision shape about `origin`."""
        return bullet.createCollisionShapeArray(
            **self._shapes(parts),
            lengths=[self._width * _cylinder_length(part) for part in parts],
            collisionFramePositions=self._places(parts, origin),
            collisionFrameOrientations=[_orientation(part) for part in parts],
            physicsClientId=self._client,
        )

    def _visual_shape(self, parts: Sequence[DevicePart], origin: Point) -> int:
        """Return the parts as one visual shape about `origin`; -1 without visuals."""
        if not self._visuals:
            return -1
        return bullet.createVisualShapeArray(
            **self._shapes(parts),
            lengths=[self._width * _cylinder_length(part) for part in parts],
            visualFramePositions=self._places(parts, origin),
            visualFrameOrientations=[_orientation(part) for part in parts],
            physicsClientId=self._client,
        )

    def _shapes(self, parts: Sequence[DevicePart]) -> dict:
        return {
            "shapeTypes": [bullet.GEOM_CYLINDER if part.cylinder else bullet.GEOM_BOX for part in parts],
            "halfExtents": [self._metres(np.divide(part.size, 2)) for part in parts],
            "radii": [self._width * part.size["yzx".index(part.cylinder or "x")] / 2 for part in parts],
        }

    def _places(self, parts: Sequence[DevicePart], origin: Point) -> list[list[float]]:
        return [self._metres(np.subtract(part.place, origin)) for part in parts]

    def _metres(self, widths: Sequence[float] | np.ndarray) -> list[float]:
        return (self._width * np.asarray(widths, float)).tolist()


def _cylinder_length(part: DevicePart) -> float:
    """Return the length of a cylinder, widths."""
    return part.size["xyz".index(part.cylinder or "z")]


def _orientation(part: DevicePart) -> Sequence[float]:
    """A quaternion."""
    return CYLINDER_ROTATIONS.get(part.cylinder, (0.0, 0.0, math.sin(part.yaw / 2), math.cos(part.yaw / 2)))
