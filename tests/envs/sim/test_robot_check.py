"""Robots that cannot work are refused with what is wrong; all others work as Bullet's own body does."""

import re

import numpy as np
import pybullet as bullet
import pytest

from core.errors import ConfigError
from envs import make_env
from envs.sim.robot import read_kinematics
from envs.sim.robot_config import urdf_path
from tests.helpers.env_cases import config_of
from tests.helpers.own_robots import overrides, own_robot, swapped
from tests.helpers.thorough import some

KUKA = [f"lbr_iiwa_joint_{i}" for i in range(1, 8)]
PANDA = [f"panda_joint{i}" for i in range(1, 8)]
LEFT, RIGHT = "panda_finger_joint1", "panda_finger_joint2"


def each(pattern, new):
    """A change of a URDF: `new` in place of all that the pattern matches."""

    def change(text):
        changed, count = re.subn(pattern, new, text)
        assert count
        return changed

    return change


def in_joint(name, pattern, new):
    """A change of a URDF: the pattern in one joint."""

    def change(text):
        start = text.index(f'<joint name="{name}"')
        end = text.index("</joint>", start)
        part, count = re.subn(pattern, new, text[start:end], count=1)
        assert count
        return text[:start] + part + text[end:]

    return change


URDFS = {
    "effort 0": ("kuka", each(r'effort="[^"]*"', 'effort="0"'), "lbr_iiwa_joint_1 has effort 0"),
    "no effort": ("kuka", each(r' effort="[^"]*"', ""), "lbr_iiwa_joint_1 has effort 0"),
    "effort -1": ("kuka", each(r'effort="[^"]*"', 'effort="-1"'), "lbr_iiwa_joint_1 has effort -1"),
    "one effort 0": ("kuka", in_joint(KUKA[4], r'effort="[^"]*"', 'effort="0"'), "lbr_iiwa_joint_5 has effort 0"),
    "a small effort": ("kuka", in_joint(KUKA[1], r'effort="[^"]*"', 'effort="5"'), "cannot hold and move the arm"),
    "effort nan": ("kuka", in_joint(KUKA[1], r'effort="[^"]*"', 'effort="nan"'), 'limit effort="nan", which is not'),
    "finger without effort": ("panda", in_joint(RIGHT, r'effort="[^"]*"', 'effort="0"'), f"{RIGHT} has effort 0"),
    "fingers the same way": (
        "panda",
        in_joint(RIGHT, r'(?s)xyz="0 -1 0"(.*)lower="0.0" upper="0.04"', r'xyz="0 1 0"\1lower="-0.04" upper="0.0"'),
        "must be prismatic with limits that hold",
    ),
    "fingers along one axis": ("panda", in_joint(RIGHT, 'xyz="0 -1 0"', 'xyz="0 1 0"'), "must move in opposite"),
    "fingers that close": (
        "panda",
        lambda text: in_joint(LEFT, 'xyz="0 1 0"', 'xyz="0 -1 0"')(
            in_joint(RIGHT, 'xyz="0 -1 0"', 'xyz="0 1 0"')(text)
        ),
        "close at finger_opening",
    ),
    "revolute fingers": (
        "panda",
        lambda text: in_joint(LEFT, "prismatic", "revolute")(in_joint(RIGHT, "prismatic", "revolute")(text)),
        "must be prismatic",
    ),
    "a short finger": ("panda", in_joint(RIGHT, 'upper="0.04"', 'upper="0.02"'), "limits that hold"),
    "mass nan": ("kuka", each('<mass value="2.7"/>', '<mass value="nan"/>'), 'mass value="nan"'),
    "mass abc": ("kuka", each('<mass value="2.7"/>', '<mass value="abc"/>'), 'mass value="abc"'),
    "mass -1": ("kuka", each('<mass value="2.7"/>', '<mass value="-1"/>'), "has mass -1"),
    "a heavy link": ("kuka", each('<mass value="2.7"/>', '<mass value="2700"/>'), "cannot hold and move the arm"),
    "no mass": ("kuka", each('<mass value="[^"]*"/>', '<mass value="0"/>'), "lbr_iiwa_joint_1 moves have no mass"),
    "a flange without mass": (
        "kuka",
        each('<mass value="0.3"/>', '<mass value="0"/>'),
        "lbr_iiwa_joint_7 moves have no",
    ),
    "an origin of words": ("kuka", in_joint(KUKA[3], 'xyz="[^"]*"', 'xyz="0 0 z"'), "not a finite number"),
    "an axis of length 0": ("kuka", in_joint(KUKA[3], '<axis xyz="[^"]*"', '<axis xyz="0 0 0"'), "axis"),
    "continuous": (
        "kuka",
        in_joint(KUKA[0], '(?s)type="revolute"(.*)lower="[^"]*" upper="[^"]*"', r'type="continuous"\1'),
        "must be revolute",
    ),
    "prismatic": ("kuka", in_joint(KUKA[0], 'type="revolute"', 'type="prismatic"'), "must be revolute"),
    "limits in degrees": ("kuka", in_joint(KUKA[0], 'upper="[^"]*"', 'upper="170"'), "in radians"),
    "limits swapped": (
        "kuka",
        in_joint(KUKA[0], r'lower="([^"]*)" upper="([^"]*)"', r'lower="\2" upper="\1"'),
        "low < high",
    ),
    "a stiff joint": ("kuka", in_joint(KUKA[1], 'damping="[^"]*"', 'damping="1e6"'), "cannot hold and move"),
}


