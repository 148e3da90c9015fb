"""Whether a robot works as its URDF says, looked at once for each robot: its numbers, its chain and its motors.

Bullet loads arms that cannot work, without a message: with masses that are words, motors without torque, fingers that
move the same way. Here each is refused with what is wrong.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pybullet as bullet
from numpy.typing import NDArray

from core.errors import ConfigError
from envs.sim.robot_config import motor_gains
from envs.sim.urdf_file import URDFError, bad_number, decoded_name, name_of, read_urdf

if TYPE_CHECKING:
    from envs.sim.kinematics import Kinematics
    from envs.sim.robot_config import RobotConfig

POSES = 8  # random ones, at which the chain is compared with Bullet's
SAME = 1e-3  # metres
TIME_STEP, STEPS = 1 / 240, 120  # seconds, and physics steps for which the motors are tried
NUDGE = {bullet.JOINT_REVOLUTE: 0.1, bullet.JOINT_PRISMATIC: 0.02}  # radians, or metres, that each joint is to move
FOLLOWED = 0.3  # share of that by which it may miss it within these steps
OPPOSITE = -0.9  # the greatest cosine between the directions of two fingers
DOWN = 0.85  # the least cosine between where the gripper points at rest and down
REACHING, STARTS = 100, 3  # iterations of the inverse kinematics, and how often it begins
REACHED = 0.03  # metres by which the gripper may miss a place that it reaches
BALL, BALL_MASS = 0.03, 0.01  # metres and kg: what jaws are tried with
SHUT_TORQUE = 0.3  # N m with which they are shut
MOST = {bullet.JOINT_REVOLUTE: 20.0, bullet.JOINT_PRISMATIC: 2.0}  # radians, or metres, of the arm's joints
KINDS = {bullet.JOINT_REVOLUTE: "revolute", bullet.JOINT_PRISMATIC: "prismatic", bullet.JOINT_FIXED: "fixed"}
SLACK = 1e-9  # by which a rest pose may be beyond a limit


_reached: set[str] = set()  # robots and areas that `check_reach` has passed


class Loaded(NamedTuple):
    """The arm in a client, its links not merged. arm, fingers, tip: PyBullet's numbers of joints and of a link."""

    body: int
    client: int
    arm: list[int]
    fingers: list[int]
    tip: int


def check_file(config: RobotConfig, urdf: Path) -> None:
    """Raise ConfigError for a value of the URDF that must be a number and is none, and for a negative mass."""
    place = f"robot.urdf={config.urdf}"
    try:
        robot = read_urdf(urdf)
    except URDFError as error:
        raise ConfigError(f"{place} {error}") from None
    wrong = bad_number(robot)
    if wrong is not None:
        raise ConfigError(f"{place}: {wrong}, which is not a finite number")
    for link in robot.findall("link"):
        for mass in link.findall("inertial/mass"):
            if float(mass.get("value", "0")) < 0:
                raise ConfigError(f"{place}: link {name_of(link)} has mass {mass.get('value')}; it must be at least 0")


def check_joints(
    config: RobotConfig, info: Sequence[tuple], *, arm: Sequence[int], fingers: Sequence[int], tip: int
) -> None:
    """Raise ConfigError for joints that cannot be those of an arm and its fingers.

    Args:
        config: of the robot.
        info: PyBullet's `getJointInfo` of each joint.
        arm, fingers, tip: indices into `info`.
    """
    place = f"robot.urdf={config.urdf}"
    for j in arm:
        low, high = info[j][8:10]
        most = MOST.get(info[j][2], 0.0)
        if not -most < low < high < most:
            kind = KINDS.get(info[j][2], "of another kind")
            raise ConfigError(
                f"{place}: joint {_name(info[j])} must be revolute with limits low < high in radians, or prismatic "
                f"with limits low < high in metres, within 2 m, not {kind} with [{low}, {high}]; `deixis robot add` "
                "writes a URDF that has what is missing"
            )
    ends = [config.finger_position(opening) for opening in (0.0, config.finger_opening)]
    for j in fingers:
        low, high = info[j][8:10]
        if config.on_hinge:
            if info[j][2] != bullet.JOINT_REVOLUTE or not low - SLACK <= min(ends) <= max(ends) <= high + SLACK:
                raise ConfigError(
                    f"{place}: robot.hinge.joint {_name(info[j])} must be revolute with limits that hold shut="
                    f"{ends[0]:g} and open={ends[1]:g}, not [{low}, {high}]"
                )
        elif info[j][2] != bullet.JOINT_PRISMATIC or not low <= SLACK or not high >= config.finger_opening - SLACK:
            raise ConfigError(
                f"{place}: finger {_name(info[j])} must be prismatic with limits that hold "
                f"[0, {config.finger_opening}] (finger_opening), not [{low}, {high}]"
            )
    for j in (*arm, *fingers):
        if not info[j][10] > 0:
            raise ConfigError(
                f"{place}: joint {_name(info[j])} has effort {info[j][10]:g}: without a force above 0 its motor does "
                "not move it"
            )
    for j, angle in zip(arm, config.rest, strict=True):
        low, high = info[j][8:10]
        if not low - SLACK <= angle <= high + SLACK:
            raise ConfigError(f"robot.rest: {angle!r} is beyond {_name(info[j])}'s limits [{low!r}, {high!r}]")
    _check_order(info, arm, fingers, tip)


