"""The person's body in a PyBullet client, and the arm's kinematics read from its URDF."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pybullet as bullet

from core.errors import ConfigError, did_you_mean
from core.file_cache import cached_folder
from core.system import suppress_stdout
from human.arms import (
    FINGERTIP,
    LINE_STARTS,
    OFFERING_JOINTS,
    ArmModel,
    Array,
    AttachedPoint,
    OfferingArm,
    PointingArm,
    PointingChain,
    line_start,
    ray_through,
)
from human.body import urdf_model
from human.body.urdf_model import Proportions, write
from human.config import HumanConfig

ASLEEP = bullet.ACTIVATION_STATE_ENABLE_SLEEPING | bullet.ACTIVATION_STATE_SLEEP


@dataclass(frozen=True)
class _Joint:
    """PyBullet's description of a joint and of the link that it carries; low, high in radians."""

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
    """A pointing arm with a body that PyBullet draws.

    The body sleeps and is posed again whenever the arm moves, which takes negligible time.

    Collisions are off: a person is seen, not touched. PyBullet solves bodies that may collide in an order that
    depends on earlier episodes, so that the same seed would give other bits.

    Attributes:
        body: PyBullet's id.
        joints: indices of the joints that move in pointing.
        cone: the link that is drawn along the finger, or None.
    """

    def __init__(
        self, config: HumanConfig, client: int, visuals: bool = False, proportions: Proportions | None = None
    ) -> None:
        """Load the body.

        Args:
            config: where the person stands, their URDF and rest posture.
            client: PyBullet's client.
            visuals: whether visual shapes are loaded.
            proportions: of the project's own model; None: the average.

        Raises:
            ConfigError: the URDF does not load or lacks a link, or `rest` does not fit its joints.
        """
        self.client = client
        self.body = _load(config, client, visuals, proportions or Proportions())
        self._info = [_joint(self.body, index, client) for index in range(bullet.getNumJoints(self.body, client))]
        self._links = [joint.link for joint in self._info]
        self._check(config)
        self._revolute = [i for i, joint in enumerate(self._info) if joint.kind == bullet.JOINT_REVOLUTE]
        self._all_angles = np.array([self._info[i].clip(0.0) for i in self._revolute])
        self.joints = [i for i in self._revolute if self._info[i].name in config.rest]
        self._pointing = np.searchsorted(self._revolute, self.joints)
        self.cone = self._links.index("cone") if "cone" in self._links else None
        for link in range(-1, len(self._info)):
            bullet.setCollisionFilterGroupMask(self.body, link, 0, 0, client)
        super().__init__(self._read_model(np.array([config.rest[self._info[i].name] for i in self.joints])))

    def _check(self, config: HumanConfig) -> None:
        for link in (FINGERTIP, *LINE_STARTS.values()):
            if link not in self._links:
                raise ConfigError(
                    f"workspace.human.urdf={config.urdf} has no link {link!r}" + did_you_mean(link, self._links)
                )
        revolute = {joint.name: joint for joint in self._info if joint.kind == bullet.JOINT_REVOLUTE}
        for name, angle in config.rest.items():
            if name not in revolute:
                raise ConfigError(
                    f"workspace.human.rest: {name!r} is not a revolute joint" + did_you_mean(name, revolute)
                )
            if revolute[name].clip(angle) != angle:
                limits = f"[{revolute[name].low:g}, {revolute[name].high:g}]"
                raise ConfigError(f"workspace.human.rest.{name}={angle} is beyond the joint's limits {limits}")
        if not config.rest:
            raise ConfigError("workspace.human.rest={} must name at least one joint")

    def _set_angles(self, joints: Array) -> None:
        super()._set_angles(joints)
        self._all_angles[self._pointing] = joints
        angles = [[angle] for angle in self._all_angles.tolist()]
        zeros = [[0.0]] * len(angles)
        bullet.resetJointStatesMultiDof(self.body, self._revolute, angles, zeros, physicsClientId=self.client)
        bullet.changeDynamics(self.body, -1, activationState=ASLEEP, physicsClientId=self.client)

    def drawn(self, style: str = "finger") -> tuple[Array, Array]:
        """Return what `ray` does, from PyBullet's link states."""
        tip, behind = (self._frame(self._links.index(link))[:3, 3] for link in (FINGERTIP, line_start(style)))
        return ray_through(tip, behind)

    def offer(self, place: Sequence[float]) -> None:
        """Hold out the left hand: the middle of its palm at place (3,), metres, palm up. Raises Unreachable."""
        assert self.model.other is not None
        names = [self._info[i].name for i in self._revolute]
        at = [names.index(joint) for joint in OFFERING_JOINTS]
        self._all_angles[at] = OfferingArm(self.model.other).solve(place)
        self._set_angles(self.angles)

    def _read_model(self, rest: Array) -> ArmModel:
        """Read the kinematics of the pointing joints, with the other joints at the angles that they keep."""
        self._set_angles(np.zeros(len(self.joints)))
        points = {link: self._attached_point(link) for link in (FINGERTIP, *LINE_STARTS.values())}
        names = [joint.name for joint in self._info]
        others = [
            names.index(joint) for joint in OFFERING_JOINTS if joint in names and names.index(joint) not in self.joints
        ]
        other = self._chain_of(others) if len(others) == len(OFFERING_JOINTS) else None
        return ArmModel(self._chain_of(self.joints), rest, points, other)

    def _chain_of(self, joints: Sequence[int]) -> PointingChain:
        """Read the chain of these joints, which are all at 0."""
        frames = [self._frame(index) for index in joints]
        parents = [self._carrier(self._info[index].parent, joints) for index in joints]
        steps = [frame if p < 0 else np.linalg.inv(frames[p]) @ frame for p, frame in zip(parents, frames, strict=True)]
        axes, low, high = (np.array([getattr(self._info[i], name) for i in joints]) for name in ("axis", "low", "high"))
        return PointingChain(parents=parents, steps=np.array(steps), axes=axes, low=low, high=high)

    def _carrier(self, link: int, joints: Sequence[int]) -> int:
        """Return the position in `joints` of the joint that carries this link; -1: none."""
        while link >= 0 and link not in joints:
            link = self._info[link].parent
        return joints.index(link) if link >= 0 else -1

    def _attached_point(self, link: str) -> AttachedPoint:
        """Return the link's origin relative to its carrier. All pointing joints must be at 0."""
        carrier, place = self._carrier(self._links.index(link), self.joints), self._frame(self._links.index(link))
        if carrier >= 0:
            place = np.linalg.inv(self._frame(self.joints[carrier])) @ place
        return AttachedPoint(carrier, place[:3, 3])

    def _frame(self, link: int) -> Array:
        """Return the link's pose (4, 4) in the workspace frame."""
        state = bullet.getLinkState(self.body, link, computeForwardKinematics=True, physicsClientId=self.client)
        frame = np.eye(4)
        frame[:3, :3] = np.reshape(bullet.getMatrixFromQuaternion(state[5]), (3, 3))
        frame[:3, 3] = state[4]
        return frame


