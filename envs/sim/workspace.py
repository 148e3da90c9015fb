"""Configuration of a workspace: furniture, areas for objects and gripper, cameras, and the person.

Every position in the project is in the workspace frame: metres, origin on the table top where the robot is mounted,
x away from the robot, y to the robot's left, z up. To mount the robot elsewhere at the table, move all else in the
workspace; `robot.base` is only the offset of the URDF's own origin.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.errors import ConfigError, did_you_mean
from core.schema import Checked, one_of, within, word
from human import Camera, HumanConfig

PLATE, DRAWN = 0.002, 0.0003  # metres: thickness of the drawn parts of a board, and their height above the table
FILM = "film"  # the name of the camera that takes the pictures of films
VIDEO = 1.5  # times as wide and high as the pictures of that camera are videos: 720 pixels, not 480
ROBOTS_SIDE = -30.0  # degrees, the yaw of a camera that looks past the robot at the table
HANDLE = "handle"  # the part of a fitting by which a gripper holds it
AROUND = 0.02  # metres between objects and the end of a robot's reach, so that the gripper gets around them


@dataclass(frozen=True, kw_only=True)
class Box(Checked):
    """A box that never moves, or a part of a fitting. size and position of its centre in metres; color RGB in [0, 1].

    contact: whether it collides; else it is only drawn.
    """

    size: list[float] = within(0.001, 20, count=3)
    position: list[float] = within(-20, 20, count=3)
    color: list[float] = within(0, 1, count=3)
    contact: bool


@dataclass(frozen=True, kw_only=True)
class Fitting(Checked):
    """Furniture on a joint, such as a drawer or a door: it moves when pushed, and stays where it is left.

    The joint goes from low to high, metres along the axis or radians about it (right-handed). origin: a point of the
    axis, metres. friction: N or N m that hold the joint back. mass: kg. grip: lateral friction of its surface, which
    Bullet multiplies with that of what touches it. inside: x0, x1, y0, y1, z0, z1 where objects are in it with the
    joint at 0, metres; [] where none can be. parts: boxes, with the joint at 0; a gripper holds the fitting by
    the one that is called "handle".
    """

    joint: str = one_of("slide", "turn")
    origin: list[float] = within(-20, 20, count=3)
    axis: list[float] = within(-1, 1, count=3)
    low: float = within(-10, 10)
    high: float = within(-10, 10)
    start: float = within(-10, 10)
    friction: float = within(0, 1000)
    mass: float = within(0.01, 1000)
    grip: float = within(0, 10)
    inside: list[float] = within(-20, 20, count=(0, 6))
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
        if self.inside:
            _check_box("inside", self.inside, 6)

    def value(self, share: ArrayLike) -> NDArray[np.float64]:
        """(...) the joint value, metres or radians, of a fitting that is open by this share, (...) in [0, 1]."""
        return self.low + np.asarray(share, np.float64) * (self.high - self.low)

    def share(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """(...) the share by which a fitting is open, given the positions (..., 3) of its handle, metres."""
        if self.joint == "slide":
            value = (places - self.parts[HANDLE].position) @ self.axis
        else:
            _, sine, cosine = self._turning
            now = places - self.origin
            value = np.arctan2(now @ sine, now @ cosine)
        return (value - self.low) / (self.high - self.low)

    def inside_at(self, share: ArrayLike) -> NDArray[np.float64]:
        """(..., 2, 3) lowest and highest corner of `inside` in a fitting that is open by this share (...), metres."""
        corners = np.reshape(self.inside, (3, 2)).T
        if self.joint == "turn":
            return np.broadcast_to(corners, (*np.shape(share), 2, 3))
        return corners + (self.value(share)[..., None] * self.axis)[..., None, :]

    def handle_at(self, value: ArrayLike) -> NDArray[np.float64]:
        """(..., 3) where the centre of the handle is, metres, at this joint value, (...) metres or radians."""
        value = np.asarray(value, np.float64)[..., None]
        if self.joint == "slide":
            return self.parts[HANDLE].position + value * self.axis
        middle, sine, cosine = self._turning
        return middle + sine * np.sin(value) + cosine * np.cos(value)

    @cached_property
    def _turning(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """The centre of the handle's circle, and the vectors that the joint value's sine and cosine multiply.

        (3,) metres each. Source: Rodrigues' rotation formula.
        """
        axis, arm = np.array(self.axis), np.subtract(self.parts[HANDLE].position, self.origin)
        along = axis * (axis @ arm)
        return self.origin + along, np.cross(axis, arm), arm - along


@dataclass(frozen=True, kw_only=True)
class BoardConfig(Checked):
    """A board of square cells on the table, which is only drawn. Stacks on it are up to `levels` objects high.

    corner: x and y where the board is nearest to the robot and farthest to its right, metres. cell: width, metres.
    columns, rows: cells along x and along y. light, dark: RGB in [0, 1] of alternate cells.
    """

    corner: list[float] = within(-5, 5, count=2)
    cell: float = within(0.01, 1)
    columns: int = within(1, 100)
    rows: int = within(1, 100)
    levels: int = within(1, 100)
    light: list[float] = within(0, 1, count=3)
    dark: list[float] = within(0, 1, count=3)

    @property
    def area(self) -> list[float]:
        """x0, x1, y0, y1, metres."""
        x, y = self.corner
        return [x, round(x + self.columns * self.cell, 6), y, round(y + self.rows * self.cell, 6)]

    def cells(self) -> list[Box]:
        """Return the drawn parts: a light plate, and each dark cell on it."""
        x0, x1, y0, y1 = self.area
        plate = Box(
            size=[x1 - x0, y1 - y0, PLATE],
            position=[(x0 + x1) / 2, (y0 + y1) / 2, DRAWN - PLATE / 2],
            color=self.light,
            contact=False,
        )
        return [plate, *(self._dark(i, j) for i in range(self.columns) for j in range(i % 2, self.rows, 2))]

    def _dark(self, i: int, j: int) -> Box:
        x, y = (corner + (k + 0.5) * self.cell for corner, k in zip(self.corner, (i, j), strict=True))
        size = [self.cell, self.cell, PLATE]
        return Box(size=size, position=[x, y, 2 * DRAWN - PLATE / 2], color=self.dark, contact=False)


@dataclass(frozen=True, kw_only=True)
class WorkspaceConfig(Checked):
    """Areas are (x0, x1, y0, y1[, z0, z1]) in the workspace frame, metres."""

    name: str = word()
    furniture: dict[str, Box]
    fittings: dict[str, Fitting]
    object_area: list[float] = within(-5, 5, count=4)
    gripper_box: list[float] = within(-5, 5, count=6)
    bounds: list[float] = within(-10, 10, count=6)
    cameras: dict[str, Camera]  # by name; FILM is one of them
    human: HumanConfig | None  # the person in the workspace, if any
    board: BoardConfig | None  # the board on the table, if any
    device_area: list[float] = within(
        -5, 5, count=(0, 4), default=()
    )  # where devices stand beside fittings; []: nowhere

    def __post_init__(self) -> None:
        super().__post_init__()
        if FILM not in self.cameras:
            raise ConfigError(f"cameras={list(self.cameras)} must have {FILM}, which takes the pictures of films")
        if self.film.mount != "workspace":
            raise ConfigError(f"cameras.{FILM}.mount={self.film.mount} must be workspace: films have a fixed camera")
        _check_box("object_area", self.object_area, 4)
        _check_box("gripper_box", self.gripper_box, 6)
        _check_box("bounds", self.bounds, 6)
        for name in ("object_area", "gripper_box"):
            if not _holds(self.bounds, getattr(self, name)):
                raise ConfigError(f"{name}={getattr(self, name)} must lie in bounds={self.bounds}")
        if self.device_area:
            _check_box("device_area", self.device_area, 4)

    @property
    def film(self) -> Camera:
        """The camera that takes the pictures of films."""
        return self.cameras[FILM]

    def film_from(self, viewpoint: str) -> Camera:
        """Return the camera of videos, on the side of those whose left and right are meant.

        There, what is left of a thing is left of it in the picture. viewpoint: of `language.VIEWPOINTS`.
        """
        width, height = round(VIDEO * self.film.width), round(VIDEO * self.film.height)
        camera = replace(self.film, width=width, height=height)
        if (math.sin(math.radians(camera.yaw)) < 0) == (viewpoint == "robot"):
            return camera
        return replace(camera, yaw=ROBOTS_SIDE if viewpoint == "robot" else -camera.yaw)

    def named_cameras(self, key: str, names: Sequence[str]) -> dict[str, Camera]:
        """Return these cameras, by name. key: that asks for them. Raises ConfigError for a name that is not known."""
        for name in names:
            if name not in self.cameras:
                raise ConfigError(
                    f"{key}=[{','.join(names)}]: workspace={self.name} has no camera {name}"
                    + did_you_mean(name, self.cameras)
                )
        return {name: self.cameras[name] for name in names}

    def within_reach(self, reach: Sequence[float]) -> WorkspaceConfig:
        """Return the workspace with object_area and gripper_box cut to a robot's reach: (x0, x1, y0, y1, z0, z1).

        Raises ConfigError where nothing is left.
        """
        inner = [round(edge + (-AROUND if i % 2 else AROUND), 6) for i, edge in enumerate(reach[:4])]
        area, box = _common(self.object_area, inner), _common(self.gripper_box, reach)
        for name, left in (("object_area", area), ("gripper_box", box)):
            if any(low >= high for low, high in zip(left[::2], left[1::2], strict=True)):
                raise ConfigError(
                    f"workspace={self.name}: {name}={getattr(self, name)} is beyond the robot's reach={list(reach)}; "
                    "choose another workspace or robot"
                )
        return replace(self, object_area=area, gripper_box=box)


def _holds(box: Sequence[float], inner: Sequence[float]) -> bool:
    """Whether a box has another one in it, in the dimensions of the inner one."""
    pairs = enumerate(zip(box, inner, strict=False))
    return all(low <= high for low, high in (pair[::-1] if i % 2 else pair for i, pair in pairs))


def _common(box: Sequence[float], other: Sequence[float]) -> list[float]:
    """Return the intersection of two boxes, in the dimensions of the first one."""
    pairs = enumerate(zip(box, other, strict=False))
    return [min(pair) if i % 2 else max(pair) for i, pair in pairs]


def _check_box(name: str, box: Sequence[float], length: int) -> None:
    pairs = list(zip(box[::2], box[1::2], strict=False))
    if len(box) != length or any(low >= high for low, high in pairs):
        raise ConfigError(f"{name}={list(box)} must be {length} numbers, each low < high in turn")