def _check_order(info: Sequence[tuple], arm: Sequence[int], fingers: Sequence[int], tip: int) -> None:
    """Raise ConfigError unless each joint carries the next, and the last one the tip and the fingers."""
    for joint, following in itertools.pairwise(arm):
        if joint not in _chain(info, following):
            carried = following in _chain(info, joint)
            reason = f"it is after {_name(info[following])}" if carried else "they are on different branches"
            raise ConfigError(
                f"robot.joints: {_name(info[joint])} does not carry {_name(info[following])} ({reason}); list "
                "the arm's joints from the base on"
            )
    tip_name = decoded_name(info[tip][12])
    if arm[-1] not in _chain(info, tip):
        raise ConfigError(
            f"robot.tip: {tip_name} is before the last joint, {_name(info[arm[-1]])}, which must carry it"
        )
    for finger in fingers:
        if arm[-1] not in _chain(info, finger):
            raise ConfigError(f"robot.fingers: {_name(info[finger])} is not carried by the last of robot.joints")
        if finger in _chain(info, tip):
            raise ConfigError(
                f"robot.tip: {tip_name} moves with {_name(info[finger])}; take the link between the fingers"
            )


def _chain(info: Sequence[tuple], joint: int) -> list[int]:
    """Return the joint and those that carry it, up to the base."""
    chain = []
    while joint >= 0:
        chain.append(joint)
        joint = info[joint][16]
    return chain


def _name(info: tuple) -> str:
    return decoded_name(info[1])


# ---- what moves


def check_motion(config: RobotConfig, chain: Kinematics, loaded: Loaded) -> None:
    """Raise ConfigError where the body in the client does not move as the chain, or its motors cannot move it."""
    _check_approach(config, chain)
    _check_forward(config, chain, loaded)
    if config.on_hinge:
        _check_jaws(config, chain, loaded)
    elif loaded.fingers:
        _check_fingers(config, loaded)
    _check_masses(config, loaded)
    _check_motors(config, chain, loaded)


def _check_approach(config: RobotConfig, chain: Kinematics) -> None:
    """Raise ConfigError where the gripper does not point down at rest: every task comes to its objects from above."""
    way = chain.forward(chain.rest[None]).rotation[0] @ np.array(config.approach)
    if way[2] > -DOWN:
        raise ConfigError(
            f"robot.approach={config.approach}: at robot.rest the gripper points to ({way[0]:.2f}, {way[1]:.2f}, "
            f"{way[2]:.2f}), and not down: it would not come to the objects from above; give another rest, or "
            "the approach that points down there"
        )


def check_reach(config: RobotConfig, chain: Kinematics, area: Sequence[float], height: float) -> None:
    """Raise ConfigError unless the gripper gets to half of the corners, edges and middle of an area.

    Args:
        config: of the robot.
        chain: its kinematics; the gripper keeps the orientation at rest.
        area: (x0, x1, y0, y1) of the objects, metres.
        height: of the gripper over the table there, metres.
    """
    key = repr((config, *area, height))
    if key in _reached:
        return
    x0, x1, y0, y1 = area
    xs, ys = np.linspace(x0, x1, 3), np.linspace(y0, y1, 3)
    places = np.array([(x, y, height) for x in xs for y in ys])
    rotation = chain.forward(chain.rest[None]).rotation[0]
    joints, missed = chain.rest, np.full(len(places), np.inf)
    for _ in range(STARTS):  # from rest, and then from where it came nearest
        found = chain.solve(np.tile(joints, (len(places), 1)), places, rotation, iterations=REACHING)
        missed = np.minimum(missed, np.linalg.norm(chain.forward(found).position - places, axis=1))
        if (missed <= REACHED).all():
            break
        joints = found[int(missed.argmin())]
    worst = int(missed.argmax())
    if 2 * int((missed <= REACHED).sum()) < len(places):
        x, y, z = places[worst]
        raise ConfigError(
            f"robot.reach={config.reach}: the gripper gets to {int((missed <= REACHED).sum())} of {len(places)} places "
            f"of workspace.object_area={list(area)}; it stays {missed[worst]:.2f} m away from ({x:.2f}, {y:.2f}, "
            f"{z:.2f}). Give robot.reach=[x0,x1,y0,y1,z0,z1], the box that it reaches, or another robot.base"
        )
    _reached.add(key)