@pytest.mark.parametrize("name", some(URDFS, 6))
def test_a_urdf_with_which_the_arm_cannot_work_is_refused_with_the_reason(tmp_path, name):
    robot, change, message = URDFS[name]
    with pytest.raises(ConfigError, match=re.escape(message)):
        read_kinematics(own_robot(tmp_path, robot, change))


FIELDS = {
    "one finger": ("panda", {"fingers": [LEFT]}, "must name two joints"),
    "three fingers": ("panda", {"fingers": [LEFT, RIGHT, PANDA[6]]}, "must name two joints"),
    "an arm joint as a finger": ("panda", {"fingers": [PANDA[6], RIGHT]}, "panda_joint7 is also in joints"),
    "a finger twice": ("panda", {"fingers": [LEFT, LEFT]}, f"has {LEFT} twice"),
    "a joint twice": ("kuka", {"joints": [KUKA[0], *KUKA[:6]]}, "has lbr_iiwa_joint_1 twice"),
    "joints swapped": ("kuka", {"joints": [*KUKA[:3], KUKA[4], KUKA[3], *KUKA[5:]]}, "does not carry"),
    "joints backwards": ("kuka", {"joints": KUKA[::-1]}, "does not carry"),
    "an early tip": ("kuka", {"tip": "lbr_iiwa_link_4"}, "lbr_iiwa_link_4 is before the last joint"),
    "a tip that moves": ("panda", {"tip": "panda_leftfinger"}, f"moves with {LEFT}"),
    "no direction": ("kuka", {"approach": [0.0, 0.0, 0.0]}, "must have length 1"),
    "a long direction": ("kuka", {"approach": [1.0, 1.0, 0.0]}, "must have length 1"),
    "rest beyond a limit": ("kuka", {"rest": [-2.96706, 0, 0, 0, 0, 0, 0]}, "-2.96706 is beyond"),
    "wide fingers": ("panda", {"finger_opening": 0.05}, "limits that hold [0, 0.05]"),
    "an unknown finger": ("panda", {"fingers": [LEFT, "panda_finger"]}, "did you mean"),
}


@pytest.mark.parametrize("name", some(FIELDS, 5))
def test_a_config_with_which_the_arm_cannot_work_is_refused_with_the_reason(tmp_path, name):
    robot, fields, message = FIELDS[name]
    with pytest.raises(ConfigError, match=re.escape(message)):
        read_kinematics(own_robot(tmp_path, robot, **fields))


def test_the_message_about_a_rest_pose_has_all_digits_of_the_limit(tmp_path):
    change = in_joint(KUKA[0], 'lower="[^"]*"', 'lower="-2.7925268"')
    with pytest.raises(ConfigError, match=re.escape("-2.79253 is beyond lbr_iiwa_joint_1's limits [-2.7925268,")):
        read_kinematics(own_robot(tmp_path, "kuka", change, rest=[-2.79253, 0, 0, 0, 0, 0, 0]))


