"""The fields of a robot's YAML, and where its URDF is."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path

from core.errors import ConfigError, did_you_mean
from core.plugins import package_folder
from core.schema import Checked, any_path, checked_by, one_of, text, within, word

PACKAGES = ("pybullet_data", "example_robot_data", "file")


@dataclass(frozen=True, kw_only=True)
class RobotConfig(Checked):
    """One arm. Names are the URDF's own; lengths in metres, angles in radians."""

    name: str = word()
    package: str = checked_by("__post_init__")  # where `urdf` is searched: of PACKAGES, or a user's package
    urdf: str = any_path()
    base: list[float] = within(-1, 1, count=3)  # where the URDF's origin stands in the workspace frame
    joints: list[str] = text(
        r"[^\x00-\x1f]{1,200}", "a name in the URDF"
    )  # the arm's revolute joints, from the base on
    max_speed: list[float] = within(0.01, 20)  # rad/s of each joint
    rest: list[float] = checked_by(
        "check_joints"
    )  # joint angles at reset: the gripper points down and keeps this orientation
    tip: str = text(r"[^\x00-\x1f]{1,200}", "a name in the URDF")  # the link that carries the gripper
    tip_offset: list[float] = within(-1, 1, count=3)  # gripper centre in that link's frame
    approach: list[float] = within(-1, 1, count=3)  # unit vector: where the gripper points, in that link's frame
    grippers: list[str] = one_of("magnet", "fingers")  # its possible grippers; the first is its own
    magnet: list[float] = within(
        0.001, 0.5
    )  # radius and length of the cylinder that ends at the gripper centre, if any
    fingers: list[str] = text(
        r"[^\x00-\x1f]{1,200}", "a name in the URDF"
    )  # prismatic finger joints; empty for a magnet
    finger_opening: float = within(0, 0.2)  # of each finger, fully open
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
            raise ConfigError("grippers=[] must name magnet, fingers or both")
        if "fingers" in self.grippers and not (self.fingers and self.finger_opening):
            raise ConfigError(f"grippers={self.grippers} needs names in fingers and a finger_opening above 0")
        if len(self.fingers) not in (0, 2):
            raise ConfigError(f"fingers={self.fingers} must name two joints, which close towards each other")
        both = next((name for name in self.fingers if name in self.joints), None)
        if both is not None:
            raise ConfigError(f"fingers={self.fingers}: {both} is also in joints; name each joint once")
        if abs(math.hypot(*self.approach) - 1) > 0.01:
            raise ConfigError(f"approach={self.approach} must have length 1: the direction in which the gripper points")
        if "fingers" not in self.grippers and (self.fingers or self.finger_opening):
            raise ConfigError(f"grippers={self.grippers} has no fingers: give fingers=[] and finger_opening=0")
        if len(self.magnet) not in (0, 2):
            raise ConfigError(f"magnet={self.magnet} must be a radius and a length, or [] for none that is seen")

        if len(self.reach) not in (0, 6):
            raise ConfigError(f"reach={self.reach} must be 6 numbers (x0, x1, y0, y1, z0, z1), or [] for no limit")

    def reaching(self) -> RobotConfig:
        """Return the robot for reaching tasks: the last joint is turned by 90 degrees, so that no finger leads."""
        if not self.fingers:
            return self
        return replace(self, rest=[*self.rest[:-1], self.rest[-1] - math.copysign(math.pi / 2, self.rest[-1])])


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
