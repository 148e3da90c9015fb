"""A workspace: the furniture, where objects and the gripper may be, where the camera stands, and who else is there.

The workspace frame of every position in the project: metres; origin on the table top where the robot is mounted: a
robot stands elsewhere at a table by where the workspace puts all else, and its URDF's own origin by `robot.base`;
x away from the robot, y to the robot's left, z up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from conf.schema import Checked, ConfigError, one_of, within
from human import Camera, HumanConfig


@dataclass(frozen=True, kw_only=True)
class Box(Checked):
    """A box that never moves, or a part of a fitting. size and position of its centre in metres; color RGB in [0, 1].

    contact: whether anything touches it; else it is only drawn.
    """

    size: list[float] = within(0.001, 20, count=3)
    position: list[float] = within(-20, 20, count=3)
    color: list[float] = within(0, 1, count=3)
    contact: bool


@dataclass(frozen=True, kw_only=True)
class Fitting(Checked):
    """What slides or turns when it is pushed, and stays where it is left: a drawer, a door.

    Its joint goes from low to high, metres along the axis or radians about it, right-handed. origin: metres, a point of
    the axis. friction: what holds it back, in N or N m; mass in kg. parts stand as they do where the joint is at 0.
    """

    joint: str = one_of("slide", "turn")
    origin: list[float] = within(-20, 20, count=3)
    axis: list[float] = within(-1, 1, count=3)
    low: float = within(-10, 10)
    high: float = within(-10, 10)
    start: float = within(-10, 10)
    friction: float = within(0, 1000)
    mass: float = within(0.01, 1000)
    parts: dict[str, Box]

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.low >= self.high:
            raise ConfigError(f"low={self.low} must be less than high={self.high}")
        if not self.low <= self.start <= self.high:
            raise ConfigError(f"start={self.start} must be between low={self.low} and high={self.high}")
        if abs(math.hypot(*self.axis) - 1) > 1e-3:
            raise ConfigError(f"axis={self.axis} must be of length 1")
        if not self.parts:
            raise ConfigError("parts={} must name at least one box")


@dataclass(frozen=True, kw_only=True)
class WorkspaceConfig(Checked):
    """Boxes of numbers are (x0, x1, y0, y1[, z0, z1]) in the workspace frame."""

    name: str
    furniture: dict[str, Box]
    fittings: dict[str, Fitting]
    object_area: list[float] = within(-5, 5)
    gripper_box: list[float] = within(-5, 5)
    bounds: list[float] = within(-10, 10)
    camera: Camera
    human: HumanConfig | None  # who stands there; none: nobody

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_box("object_area", self.object_area, 4)
        _check_box("gripper_box", self.gripper_box, 6)
        _check_box("bounds", self.bounds, 6)


def _check_box(name: str, box: Sequence[float], length: int) -> None:
    pairs = list(zip(box[::2], box[1::2], strict=False))
    if len(box) != length or any(low >= high for low, high in pairs):
        raise ConfigError(f"{name}={list(box)} must be {length} numbers, each low < high in turn")