def _check_masses(config: RobotConfig, loaded: Loaded) -> None:
    """Raise ConfigError where a joint moves nothing that has mass."""
    links = range(bullet.getNumJoints(loaded.body, loaded.client))
    info = [bullet.getJointInfo(loaded.body, j, loaded.client) for j in links]
    masses = [bullet.getDynamicsInfo(loaded.body, j, loaded.client)[0] for j in links]
    for joint in (*loaded.arm, *loaded.fingers):
        if not sum(mass for j, mass in zip(links, masses, strict=True) if joint in _chain(info, j)) > 0:
            raise ConfigError(f"robot.urdf={config.urdf}: the links that {_name(info[joint])} moves have no mass")


def _check_forward(config: RobotConfig, chain: Kinematics, loaded: Loaded) -> None:
    rng = np.random.default_rng(0)
    random = rng.uniform(chain.low, chain.high, (POSES, len(chain.rest)))
    poses = np.stack((np.zeros_like(chain.rest), chain.rest, *random))
    expected = chain.forward(poses).position
    for joints, wanted in zip(poses, expected, strict=True):
        _place(loaded, joints, config.finger_position(config.finger_opening))
        state = bullet.getLinkState(
            loaded.body, loaded.tip, computeForwardKinematics=True, physicsClientId=loaded.client
        )
        found, _ = bullet.multiplyTransforms(state[4], state[5], config.tip_offset, (0, 0, 0, 1))
        distance = float(np.linalg.norm(np.subtract(found, wanted)))
        if not distance <= SAME:
            raise ConfigError(
                f"robot.urdf={config.urdf}: at the joint angles {joints.round(3).tolist()} the gripper is "
                f"{distance:.3f} m beside the place that follows from the axes of robot.joints; do all of them have an "
                "axis of length 1?"
            )


def _check_fingers(config: RobotConfig, loaded: Loaded) -> None:
    """Raise ConfigError unless both fingers move apart as they open."""
    centres = []
    for opening in (0.0, config.finger_opening):
        _place(loaded, config.rest, opening)
        bullet.performCollisionDetection(loaded.client)
        centres.append([_middle(loaded, finger) for finger in loaded.fingers])
    (first, second), opened = centres
    ways = np.subtract(opened, (first, second)) / config.finger_opening
    names = " and ".join(config.fingers)
    if not ways[0] @ ways[1] < OPPOSITE:
        raise ConfigError(
            f"robot.fingers: {names} must move in opposite directions as they open, not {_vector(ways[0])} and "
            f"{_vector(ways[1])}; both go from 0 to finger_opening={config.finger_opening}"
        )
    for finger in loaded.fingers:
        if not bullet.getCollisionShapeData(loaded.body, finger, loaded.client):
            raise ConfigError(
                f"robot.fingers: the link of {_joint_name(loaded, finger)} has no collision shape, and holds nothing"
            )
    if min(np.subtract(first, second) @ ways[0], np.subtract(*opened) @ ways[0]) < -SAME:
        raise ConfigError(
            f"robot.fingers: {names} close at finger_opening={config.finger_opening}, and must open there"
        )


