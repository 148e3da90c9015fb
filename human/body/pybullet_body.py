"""The person's body in a PyBullet client, for where somebody looks, and what its URDF says of the arm that points."""

from __future__ import annotations

import atexit
import math
import shutil
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pybullet as bullet

from conf.schema import ConfigError, did_you_mean
from human.body.urdf_model import Proportions, write
from human.config import HumanConfig
from human.pointing_arm import FINGERTIP, LINE_STARTS, ArmModel, PointingArm, line_start, ray_through
from human.pointing_ik import Array, AttachedPoint, PointingChain
from human.suppress_stdout import suppress_stdout

ASLEEP = bullet.ACTIVATION_STATE_ENABLE_SLEEPING | bullet.ACTIVATION_STATE_SLEEP


@dataclass(frozen=True)
class _Joint:
    """What Bullet knows of a joint and of the link that it carries; low, high in radians."""

    name: str
    link: str
    kind: int
    parent: int
    low: float
    high: float
    axis: tuple[float, float, float]

    def clip(self, angle: float) -> float:
        return min(max(angle, self.low), self.high)


class Body(PointingArm):
    """An arm with a body that is drawn.

    body: Bullet's id. joints: indices of those that move in pointing. cone: the link that is drawn along the finger, or
    None. It is asleep, and set anew wherever the arm goes: it costs next to nothing.

    A person is seen, not touched: all else goes through. Bullet solves bodies that may touch in an order that depends
    on what they did in episodes before, and the same seed would give other bits.
    """

    def __init__(
        self, config: HumanConfig, client: int, visuals: bool = False, proportions: Proportions | None = None
    ) -> None:
        """Raises ConfigError for a URDF or a rest that won't do."""
        self.client = client
        self.body = _load(config, client, visuals, proportions or Proportions())
        self._info = [_joint(self.body, index, client) for index in range(bullet.getNumJoints(self.body, client))]
        self._links = [joint.link for joint in self._info]
        self._check(config)
        self._turning = [i for i, joint in enumerate(self._info) if joint.kind == bullet.JOINT_REVOLUTE]
        self._all = np.array([self._info[i].clip(0.0) for i in self._turning])
        self.joints = [i for i in self._turning if self._info[i].name in config.rest]
        self._own = np.searchsorted(self._turning, self.joints)
        self.cone = self._links.index("cone") if "cone" in self._links else None
        for link in range(-1, len(self._info)):
            bullet.setCollisionFilterGroupMask(self.body, link, 0, 0, client)
        super().__init__(self._read(np.array([config.rest[self._info[i].name] for i in self.joints])))

    def _check(self, config: HumanConfig) -> None:
        for link in (FINGERTIP, *LINE_STARTS.values()):
            if link not in self._links:
                raise ConfigError(
                    f"workspace.human.urdf={config.urdf} has no link {link!r}" + did_you_mean(link, self._links)
                )
        turning = {joint.name: joint for joint in self._info if joint.kind == bullet.JOINT_REVOLUTE}
        for name, angle in config.rest.items():
            if name not in turning:
                raise ConfigError(
                    f"workspace.human.rest: {name!r} is no joint that turns" + did_you_mean(name, turning)
                )
            if turning[name].clip(angle) != angle:
                limits = f"[{turning[name].low:g}, {turning[name].high:g}]"
                raise ConfigError(f"workspace.human.rest.{name}={angle} is beyond the joint's limits {limits}")
        if not config.rest:
            raise ConfigError("workspace.human.rest={} must name at least one joint")

    def _take(self, joints: Array) -> None:
        super()._take(joints)
        self._all[self._own] = joints
        angles = [[angle] for angle in self._all.tolist()]
        zeros = [[0.0]] * len(angles)
        bullet.resetJointStatesMultiDof(self.body, self._turning, angles, zeros, physicsClientId=self.client)
        bullet.changeDynamics(self.body, -1, activationState=ASLEEP, physicsClientId=self.client)

    def drawn(self, style: str = "finger") -> tuple[Array, Array]:
        """As `ray`, by what Bullet says of the links."""
        tip, behind = (self._frame(self._links.index(link))[:3, 3] for link in (FINGERTIP, line_start(style)))
        return ray_through(tip, behind)

    def _read(self, rest: Array) -> ArmModel:
        """The joints that point, as they are with the others at the angles that those keep."""
        self._take(np.zeros(len(self.joints)))
        frames = [self._frame(index) for index in self.joints]
        parents = [self._carrier(self._info[index].parent) for index in self.joints]
        steps = [frame if p < 0 else np.linalg.inv(frames[p]) @ frame for p, frame in zip(parents, frames, strict=True)]
        axes, low, high = (
            np.array([getattr(self._info[i], name) for i in self.joints]) for name in ("axis", "low", "high")
        )
        points = {link: self._point(link) for link in (FINGERTIP, *LINE_STARTS.values())}
        return ArmModel(PointingChain(parents, np.array(steps), axes, low, high), rest, points)

    def _carrier(self, link: int) -> int:
        """Which of the joints that point carries this link; -1: none."""
        while link >= 0 and link not in self.joints:
            link = self._info[link].parent
        return self.joints.index(link) if link >= 0 else -1

    def _point(self, link: str) -> AttachedPoint:
        """The link's origin as the chain knows it. All joints that point must be at 0."""
        carrier, place = self._carrier(self._links.index(link)), self._frame(self._links.index(link))
        if carrier >= 0:
            place = np.linalg.inv(self._frame(self.joints[carrier])) @ place
        return AttachedPoint(carrier, place[:3, 3])

    def _frame(self, link: int) -> Array:
        state = bullet.getLinkState(self.body, link, computeForwardKinematics=True, physicsClientId=self.client)
        frame = np.eye(4)
        frame[:3, :3] = np.reshape(bullet.getMatrixFromQuaternion(state[5]), (3, 3))
        frame[:3, 3] = state[4]
        return frame


