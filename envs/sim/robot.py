"""The loaded arm in one PyBullet client, and its kinematics."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pybullet as bullet

from core.errors import ConfigError, did_you_mean
from core.file_cache import file_digest
from core.system import captured_stdout
from envs.sim.jaws import with_cut_hand
from envs.sim.kinematics import Array, Kinematics
from envs.sim.robot_check import Loaded, check_file, check_joints, check_motion
from envs.sim.robot_config import RobotConfig, example_robot_data_folder, motor_gains, urdf_path
from envs.sim.urdf import simplified, with_hulls, with_magnet
from envs.sim.urdf_file import URDFError, decoded_name

HULL_FLAGS = bullet.URDF_IGNORE_VISUAL_SHAPES
# Robots with small hulls for collision meshes: they load and step faster, with bounding boxes that are 1 to 2 mm larger
# than those of the meshes. Policies were trained with them. All other robots have Bullet's own.
SMALL_HULLS = {("example_robot_data", name) for name in ("kinova.urdf", "xarm7.urdf", "so101.urdf")}
MESSAGE = re.compile(r"b3(Error|Warning)\[[^\]]*\]:\s*(.*?)(?=b3(?:Error|Warning)\[|\Z)", re.DOTALL)
MAX_REASON = 300  # characters


class Robot:
    """The arm in one client.

    Its fixed links are merged into their parents, which saves 15 % of a panda's physics and 30 % of a jaco's.
    magnet: whether one is mounted on it.
    """

    def __init__(self, config: RobotConfig, client: int, visuals: bool, magnet: bool = False) -> None:
        self.config, self._client = config, client
        self.body = load(config, client, visuals=visuals, flags=bullet.URDF_MERGE_FIXED_LINKS, magnet=magnet)
        info = [bullet.getJointInfo(self.body, j, client) for j in range(bullet.getNumJoints(self.body, client))]
        names = [decoded_name(i[1]) for i in info]
        self.arm = [_index(names, name, "robot.joints") for name in config.joints]
        self.fingers = [_index(names, name, "robot.fingers") for name in config.fingers]
        self.damped = any(i[6] for i in info)  # whether joints are slowed down by the fluid friction of the URDF
        self.hand = self.arm[-1]  # the link that has all of the gripper but the fingers
        self._forces = self._bound = [info[j][10] for j in self.arm + self.fingers]
        self._gains = motor_gains(config)
        self._bind()

    def _bind(self) -> None:
        motors = self.arm + self.fingers
        self._motors = partial(
            bullet.setJointMotorControlArray,
            self.body,
            motors,
            bullet.POSITION_CONTROL,
            forces=list(self._bound),
            positionGains=self._gains,
            physicsClientId=self._client,
        )
        self._states = partial(bullet.getJointStates, self.body, motors, physicsClientId=self._client)

    def limit_fingers(self, force: float) -> None:
        """Limit the force with which each finger closes, N; of a jaw on a hinge, the force at its tip."""
        if self.config.hinge and self.config.on_hinge:
            force *= self.config.hinge.length
        self._bound = self._forces[: len(self.arm)] + [force] * len(self.fingers)
        self._bind()

    def scale_gains(self, factors: Sequence[float]) -> None:
        """Let each motor close another share of its error in a physics step: its gain times a factor."""
        self._gains = [gain * factor for gain, factor in zip(motor_gains(self.config), factors, strict=True)]
        self._bind()

    def drive(self, targets: Sequence[float]) -> None:
        """Set the motors' position targets: arm joints in radians, then those of `fingers`."""
        self._motors(targetPositions=targets)

    def states(self) -> Sequence[tuple]:
        """(position, velocity, ...) of each arm joint, then each finger."""
        return self._states()

    def place(self, joints: Sequence[float], opening: float, speeds: Sequence[float] | None = None) -> None:
        """Put the arm at these joint angles, without physics. speeds: of the joints, rad/s; None: it is at rest."""
        for index, angle, speed in zip(self.arm, joints, speeds or [0.0] * len(self.arm), strict=True):
            bullet.resetJointState(self.body, index, angle, speed, self._client)
        for index in self.fingers:
            bullet.resetJointState(self.body, index, self.config.finger_position(opening), 0.0, self._client)

    def fixed_links(self) -> list[int]:
        """Return the base and the links before the first arm joint, which can touch furniture but never move."""
        return list(range(-1, self.arm[0]))


def load(config: RobotConfig, client: int, *, visuals: bool, flags: int = 0, magnet: bool = False) -> int:
    """Load the URDF as a body of the client, its base fixed. Raises ConfigError where it does not load."""
    try:
        path = _copy(config, visuals, magnet)
    except URDFError as error:
        raise ConfigError(f"robot.urdf={config.urdf} {error}") from None
    if visuals:
        flags |= bullet.URDF_ENABLE_CACHED_GRAPHICS_SHAPES
    else:
        flags |= bullet.URDF_IGNORE_VISUAL_SHAPES
    return _load_file(path, config, client, flags)


