"""The devices of one world as bodies: made once, stood on the table where each episode has them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pybullet as bullet

from envs.sim.devices import DEVICES, Device, Part, Point
from envs.sim.furniture import JOINTS, LINK, UPRIGHT

STORED = -15.0  # metres: how deep devices stand that this episode does not show
APART = 2.0  # metres between those
MASS = 0.05  # kg of what moves
BASE = (0.25, 0.25, 0.28, 1.0)  # RGBA
SOFTNESS = 0.1  # share of its way back that a spring takes in a physics step, where nothing holds it
LYING = {"x": (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)), "y": (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))}
Pose = tuple[tuple[float, ...], tuple[float, ...]]


class DeviceBodies:
    """nouns: of the devices, one body each. width: metres, as in `Device`. visuals: load what is drawn."""

    def __init__(self, nouns: Sequence[str], width: float, client: int, visuals: bool) -> None:
        self._width, self._client, self._visuals = width, client, visuals
        self._devices = [DEVICES[noun] for noun in nouns]
        self.bodies = [self._body(device, -APART * i) for i, device in enumerate(self._devices)]
        self._shown = 0

    def _body(self, device: Device, y: float) -> int:
        """A body whose base stays and whose one link has its centre of mass at the handle, and so is measured there:
        upright as it begins."""
        upright = bullet.getQuaternionFromAxisAngle(device.axis, -device.start * (device.joint == "turn"))
        body = bullet.createMultiBody(
            0,
            self._touched(device.base, (0, 0, 0)),
            self._drawn(device.base, (0, 0, 0)),
            basePosition=(0.0, y, STORED),
            linkMasses=[MASS],
            linkCollisionShapeIndices=[self._touched(device.moving, device.pivot)],
            linkVisualShapeIndices=[self._drawn(device.drawn or device.moving, device.pivot)],
            linkPositions=[self._metres(device.pivot)],
            linkOrientations=[UPRIGHT],
            linkInertialFramePositions=[self._metres(np.subtract(device.handle, device.pivot))],
            linkInertialFrameOrientations=[upright],
            linkParentIndices=[0],
            linkJointTypes=[JOINTS[device.joint]],
            linkJointAxis=[device.axis],
            physicsClientId=self._client,
        )
        self._guide(body, device)
        if self._visuals:
            bullet.changeVisualShape(body, -1, rgbaColor=BASE, physicsClientId=self._client)
        return body

    def _guide(self, body: int, device: Device) -> None:
        """Limits, and a motor that stays for good: dry friction, or a spring of one force all the way."""
        scale = device.scale(self._width)
        limits = {"jointLowerLimit": device.low * scale, "jointUpperLimit": device.high * scale}
        bullet.changeDynamics(body, LINK, **limits, physicsClientId=self._client)
        motor = {"controlMode": bullet.VELOCITY_CONTROL, "targetVelocity": 0, "force": device.friction}
        if device.spring:
            motor = {
                "controlMode": bullet.POSITION_CONTROL,
                "targetPosition": device.start * scale,
                "positionGain": SOFTNESS,
                "force": device.spring,
            }
        bullet.setJointMotorControl2(body, LINK, **motor, physicsClientId=self._client)

    def show(self, places: Sequence[Sequence[float]], yaw: Sequence[float], colors: Sequence[Sequence[float]]) -> None:
        """Stand the first devices on the table. places: of their handles, as they begin, metres. colors: RGBA."""
        self._shown = len(places)
        for body, device, place, angle, color in zip(self.bodies, self._devices, places, yaw, colors, strict=False):
            x, y, _ = device.grip(self._width)
            forward, left = math.cos(angle), math.sin(angle)
            stand = (place[0] - forward * x + left * y, place[1] - left * x - forward * y, 0.0)
            turned = (0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2))
            bullet.resetBasePositionAndOrientation(body, stand, turned, self._client)
            if self._visuals:
                bullet.changeVisualShape(body, LINK, rgbaColor=color, physicsClientId=self._client)

    def reset(self) -> None:
        """All joints at rest at their start, wherever the devices stand."""
        for body, device in zip(self.bodies, self._devices, strict=True):
            start = device.start * device.scale(self._width)
            bullet.resetJointState(body, LINK, start, 0.0, self._client)

    def poses(self) -> list[Pose]:
        """(position, quaternion) of the handle of each device that is shown."""
        return [
            bullet.getLinkState(body, LINK, computeForwardKinematics=1, physicsClientId=self._client)[:2]
            for body in self.bodies[: self._shown]
        ]

    def _touched(self, parts: Sequence[Part], origin: Point) -> int:
        """The parts as one collision shape about `origin`."""
        return bullet.createCollisionShapeArray(
            **self._shapes(parts),
            lengths=[self._width * _along(part) for part in parts],
            collisionFramePositions=self._places(parts, origin),
            collisionFrameOrientations=[_orientation(part) for part in parts],
            physicsClientId=self._client,
        )

    def _drawn(self, parts: Sequence[Part], origin: Point) -> int:
        """The parts as one visual shape about `origin`; -1 where nothing is drawn."""
        if not self._visuals:
            return -1
        return bullet.createVisualShapeArray(
            **self._shapes(parts),
            lengths=[self._width * _along(part) for part in parts],
            visualFramePositions=self._places(parts, origin),
            visualFrameOrientations=[_orientation(part) for part in parts],
            physicsClientId=self._client,
        )

    def _shapes(self, parts: Sequence[Part]) -> dict:
        return {
            "shapeTypes": [bullet.GEOM_CYLINDER if part.cylinder else bullet.GEOM_BOX for part in parts],
            "halfExtents": [self._metres(np.divide(part.size, 2)) for part in parts],
            "radii": [self._width * part.size["yzx".index(part.cylinder or "x")] / 2 for part in parts],
        }

    def _places(self, parts: Sequence[Part], origin: Point) -> list[list[float]]:
        return [self._metres(np.subtract(part.place, origin)) for part in parts]

    def _metres(self, widths: Sequence[float] | np.ndarray) -> list[float]:
        return (self._width * np.asarray(widths, float)).tolist()


def _along(part: Part) -> float:
    """A cylinder's length, widths."""
    return part.size["xyz".index(part.cylinder or "z")]


def _orientation(part: Part) -> Sequence[float]:
    """A quaternion."""
    return LYING.get(part.cylinder, (0.0, 0.0, math.sin(part.yaw / 2), math.cos(part.yaw / 2)))