_builds: dict[str, ArmModel] = {}


def read_arm(config: HumanConfig) -> PointingArm:
    """The arm of this person, without a body. Raises ConfigError."""
    if repr(config) not in _builds:
        client = bullet.connect(bullet.DIRECT)
        try:
            _builds[repr(config)] = Body(config, client).build
        finally:
            bullet.disconnect(client)
    return PointingArm(_builds[repr(config)])


@cache
def _folder(proportions: Proportions) -> Path:
    """Where this process keeps the person's URDF; gone when it ends."""
    folder = Path(tempfile.mkdtemp(prefix="deixis-human-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    write(folder, proportions)
    return folder


def _load(config: HumanConfig, client: int, visuals: bool, proportions: Proportions) -> int:
    path = Path(config.urdf) if config.urdf is not None else _folder(proportions) / "human.urdf"
    if not path.is_file():
        raise ConfigError(f"workspace.human.urdf={config.urdf} is not a file in {Path().resolve()}")
    looks = bullet.URDF_ENABLE_CACHED_GRAPHICS_SHAPES if visuals else bullet.URDF_IGNORE_VISUAL_SHAPES
    yaw = math.radians(config.yaw) / 2
    try:
        with suppress_stdout():
            return bullet.loadURDF(
                str(path),
                config.position,
                (0, 0, math.sin(yaw), math.cos(yaw)),
                useFixedBase=True,
                flags=looks | bullet.URDF_ENABLE_SLEEPING,
                physicsClientId=client,
            )
    except bullet.error as error:
        raise ConfigError(f"workspace.human.urdf={config.urdf} does not load: {error}") from None


def _joint(body: int, index: int, client: int) -> _Joint:
    info = bullet.getJointInfo(body, index, client)
    low, high = (info[8], info[9]) if info[8] <= info[9] else (-math.tau, math.tau)  # without limits
    return _Joint(info[1].decode(), info[12].decode(), info[2], info[16], low, high, info[13])