def test_make_env_says_what_is_wrong_with_a_robot(tmp_path):
    config = own_robot(tmp_path, "kuka", each(r'effort="[^"]*"', 'effort="0"'))
    with pytest.raises(ConfigError, match="has effort 0"):
        make_env(overrides(config))


@pytest.mark.parametrize("name", ["zero inertia", "a joint left out", "a frame without mass"])
def test_an_unusual_robot_that_works_is_accepted(tmp_path, name):
    """Bullet computes inertia from the collision shapes; a joint that is not named is fixed at 0."""
    fields = {}
    if name == "zero inertia":
        change = each(r'i(xx|yy|zz)="[^"]*"', r'i\1="0"')
    elif name == "a frame without mass":
        zero = " ".join(f'i{axes}="0"' for axes in ("xx", "xy", "xz", "yy", "yz", "zz"))
        frame = f'<link name="frame"><inertial><mass value="0"/><inertia {zero}/></inertial></link>'
        frame += '<joint name="to_frame" type="fixed"><parent link="lbr_iiwa_link_7"/><child link="frame"/></joint>'
        change, fields = (lambda text: swapped(text, "</robot>", frame + "</robot>")), {"tip": "frame"}
    else:
        rest = [0.0, 0.6109, 0.0, -1.7006, 0.0, 0.8301]
        change, fields = (lambda text: text), {"joints": KUKA[:6], "rest": rest, "max_speed": [1.0] * 6}
    assert read_kinematics(own_robot(tmp_path, "kuka", change, **fields)).rest.shape[0] in (6, 7)


@pytest.mark.parametrize("robot", ["kuka", "panda", "jaco", "ur5", "xarm7", "so_arm"])
def test_the_chain_of_a_shipped_robot_moves_as_bullets_own_body(robot):
    config = config_of(f"robot={robot}", "task=nl_pick_and_place").robot
    chain, client = read_kinematics(config), bullet.connect(bullet.DIRECT)
    try:
        bullet.setAdditionalSearchPath(str(urdf_path(config)).removesuffix(config.urdf), client)
        flags = bullet.URDF_IGNORE_VISUAL_SHAPES | bullet.URDF_IGNORE_COLLISION_SHAPES
        body = bullet.loadURDF(
            str(urdf_path(config)), config.base, useFixedBase=True, flags=flags, physicsClientId=client
        )
        info = [bullet.getJointInfo(body, j, client) for j in range(bullet.getNumJoints(body, client))]
        names, links = [i[1].decode() for i in info], [i[12].decode() for i in info]
        poses = np.random.default_rng(1).uniform(chain.low, chain.high, (20, len(chain.rest)))
        for joints, place in zip(poses, chain.forward(poses).position, strict=True):
            for name, angle in zip(config.joints, joints, strict=True):
                bullet.resetJointState(body, names.index(name), angle, 0.0, client)
            state = bullet.getLinkState(body, links.index(config.tip), False, True, client)
            found = bullet.multiplyTransforms(state[4], state[5], config.tip_offset, (0, 0, 0, 1))[0]
            np.testing.assert_allclose(found, place, atol=1e-5)
    finally:
        bullet.disconnect(client)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["robot=kuka", "robot.approach=[1.0,0.0,0.0]"], "it would not come to the objects from above"),
        (["robot=panda", "robot.rest.5=0.3"], "it would not come to the objects from above"),
        (["robot=kuka", "robot.base=[-0.9,0.0,0.0]"], r"robot\.reach=\[\]: the gripper gets to 0 of 9 places"),
        (
            ["robot=so_arm", "robot.reach=[]", "robot.base=[-0.3,0.0,0.0]"],
            r"robot\.reach=\[\]: the gripper gets to 0 of",
        ),
    ],
)
def test_a_gripper_that_does_not_come_from_above_is_refused(words, message):
    with pytest.raises(ConfigError, match=message):
        make_env(words)