def _check_jaws(config: RobotConfig, chain: Kinematics, loaded: Loaded) -> None:
    """Raise ConfigError unless the jaws, as they shut, press a ball between them from both sides."""
    jaw, client = loaded.fingers[0], loaded.client
    name = f"robot.hinge.joint: {config.fingers[0]}"
    if not bullet.getCollisionShapeData(loaded.body, jaw, client):
        raise ConfigError(f"{name} moves no collision shape, and holds nothing")
    middle = chain.forward(chain.rest[None]).position[0]
    shape = bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=BALL / 2, physicsClientId=client)
    ball = bullet.createMultiBody(BALL_MASS, shape, basePosition=middle.tolist(), physicsClientId=client)
    _place(loaded, config.rest, config.finger_position(config.finger_opening))
    bullet.performCollisionDetection(client)
    if bullet.getClosestPoints(loaded.body, ball, 0.0, physicsClientId=client):
        raise ConfigError(
            f"robot.hinge.tip_offset={config.tip_offset}: a ball of {BALL} m there touches the jaws although they are "
            f"open; take the middle between them, or another open={config.finger_position(config.finger_opening):g}"
        )
    bullet.setJointMotorControl2(
        loaded.body,
        jaw,
        bullet.POSITION_CONTROL,
        targetPosition=config.finger_position(0.0),
        force=SHUT_TORQUE,
        physicsClientId=client,
    )
    for _ in range(STEPS):
        bullet.stepSimulation(client)
    links = {contact[3] for contact in bullet.getContactPoints(loaded.body, ball, physicsClientId=client)}
    bullet.removeBody(ball, client)
    if jaw not in links or links == {jaw}:
        raise ConfigError(
            f"{name}: as it turns from open={config.finger_position(config.finger_opening):g} to shut="
            f"{config.finger_position(0.0):g}, no ball of {BALL} m is held between the jaws at robot.hinge.tip_offset="
            f"{config.tip_offset}"
        )


def _middle(loaded: Loaded, link: int) -> NDArray[np.float64]:
    """Return (3,) the middle of the link's collision shapes, or of its frame if it has none."""
    if bullet.getCollisionShapeData(loaded.body, link, loaded.client):
        return np.mean(bullet.getAABB(loaded.body, link, loaded.client), axis=0)
    state = bullet.getLinkState(loaded.body, link, computeForwardKinematics=True, physicsClientId=loaded.client)
    return np.array(state[4])


def _check_motors(config: RobotConfig, chain: Kinematics, loaded: Loaded) -> None:
    """Raise ConfigError unless the motors turn each joint a little from rest, against gravity, and open the fingers."""
    body, client, motors = loaded.body, loaded.client, loaded.arm + loaded.fingers
    bullet.setGravity(0, 0, -9.81, client)
    bullet.setPhysicsEngineParameter(fixedTimeStep=TIME_STEP, physicsClientId=client)
    inwards = np.sign((chain.low + chain.high) / 2 - chain.rest)
    nudges = np.array([NUDGE[bullet.getJointInfo(body, j, client)[2]] for j in loaded.arm])
    room = np.minimum(nudges, (chain.high - chain.low) / 4)
    apart = config.finger_position(config.finger_opening)
    targets = [*(chain.rest + inwards * room).tolist(), *[apart] * len(loaded.fingers)]
    forces = [bullet.getJointInfo(body, j, client)[10] for j in motors]
    gains = motor_gains(config)
    _place(loaded, chain.rest, config.finger_position(0.0))
    bullet.setJointMotorControlArray(
        body, motors, bullet.POSITION_CONTROL, targets, forces=forces, positionGains=gains, physicsClientId=client
    )
    for _ in range(STEPS):
        bullet.stepSimulation(client)
    reached = [state[0] for state in bullet.getJointStates(body, motors, client)]
    allowed = [*(FOLLOWED * nudges), *[config.finger_opening / 4] * len(loaded.fingers)]
    for j, force, target, angle, most in zip(motors, forces, targets, reached, allowed, strict=True):
        if not abs(angle - target) <= most:
            found = f"{abs(angle - target):.3f} off" if math.isfinite(angle) else "nowhere: the simulation diverges"
            raise ConfigError(
                f"robot.urdf={config.urdf}: the motor of {_joint_name(loaded, j)} cannot hold and move the arm: "
                f"{STEPS * TIME_STEP:g} s after rest it is {found} from where it should be; look at effort={force:g}, "
                f"gain={config.gain}, masses, damping and friction"
            )


def _place(loaded: Loaded, joints: Sequence[float] | NDArray[np.float64], opening: float) -> None:
    for joint, angle in zip(loaded.arm, joints, strict=True):
        bullet.resetJointState(loaded.body, joint, angle, 0.0, loaded.client)
    for finger in loaded.fingers:
        bullet.resetJointState(loaded.body, finger, opening, 0.0, loaded.client)


def _joint_name(loaded: Loaded, joint: int) -> str:
    return _name(bullet.getJointInfo(loaded.body, joint, loaded.client))


def _vector(values: NDArray[np.float64]) -> list[float]:
    return (values.round(3) + 0.0).tolist()
