"""Devices, which stand fixed on the table and are pressed, switched or turned: their shapes and joints, as data.

Lengths are in widths of the device; its width is the task's object_size. Frame: the origin is on the table under the
joint's axis, z is up, and x, the direction that the device faces, is turned by its yaw.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Point = tuple[float, float, float]


@dataclass(frozen=True)
class DevicePart:
    """A box turned by yaw (radians), or a cylinder along the axis x, y or z.

    size, and place of its centre: along x, y and z.
    """

    size: Point
    place: Point
    cylinder: str = ""
    yaw: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Device:
    """A base that never moves, and one part that slides along an axis ("slide") or turns about it ("turn").

    pivot: a point of the axis. handle: the point that is touched. All positions are those with the joint at 0.
    low, high: the joint's limits, widths or radians. start: where it begins an episode. way: the joint's travel from
    there to its end. spring: force back to the start, N. friction: N or N m that hold the joint where it is.
    drawn: visual shape of the moving part, where it differs from its collision shape. Bullet takes 16 shapes at most.
    mark: white parts of the base that are only drawn: from them it can be seen which way the device was placed.
    """

    joint: str
    axis: Point
    pivot: Point
    handle: Point
    low: float
    high: float
    way: float
    base: tuple[DevicePart, ...]
    moving: tuple[DevicePart, ...]
    start: float = 0.0
    spring: float = 0.0
    friction: float = 0.0
    drawn: tuple[DevicePart, ...] = ()
    mark: tuple[DevicePart, ...] = ()

    def scale(self, width: float) -> float:
        """Return the factor from a joint value in widths or radians to one in metres or radians."""
        return width if self.joint == "slide" else 1.0

    @property
    def lowest(self) -> float:
        """Widths above the table at which the handle is lowest."""
        if self.joint == "slide":
            return min(self.handle[2] + self.axis[2] * value for value in (self.low, self.high))
        arm = np.subtract(self.handle, self.pivot)
        return self.pivot[2] + min(float(_rotated(arm, self.axis, value)[2]) for value in (self.low, self.high))

    def travelled(self, width: float, before: Array, now: Array) -> Array:
        """(...) in [-1, 1]: the share of `way` from one joint value to another, (...) metres or radians."""
        gone = now - before
        if self.joint == "turn":
            gone = np.arctan2(np.sin(gone), np.cos(gone))
        return np.clip(gone / (self.way * self.scale(width)), -1.0, 1.0)

    def value(self, share: ArrayLike) -> Array:
        """(...) the joint value at this share of its range, (...) in [0, 1]; widths or radians."""
        return self.low + np.asarray(share) * (self.high - self.low)

    def grip(self, width: float, value: float | None = None) -> Array:
        """(3,) position of the handle at a joint value, widths or radians, in metres. value: None: the start."""
        value = self.start if value is None else value
        arm = np.subtract(self.handle, self.pivot)
        if self.joint == "turn":
            arm = _rotated(arm, self.axis, value)
        elif value:
            arm = arm + np.multiply(self.axis, value)
        return width * (np.array(self.pivot) + arm)


def turned(points: Array, yaw: Array) -> Array:
    """(..., 3) points turned about the vertical. points: (..., 3), metres. yaw: (...), radians."""
    x, y, z = np.moveaxis(points, -1, 0)
    forward, left = np.cos(yaw), np.sin(yaw)
    return np.stack((forward * x - left * y, left * x + forward * y, z), axis=-1)


def facing(quaternions: Array) -> Array:
    """(..., 2) unit vectors over the table in the direction that devices face. quaternions: (..., 4) of their handles.

    It follows from their y axes, which the motion of a lever does not change.
    """
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    return np.stack((1 - 2 * (x * x + z * z), 2 * (z * w - x * y)), axis=-1)


def _rotated(vector: Array, axis: Sequence[float], angle: float) -> Array:
    """Source: Rodrigues' rotation formula."""
    k = np.array(axis)
    return vector * math.cos(angle) + np.cross(k, vector) * math.sin(angle) + k * (k @ vector) * (1 - math.cos(angle))


def _rim(count: int, radius: float, size: tuple[float, float], height: float) -> tuple[DevicePart, ...]:
    """A ring of boxes about the z axis. radius: inner. size: of a box, radially and along z. height: of its centre."""
    angles = [2 * math.pi * i / count for i in range(count)]
    sides = (size[0], 2 * (radius + size[0] / 2) * math.tan(math.pi / count), size[1])
    return tuple(DevicePart(sides, (radius * math.cos(a), radius * math.sin(a), height), yaw=a) for a in angles)


_PEG = DevicePart((0.28, 0.28, 0.54), (0.6, 0.0, 0.77), "z")
_SPOKES = tuple(DevicePart((1.3, 0.14, 0.16), (0.0, 0.0, 0.4), yaw=math.pi * i / 3) for i in range(3))

DEVICES: dict[str, Device] = {
    "button": Device(
        joint="slide",
        axis=(0.0, 0.0, -1.0),
        pivot=(0.0, 0.0, 0.83),
        handle=(0.0, 0.0, 0.83),
        low=0.0,
        high=0.33,
        way=0.33,
        base=(DevicePart((1.0, 1.0, 0.44), (0.0, 0.0, 0.22)),),
        moving=(DevicePart((0.7, 0.7, 0.5), (0.0, 0.0, 0.58), "z"),),
        spring=5.0,
    ),
    "lever": Device(
        joint="turn",
        axis=(0.0, 1.0, 0.0),
        pivot=(0.0, 0.0, 0.3),
        handle=(0.0, 0.0, 1.15),
        low=-0.7,
        high=0.7,
        start=-0.7,
        way=1.4,
        base=(DevicePart((1.0, 0.8, 0.25), (0.0, 0.0, 0.125)),),
        moving=(DevicePart((0.14, 0.14, 0.8), (0.0, 0.0, 0.7)), DevicePart((0.28, 0.7, 0.28), (0.0, 0.0, 1.15), "y")),
        friction=0.05,
        mark=(DevicePart((0.4, 0.82, 0.27), (0.5, 0.0, 0.135)),),  # the side to which it is switched
    ),
    "wheel": Device(
        joint="turn",
        axis=(0.0, 0.0, 1.0),
        pivot=(0.0, 0.0, 0.4),
        handle=(0.6, 0.0, 0.8),
        low=-math.radians(75),
        high=math.radians(75),
        way=math.radians(75),
        base=(DevicePart((0.6, 0.6, 0.3), (0.0, 0.0, 0.15), "z"),),
        moving=(DevicePart((1.5, 1.5, 0.2), (0.0, 0.0, 0.4), "z"), _PEG),
        drawn=(*_rim(11, 0.66, (0.18, 0.2), 0.4), *_SPOKES, DevicePart((0.36, 0.36, 0.2), (0.0, 0.0, 0.4), "z"), _PEG),
        friction=0.03,
        mark=(DevicePart((0.6, 0.3, 0.08), (1.05, 0.0, 0.04)),),  # beside the peg before it is turned
    ),
}