def _copy(config: RobotConfig, visuals: bool, magnet: bool) -> Path:
    """Return the file that is loaded in place of the URDF. Raises URDFError and ConfigError."""
    small = (config.package, Path(config.urdf).name) in SMALL_HULLS
    path = urdf_path(config)
    if config.on_hinge:
        path = with_cut_hand(path, config.joints, config.tip, config.approach)
    path = simplified(path, (*config.joints, *config.fingers), small)
    if not visuals:
        path = with_hulls(path, lambda file, alone: _load_file(file, config, alone, HULL_FLAGS), small)
    if magnet and config.magnet:
        radius, length = config.magnet
        end, way = tuple(config.tip_offset), tuple(config.approach)
        path = with_magnet(path, config.tip, end=end, way=way, radius=radius, length=length)
    return path


def _load_file(path: Path, config: RobotConfig, client: int, flags: int) -> int:
    if config.package == "example_robot_data":
        bullet.setAdditionalSearchPath(str(example_robot_data_folder()), client)
    with captured_stdout() as printed:
        try:
            return bullet.loadURDF(str(path), config.base, useFixedBase=True, flags=flags, physicsClientId=client)
        except bullet.error:
            pass
    raise ConfigError(f"robot.urdf={config.urdf} does not load: {bullet_reason(*printed)}")


def bullet_reason(printed: str = "") -> str:
    """Return what Bullet printed, in one line: its errors, and the warning before the first of them."""
    messages = MESSAGE.findall(printed)
    first = next((i for i, (kind, _) in enumerate(messages) if kind == "Error"), len(messages))
    texts = [text for i, (kind, text) in enumerate(messages) if kind == "Error" or i == first - 1]
    reason = " ".join(" ".join(texts).split())
    return f"PyBullet says {reason[:MAX_REASON]!r}" if reason else "PyBullet gives no reason"


_kinematics: dict[tuple[str, str], Kinematics] = {}  # by config, and content of the URDF


def read_kinematics(config: RobotConfig) -> Kinematics:
    """Return the arm's kinematics, read once from a body of its own at zero angles. Raises ConfigError."""
    key = (repr(config), file_digest(urdf_path(config)))
    if key not in _kinematics:
        _kinematics[key] = _read_kinematics(config)
    return _kinematics[key]


def _read_kinematics(config: RobotConfig) -> Kinematics:
    check_file(config, urdf_path(config))
    client = bullet.connect(bullet.DIRECT)
    try:
        body = load(config, client, visuals=False)
        info = [bullet.getJointInfo(body, j, client) for j in range(bullet.getNumJoints(body, client))]
        names, links = ([decoded_name(i[field]) for i in info] for field in (1, 12))
        arm = [_index(names, name, "robot.joints") for name in config.joints]
        fingers = [_index(names, name, "robot.fingers") for name in config.fingers]
        tip = _index(links, config.tip, "robot.tip")
        check_joints(config, info, arm=arm, fingers=fingers, tip=tip)
        frames = [_link_frame(body, j, client) for j in [*arm, tip]]
        frames[-1] = frames[-1] @ _transform(config.tip_offset, [0, 0, 0, 1])
        steps = [frames[0], *(np.linalg.inv(a) @ b for a, b in itertools.pairwise(frames))]
        low, high = (np.array([info[j][field] for j in arm]) for field in (8, 9))
        axes = np.array([_axis(body, j, info[j][13], client) for j in arm])
        chain = Kinematics(
            fixed=np.array(steps),
            axes=axes,
            low=low,
            high=high,
            rest=np.array(config.rest),
            position_first=config.position_first,
            slides=np.array([info[j][2] == bullet.JOINT_PRISMATIC for j in arm]),
        )
        check_motion(config, chain, Loaded(body, client, arm, fingers, tip))
    finally:
        bullet.disconnect(client)
    return chain


def _index(names: list[str], name: str, key: str) -> int:
    if name not in names:
        raise ConfigError(f"{key}: {name!r} is not in the URDF" + did_you_mean(name, names))
    return names.index(name)


def _transform(position: Sequence[float], quaternion: Sequence[float]) -> Array:
    matrix = np.eye(4)
    matrix[:3, :3] = np.reshape(bullet.getMatrixFromQuaternion(quaternion), (3, 3))
    matrix[:3, 3] = position
    return matrix


def _axis(body: int, joint: int, axis: Sequence[float], client: int) -> Sequence[float]:
    """(3,) the joint's axis in its own frame. Bullet gives it in that of the link's inertia, which may be turned."""
    turned = bullet.getDynamicsInfo(body, joint, client)[4]
    if tuple(turned) == (0.0, 0.0, 0.0, 1.0):
        return axis
    return (_transform((0.0, 0.0, 0.0), turned)[:3, :3] @ np.array(axis)).tolist()


def _link_frame(body: int, link: int, client: int) -> Array:
    state = bullet.getLinkState(body, link, computeForwardKinematics=True, physicsClientId=client)
    return _transform(state[4], state[5])
