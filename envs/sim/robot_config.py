"""The fields of a robot's YAML, and where its URDF is."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from core.errors import ConfigError, did_you_mean
from core.plugins import package_folder
from core.schema import Checked, any_path, checked_by, one_of, text, within, word

JAW_GAIN = 0.2  # greatest gain of a jaw's motor: with 0.3 it hits objects so fast that it gets 7 mm into them
LEAST_TURN = 0.05  # radians that the jaw on a hinge turns at least
MOST_OPENING = 0.2  # metres of a sliding finger
Number = TypeVar("Number", float, NDArray[np.float64])
ROLLING = 5  # joints from which on the last one turns the gripper about the direction in which it points
PACKAGES = ("pybullet_data", "example_robot_data", "file")
NAME_IN_URDF = r"[^\x00-\x1f]{1,200}", "a name in the URDF"


@dataclass(frozen=True, kw_only=True)
class HingeConfig(Checked):
    """The jaws of a hand: one is part of the last link, the other turns on a hinge.

    With them, the robot's tip_offset, rest, reach and clearance are those given here.
    """

    joint: str = text(*NAME_IN_URDF)  # the revolute joint of the jaw that turns
    shut: float = within(-7, 7)  # its angle at which the jaws meet
    open: float = within(-7, 7)  # its angle at which they are fully open
    length: float = within(0.005, 0.5)  # from the hinge to the tip of that jaw
    tip_offset: list[float] = within(-1, 1, count=3)  # the gripper centre, between the open jaws, in the tip's frame
    rest: list[float] = checked_by("RobotConfig, check_joints")
    reach: list[float] = within(-2, 2)
    clearance: float = within(0, 0.1)

    def __post_init__(self) -> None:
        super().__post_init__()
        if abs(self.open - self.shut) < LEAST_TURN:
            raise ConfigError(f"open={self.open} must be {LEAST_TURN} rad or more from shut={self.shut}")
        _check_reach(self.reach)

    @property
    def way(self) -> float:
        """1 where the joint's angle grows as the jaws open, else -1."""
        return math.copysign(1.0, self.open - self.shut)