_models: dict[str, ArmModel] = {}


def read_arm(config: HumanConfig) -> PointingArm:
    """Return the arm of this person, without a body. Raises ConfigError."""
    if repr(config) not in _models:
        client = bullet.connect(bullet.DIRECT)
        try:
            _models[repr(config)] = Body(config, client).model
        finally:
            bullet.disconnect(client)
    return PointingArm(_models[repr(config)])


def _folder(proportions: Proportions) -> Path:
    """Return a folder with the person's URDF and meshes."""

    def make(folder: Path) -> None:
        write(folder, proportions)

    return cached_folder("person", [Path(urdf_model.__file__), repr(proportions)], make)


def _load(config: HumanConfig, client: int, visuals: bool, proportions: Proportions) -> int:
    path = Path(config.urdf) if config.urdf is not None else _folder(proportions) / "human.urdf"
    if not path.is_file():
        raise ConfigError(f"workspace.human.urdf={config.urdf} is not a file in {Path().resolve()}")
    visual_flag = bullet.URDF_ENABLE_CACHED_GRAPHICS_SHAPES if visuals else bullet.URDF_IGNORE_VISUAL_SHAPES
    yaw = math.radians(config.yaw) / 2
    try:
        with suppress_stdout():
            return bullet.loadURDF(
                str(path),
                config.position,
                (0, 0, math.sin(yaw), math.cos(yaw)),
                useFixedBase=True,
                flags=visual_flag | bullet.URDF_ENABLE_SLEEPING,
                physicsClientId=client,
            )
    except bullet.error as error:
        raise ConfigError(f"workspace.human.urdf={config.urdf} does not load: {error}") from None


def _joint(body: int, index: int, client: int) -> _Joint:
    info = bullet.getJointInfo(body, index, client)
    low, high = (info[8], info[9]) if info[8] <= info[9] else (-math.tau, math.tau)  # a joint without limits
    return _Joint(info[1].decode(), info[12].decode(), info[2], info[16], low, high, info[13])
