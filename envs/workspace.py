"""A workspace: the furniture, where objects and the gripper may be, and where the camera stands.

The workspace frame of every position in the project: metres; origin on the table top where the robot is mounted;
x away from the robot, y to the robot's left, z up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from conf.schema import Checked, ConfigError, within


@dataclass(frozen=True, kw_only=True)
class Box(Checked):
    """A box that never moves. size and position of its centre in metres; color RGB in [0, 1]."""

    size: list[float] = within(0.001, 20, count=3)
    position: list[float] = within(-20, 20, count=3)
    color: list[float] = within(0, 1, count=3)
    contact: bool


@dataclass(frozen=True, kw_only=True)
class Camera(Checked):
    """target and distance in metres, yaw and pitch in degrees, width and height in pixels."""

    target: list[float] = within(-20, 20, count=3)
    distance: float = within(0.1, 20)
    yaw: float
    pitch: float = within(-90, 90)
    width: int = within(16, 4096)
    height: int = within(16, 4096)


@dataclass(frozen=True, kw_only=True)
class WorkspaceConfig(Checked):
    """Boxes of numbers are (x0, x1, y0, y1[, z0, z1]) in the workspace frame."""

    name: str
    furniture: dict[str, Box]
    object_area: list[float] = within(-5, 5)
    gripper_box: list[float] = within(-5, 5)
    bounds: list[float] = within(-10, 10)
    camera: Camera

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_box("object_area", self.object_area, 4)
        _check_box("gripper_box", self.gripper_box, 6)
        _check_box("bounds", self.bounds, 6)


def _check_box(name: str, box: Sequence[float], length: int) -> None:
    pairs = list(zip(box[::2], box[1::2], strict=False))
    if len(box) != length or any(low >= high for low, high in pairs):
        raise ConfigError(f"{name}={list(box)} must be {length} numbers, each low < high in turn")
