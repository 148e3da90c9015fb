"""A robot: the fields of its YAML, and the loaded arm in one PyBullet client."""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import pybullet as bullet

from core.errors import ConfigError, did_you_mean
from core.file_cache import file_digest
from core.schema import Checked, any_path, checked_by, one_of, text, within, word
from core.system import suppress_stdout
from envs.sim.kinematics import Array, Kinematics
from envs.sim.urdf import simplified, with_hulls, with_magnet


@dataclass(frozen=True, kw_only=True)
class RobotConfig(Checked):
    """One arm. Names are the URDF's own; lengths in metres, angles in radians."""

    name: str = word()
    package: str = one_of("pybullet_data", "example_robot_data", "file")  # where `urdf` is searched
    urdf: str = any_path()
    base: list[float] = within(-1, 1, count=3)  # where the URDF's origin stands in the workspace frame
    joints: list[str] = text(
        r"[^\x00-\x1f]{1,200}", "a name in the URDF"
    )  # the arm's revolute joints, from the base on
    max_speed: list[float] = within(0.01, 20)  # rad/s of each joint
    rest: list[float] = checked_by(
        "Robot._check"
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
        if not self.joints:
            raise ConfigError("joints=[] must name at least one joint")
        for key in ("rest", "max_speed"):
            if len(getattr(self, key)) != len(self.joints):
                raise ConfigError(f"{key}={getattr(self, key)} must be {len(self.joints)} numbers, one for each joint")
        if not self.grippers:
            raise ConfigError("grippers=[] must name magnet, fingers or both")
        if "fingers" in self.grippers and not (self.fingers and self.finger_opening):
            raise ConfigError(f"grippers={self.grippers} needs names in fingers and a finger_opening above 0")
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
        folder = _example_robot_data()
    else:
        folder = Path()
    path = folder / config.urdf
    if config.package != "file" and not path.resolve().is_relative_to(folder.resolve()):
        raise ConfigError(f"robot.urdf={config.urdf} leaves the package: it must be a file in {folder.resolve()}")
    if not path.is_file():
        raise ConfigError(f"robot.urdf={config.urdf} is not a file in {folder.resolve()}")
    return path


def _example_robot_data() -> Path:
    for entry in sys.path:
        share = Path(entry) / "cmeel.prefix" / "share"
        if (share / "example-robot-data").is_dir():
            return share
    raise ConfigError("robot.package=example_robot_data is not installed; pip install example-robot-data")


class Robot:
    """The arm in one client.

    Its fixed links are merged into their parents, which saves 15 % of a panda's physics and 30 % of a jaco's.
    magnet: whether one is mounted on it.
    """

    def __init__(self, config: RobotConfig, client: int, visuals: bool, magnet: bool = False) -> None:
        self.config, self._client = config, client
        self.body = load(config, client, visuals=visuals, flags=bullet.URDF_MERGE_FIXED_LINKS, magnet=magnet)
        info = [bullet.getJointInfo(self.body, j, client) for j in range(bullet.getNumJoints(self.body, client))]
        names = [i[1].decode() for i in info]
        self.arm = [_index(names, name, "robot.joints") for name in config.joints]
        self.fingers = [_index(names, name, "robot.fingers") for name in config.fingers]
        self.damped = any(i[6] for i in info)  # whether joints are slowed down by the fluid friction of the URDF
        self.hand = self.arm[-1]  # the link that has all of the gripper but the fingers
        self._check(info)
        self._forces = [info[j][10] for j in self.arm + self.fingers]
        self._bind(self._forces)

    def _check(self, info: list[tuple]) -> None:
        """Raise ConfigError for masses and limits that are not numbers, which PyBullet loads silently."""
        config = self.config
        for j in range(len(info)):
            mass = bullet.getDynamicsInfo(self.body, j, self._client)[0]
            if not (math.isfinite(mass) and mass >= 0):
                raise ConfigError(f"robot.urdf={config.urdf}: link {info[j][12].decode()} has mass {mass}")
        for j in self.arm:
            if info[j][2] != bullet.JOINT_REVOLUTE or not -20 < info[j][8] < info[j][9] < 20:
                raise ConfigError(
                    f"robot.urdf={config.urdf}: joint {info[j][1].decode()} must be revolute with limits low < high, "
                    f"not [{info[j][8]}, {info[j][9]}]"
                )
        for j, angle in zip(self.arm, config.rest, strict=True):
            if not info[j][8] <= angle <= info[j][9]:
                name = info[j][1].decode()
                raise ConfigError(f"robot.rest: {angle} is beyond {name}'s limits [{info[j][8]:g}, {info[j][9]:g}]")

    def _bind(self, forces: Sequence[float]) -> None:
        motors = self.arm + self.fingers
        self._motors = partial(
            bullet.setJointMotorControlArray,
            self.body,
            motors,
            bullet.POSITION_CONTROL,
            forces=list(forces),
            positionGains=[self.config.gain] * len(motors),
            physicsClientId=self._client,
        )
        self._states = partial(bullet.getJointStates, self.body, motors, physicsClientId=self._client)

    def limit_fingers(self, force: float) -> None:
        """Limit the force with which each finger closes, N."""
        self._bind(self._forces[: len(self.arm)] + [force] * len(self.fingers))

    def drive(self, targets: Sequence[float]) -> None:
        """Set the motors' position targets: arm joints in radians, then fingers in metres."""
        self._motors(targetPositions=targets)

    def states(self) -> Sequence[tuple]:
        """(position, velocity, ...) of each arm joint, then each finger."""
        return self._states()

    def place(self, joints: Sequence[float], opening: float) -> None:
        """Put the arm at rest at these joint angles, without physics."""
        for index, angle in zip(self.arm, joints, strict=True):
            bullet.resetJointState(self.body, index, angle, 0.0, self._client)
        for index in self.fingers:
            bullet.resetJointState(self.body, index, opening, 0.0, self._client)

    def fixed_links(self) -> list[int]:
        """Return the base and the links before the first arm joint, which can touch furniture but never move."""
        return list(range(-1, self.arm[0]))


def load(config: RobotConfig, client: int, *, visuals: bool, flags: int = 0, magnet: bool = False) -> int:
    """Load the URDF as a body of the client, its base fixed. Raises ConfigError where it does not load."""
    path = simplified(urdf_path(config), (*config.joints, *config.fingers))
    if visuals:
        flags |= bullet.URDF_ENABLE_CACHED_GRAPHICS_SHAPES
    else:
        flags |= bullet.URDF_IGNORE_VISUAL_SHAPES
        whole = path
        path = with_hulls(whole, lambda alone: _load_file(whole, config, alone, bullet.URDF_IGNORE_VISUAL_SHAPES))
    if magnet and config.magnet:
        radius, length = config.magnet
        end, way = tuple(config.tip_offset), tuple(config.approach)
        path = with_magnet(path, config.tip, end=end, way=way, radius=radius, length=length)
    return _load_file(path, config, client, flags)


def _load_file(path: Path, config: RobotConfig, client: int, flags: int) -> int:
    if config.package == "example_robot_data":
        bullet.setAdditionalSearchPath(str(_example_robot_data()), client)
    try:
        with suppress_stdout():
            return bullet.loadURDF(str(path), config.base, useFixedBase=True, flags=flags, physicsClientId=client)
    except bullet.error as error:
        raise ConfigError(f"robot.urdf={config.urdf} does not load: {error}") from None


_kinematics: dict[tuple[str, str], Kinematics] = {}  # by config, and content of the URDF


def read_kinematics(config: RobotConfig) -> Kinematics:
    """Return the arm's kinematics, read once from a body of its own at zero angles. Raises ConfigError."""
    key = (repr(config), file_digest(urdf_path(config)))
    if key not in _kinematics:
        _kinematics[key] = _read_kinematics(config)
    return _kinematics[key]


def _read_kinematics(config: RobotConfig) -> Kinematics:
    client = bullet.connect(bullet.DIRECT)
    try:
        body = load(config, client, visuals=False)
        info = [bullet.getJointInfo(body, j, client) for j in range(bullet.getNumJoints(body, client))]
        names, links = [i[1].decode() for i in info], [i[12].decode() for i in info]
        arm = [_index(names, name, "robot.joints") for name in config.joints]
        frames = [_link_frame(body, j, client) for j in [*arm, _index(links, config.tip, "robot.tip")]]
    finally:
        bullet.disconnect(client)
    frames[-1] = frames[-1] @ _transform(config.tip_offset, [0, 0, 0, 1])
    steps = [frames[0], *(np.linalg.inv(a) @ b for a, b in itertools.pairwise(frames))]
    low, high, axes = (np.array([info[j][field] for j in arm]) for field in (8, 9, 13))
    return Kinematics(
        fixed=np.array(steps),
        axes=axes,
        low=low,
        high=high,
        rest=np.array(config.rest),
        position_first=config.position_first,
    )


def _index(names: list[str], name: str, key: str) -> int:
    if name not in names:
        raise ConfigError(f"{key}: {name!r} is not in the URDF" + did_you_mean(name, names))
    return names.index(name)


def _transform(position: Sequence[float], quaternion: Sequence[float]) -> Array:
    matrix = np.eye(4)
    matrix[:3, :3] = np.reshape(bullet.getMatrixFromQuaternion(quaternion), (3, 3))
    matrix[:3, 3] = position
    return matrix


def _link_frame(body: int, link: int, client: int) -> Array:
    state = bullet.getLinkState(body, link, computeForwardKinematics=True, physicsClientId=client)
    return _transform(state[4], state[5])