@dataclass(frozen=True, kw_only=True)
class RobotConfig(Checked):
    """One arm. Names are the URDF's own; lengths in metres, angles in radians."""

    name: str = word()
    package: str = checked_by("__post_init__")  # where `urdf` is searched: of PACKAGES, or a user's package
    urdf: str = any_path()
    base: list[float] = within(-1, 1, count=3)  # where the URDF's origin stands in the workspace frame
    joints: list[str] = text(*NAME_IN_URDF)  # the arm's revolute and prismatic joints, from the base on
    max_speed: list[float] = within(0.01, 20)  # rad/s of each joint, or m/s
    rest: list[float] = checked_by(
        "check_joints"
    )  # joint angles at reset: the gripper points down and keeps this orientation
    tip: str = text(*NAME_IN_URDF)  # the link that carries the gripper
    tip_offset: list[float] = within(-1, 1, count=3)  # gripper centre in that link's frame
    approach: list[float] = within(-1, 1, count=3)  # unit vector: where the gripper points, in that link's frame
    grippers: list[str] = one_of("magnet", "fingers", "hinge")  # its possible grippers; the first is its own
    magnet: list[float] = within(
        0.001, 0.5
    )  # radius and length of the cylinder that ends at the gripper centre, if any
    fingers: list[str] = text(*NAME_IN_URDF)  # prismatic finger joints; empty for a magnet
    finger_opening: float = within(0, 7)  # of each finger, fully open: metres; of a jaw on a hinge, radians
    # Share of its error that a motor closes in a physics step. 0.3 closes 99 % of it in a control step; motors whose
    # torque is too small for that overshoot, and need less.
    gain: float = within(0.01, 1)
    # x0, x1, y0, y1, z0, z1 in the workspace frame: where the gripper gets to. A workspace's gripper_box and
    # object_area are cut to it. []: the arm reaches all of every workspace's gripper_box.
    reach: list[float] = within(-2, 2)
    # Whether the gripper tilts where the arm cannot reach a place pointing down: for arms of fewer than six joints.
    position_first: bool
    # Where nothing is to be moved: height of the gripper centre over the tops of objects at which nothing touches them.
    clearance: float = within(0, 0.1, default=0.01)
    # Jaws of which one turns on a hinge, for `hinge` in grippers. Without them the joint is fixed at 0.
    hinge: HingeConfig | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.package not in PACKAGES and package_folder(self.package) is None:
            raise ConfigError(f"package={self.package} is not known" + did_you_mean(self.package, PACKAGES))
        if not self.joints:
            raise ConfigError("joints=[] must name at least one joint")
        for key in ("rest", "max_speed"):
            if len(getattr(self, key)) != len(self.joints):
                raise ConfigError(f"{key}={getattr(self, key)} must be {len(self.joints)} numbers, one for each joint")
        if not self.grippers:
            raise ConfigError("grippers=[] must name magnet, fingers or hinge")
        self._check_fingers()
        if abs(math.hypot(*self.approach) - 1) > 0.01:
            raise ConfigError(f"approach={self.approach} must have length 1: the direction in which the gripper points")
        if len(self.magnet) not in (0, 2):
            raise ConfigError(f"magnet={self.magnet} must be a radius and a length, or [] for none that is seen")
        _check_reach(self.reach)

    def _check_fingers(self) -> None:
        """Raise ConfigError for fingers or jaws that do not fit the names of the grippers."""
        if "fingers" in self.grippers and not (self.fingers and self.finger_opening):
            raise ConfigError(f"grippers={self.grippers} needs names in fingers and a finger_opening above 0")
        if ("hinge" in self.grippers) != (self.hinge is not None):
            wanted = "needs hinge: {joint: ..., shut: ..., ...}" if self.hinge is None else "has none: give hinge: null"
            raise ConfigError(f"grippers={self.grippers} {wanted}")
        if self.hinge is not None and len(self.hinge.rest) != len(self.joints):
            raise ConfigError(f"hinge.rest={self.hinge.rest} must be {len(self.joints)} numbers, one for each joint")
        if self.on_hinge:
            return
        if len(self.fingers) not in (0, 2):
            raise ConfigError(f"fingers={self.fingers} must name two joints, which close towards each other")
        moving = [*self.fingers, *([self.hinge.joint] if self.hinge else [])]
        both = next((name for name in moving if name in self.joints), None)
        if both is not None:
            named = f"fingers={self.fingers}" if both in self.fingers else "hinge.joint"
            raise ConfigError(f"{named}: {both} is also in joints; name each joint once")
        if "fingers" not in self.grippers and (self.fingers or self.finger_opening):
            raise ConfigError(f"grippers={self.grippers} has no fingers: give fingers=[] and finger_opening=0")
        if self.finger_opening > MOST_OPENING:
            raise ConfigError(f"finger_opening={self.finger_opening} must be at most {MOST_OPENING}: metres")

    # ---- with its jaws

    def with_jaws(self) -> RobotConfig:
        """Return the robot with the jaw on its hinge as its only finger. It must have one."""
        assert self.hinge is not None
        changed = {name: getattr(self.hinge, name) for name in ("tip_offset", "rest", "reach", "clearance")}
        opening = abs(self.hinge.open - self.hinge.shut)
        return replace(self, grippers=["hinge"], fingers=[self.hinge.joint], finger_opening=opening, **changed)

    @property
    def on_hinge(self) -> bool:
        """Whether its finger is the jaw on the hinge: it is what `with_jaws` returned."""
        return self.hinge is not None and self.grippers == ["hinge"] and self.fingers == [self.hinge.joint]

    def finger_position(self, opening: Number) -> Number:
        """Return the position of each finger joint at an opening: metres or, of a jaw on a hinge, radians."""
        if self.hinge is None or not self.on_hinge:
            return opening
        return self.hinge.shut + self.hinge.way * opening

    def finger_opening_at(self, position: Number) -> Number:
        """Return the opening at which a finger joint has this position; as of `finger_position`."""
        if self.hinge is None or not self.on_hinge:
            return position
        return self.hinge.way * (position - self.hinge.shut)

    def reaching(self) -> RobotConfig:
        """Return the robot for reaching tasks: the last joint is turned by 90 degrees, so that no finger leads.

        In arms of four joints or fewer it tilts the gripper, and stays.
        """
        if not self.fingers or len(self.joints) < ROLLING:
            return self
        return replace(self, rest=[*self.rest[:-1], self.rest[-1] - math.copysign(math.pi / 2, self.rest[-1])])


def _check_reach(reach: list[float]) -> None:
    if len(reach) not in (0, 6):
        raise ConfigError(f"reach={reach} must be 6 numbers (x0, x1, y0, y1, z0, z1), or [] for no limit")


def motor_gains(config: RobotConfig) -> list[float]:
    """Return the gain of each motor: those of the arm, then those of the fingers."""
    finger = min(config.gain, JAW_GAIN) if config.on_hinge else config.gain
    return [config.gain] * len(config.joints) + [finger] * len(config.fingers)


def urdf_path(config: RobotConfig) -> Path:
    """Return the URDF's place on disk. Raises ConfigError when there is none."""
    if config.package == "pybullet_data":
        import pybullet_data

        folder = Path(pybullet_data.getDataPath())
    elif config.package == "example_robot_data":
        folder = example_robot_data_folder()
    else:
        folder = package_folder(config.package) or Path()
    path = folder / config.urdf
    if config.package != "file" and not path.resolve().is_relative_to(folder.resolve()):
        raise ConfigError(f"robot.urdf={config.urdf} leaves the package: it must be a file in {folder.resolve()}")
    if not path.is_file():
        raise ConfigError(f"robot.urdf={config.urdf} is not a file in {folder.resolve()}")
    return path


def example_robot_data_folder() -> Path:
    """Return the folder in which the package example-robot-data keeps its files. Raises ConfigError."""
    for entry in sys.path:
        share = Path(entry) / "cmeel.prefix" / "share"
        if (share / "example-robot-data").is_dir():
            return share
    raise ConfigError("robot.package=example_robot_data is not installed; pip install example-robot-data")
