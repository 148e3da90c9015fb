"""Jaws of which one turns on a hinge hold objects by friction. Private attributes reach into the physics."""

import re

import numpy as np
import pybullet as bullet
import pytest

from core.errors import ConfigError
from envs.experts import expert
from envs.sim.gripper import opening_around
from envs.sim.robot import read_kinematics
from envs.sim.robot_config import example_robot_data_folder
from tests.helpers.env_cases import act, config_of, make
from tests.helpers.own_robots import own_robot
from tests.helpers.thorough import some

NONE = "task.curriculum={near: 0, held: 0, placed: 0}"
OPENING = -3  # columns of the observation `robot`: opening, commanded closing, whether it holds
DEEP = 6e-3  # metres; 1 mm of it is the margin of Bullet's hulls
JAWS = config_of("robot=so_arm", "gripper=hinge").robot


def contacts(env, i=0):
    """Bullet's contacts of the robot with what its gripper holds, in world i."""
    world = env._worlds[i]
    return bullet.getContactPoints(world.robot.body, world._gripper.held.body, physicsClientId=world.client)


@pytest.fixture(scope="module")
def lifted():
    """Four worlds in which the expert has just lifted the referent, and the "next" of all steps."""
    env = make("so_arm", "step", "nl_lift", "gripper=hinge", NONE, "task.hold_steps=50", worlds=4, seed=3)
    guide, td = expert(env), env.reset()
    history = [td]
    for _ in range(26):
        td = act(env, td, guide(td.clone())["action"])
        history.append(td)
    yield env, history
    env.close()


def test_both_jaws_press_on_what_is_lifted_and_nothing_else_holds_it(lifted):
    env, _ = lifted
    state = env.state
    assert (state.held == state.referent).all()
    assert (state.objects[np.arange(4), state.referent, 2] > 0.15).all()
    for i, world in enumerate(env._worlds):
        assert bullet.getNumConstraints(world.client) == 0  # no magnet
        links = {contact[3] for contact in contacts(env, i)}
        assert {world.robot.fingers[0], world.robot.hand} <= links
        assert min(contact[8] for contact in contacts(env, i)) > -DEEP


def test_the_opening_is_observed_as_a_share_of_the_whole_turn(lifted):
    env, history = lifted
    first, last = history[0]["robot"], history[-1]["robot"]
    np.testing.assert_allclose(first[:, OPENING], 1.0, atol=0.01)
    around = opening_around(env.config.robot, env.config.task.object_size) / env.config.robot.finger_opening
    np.testing.assert_allclose(last[:, OPENING], around, atol=0.25)  # pressed against the fixed jaw
    assert (last[:, -1] == 1).all()
    assert (last[:, OPENING] > 0.3).all()


def test_an_object_that_the_jaws_release_falls(lifted):
    env, history = lifted
    td, height = history[-1], env.state.objects[np.arange(4), env.state.referent, 2].copy()
    for _ in range(8):
        td = act(env, td, env.towards(env.gripper, np.zeros(4, bool)))
    assert (env.state.held == -1).all()
    assert (env.state.objects[np.arange(4), env.state.referent, 2] < height - 0.05).all()
    np.testing.assert_allclose(td["robot"][:, OPENING], 1.0, atol=0.02)


def test_jaws_shut_on_nothing_meet():
    env = make("so_arm", "step", "nl_grasp", "gripper=hinge", NONE, seed=1)
    td = env.reset()
    for _ in range(10):
        td = act(env, td, env.towards(env.gripper, np.ones(1, bool)))
    world = env._worlds[0]
    assert td["robot"][0, OPENING] == pytest.approx(0, abs=0.02)
    assert td["robot"][0, -1] == 0
    ends = [bullet.getAABB(world.robot.body, jaw, world.client) for jaw in (world.robot.fingers[0], world.robot.hand)]
    assert ends[0][0][0] < ends[1][1][0]  # along x, in which they turn
    env.close()


def test_the_jaws_are_opened_as_wide_as_an_object_is():
    sizes = [opening_around(JAWS, size) for size in (0.02, 0.035, 0.05)]
    assert 0 < sizes[0] < sizes[1] < sizes[2] < JAWS.finger_opening


@pytest.mark.parametrize("control", ["absolute", "joints"])
def test_an_episode_may_begin_with_the_object_between_the_jaws(control):
    held = "task.curriculum={near: 0, held: 1, placed: 0}"
    env = make("so_arm", control, "pick_and_place", "gripper=hinge", held, worlds=4, seed=4)
    td = env.reset()
    for _ in range(3):
        td = act(env, td, env.towards(env.gripper, np.ones(4, bool)))
    assert (env.state.held == env.state.referent).mean() >= 0.75
    env.close()


def test_with_its_magnet_the_jaws_stay_shut():
    plain = config_of("robot=so_arm").robot
    assert config_of("robot=so_arm", "gripper=magnet").robot == plain
    assert not plain.fingers
    assert not plain.on_hinge
    assert JAWS.on_hinge
    assert JAWS.fingers == ["gripper"]


WRONG = {
    "no hinge": ("kuka", "robot.grippers=[hinge]", "robot.grippers=['hinge'] needs hinge: {joint:"),
    "not named": ("so_arm", "robot.grippers=[magnet]", "robot.grippers=['magnet'] has none: give hinge: null"),
    "not its own": ("kuka", "gripper=hinge", "gripper=hinge: robot=kuka grips with magnet"),
    "never open": ("so_arm", "robot.hinge.open=-0.16", "robot.hinge.open=-0.16 must be 0.05 rad or more from shut"),
    "a short rest": ("so_arm", "robot.hinge.rest=[0.0]", "robot.hinge.rest=[0.0] must be 5 numbers"),
    "a short reach": ("so_arm", "robot.hinge.reach=[0.0]", "robot.hinge.reach=[0.0] must be 6 numbers"),
    "an arm joint": ("so_arm", "robot.hinge.joint=wrist_roll", "robot.hinge.joint: wrist_roll is also in joints"),
    "a typo": ("so_arm", "+robot.hinge.opening=1.0", "robot.hinge.opening is not a known key"),
    "off the middle": (
        "so_arm",
        "gripper=hinge task=nl_pick_and_place task.curriculum.off_centre=0.03",
        "must be 0 with hinge: only a magnet holds objects off its middle",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_config_of_jaws_that_is_wrong_is_refused_with_the_reason(name):
    robot, words, message = WRONG[name]
    with pytest.raises(ConfigError, match=re.escape(message)):
        config_of(f"robot={robot}", *words.split(" "))


def in_hinge(pattern, new):
    """A change of the URDF: the pattern in the joint of the jaw."""

    def change(text):
        start = text.index('<joint name="gripper"')
        end = text.index("</joint>", start)
        part, count = re.subn(pattern, new, text[start:end], count=1)
        assert count
        return text[:start] + part + text[end:]

    return change


def without_shape(text):
    """The URDF with a jaw that touches nothing."""
    start = text.index('<link name="moving_jaw_so101_v1_link"')
    end = text.index("</link>", start)
    return text[:start] + re.sub(r"(?s)<collision>.*?</collision>", "", text[start:end]) + text[end:]


BAD_URDFS = {
    "fixed": (in_hinge('type="revolute"', 'type="fixed"'), "must be revolute"),
    "short limits": (in_hinge('upper="[^"]*"', 'upper="0.5"'), "limits that hold shut=-0.17 and open=0.95"),
    "no effort": (in_hinge('effort="[^"]*"', 'effort="0"'), "gripper has effort 0"),
    "turning away": (in_hinge('axis xyz="0 0 1"', 'axis xyz="0 0 -1"'), "no ball of 0.03 m is held between the jaws"),
    "no shape": (without_shape, "moves no collision shape"),
}


@pytest.mark.parametrize("name", some(BAD_URDFS, 2))
def test_a_urdf_with_which_the_jaws_hold_nothing_is_refused_with_the_reason(tmp_path, name):
    change, message = BAD_URDFS[name]
    meshes = f"{example_robot_data_folder()}/"
    robot = own_robot(tmp_path, "so_arm", lambda text: change(text).replace("package://", meshes))
    with pytest.raises(ConfigError, match=re.escape(message)):
        read_kinematics(robot.with_jaws())


BAD_JAWS = {
    "beside the jaws": (["tip_offset=[0.06,0.0,0.0]"], "no ball of 0.03 m is held between the jaws"),
    "in the jaw": (["tip_offset=[-0.0079,0.0,-0.03]"], "touches the jaws although they are open"),
    "the other way": (["shut=0.95", "open=-0.17"], "touches the jaws although they are open"),
    "an unknown joint": (["joint=gripper_1"], "did you mean 'gripper'"),
}


@pytest.mark.parametrize("name", BAD_JAWS)
def test_jaws_that_hold_nothing_are_refused_with_the_reason(name):
    words, message = BAD_JAWS[name]
    jaws = config_of("robot=so_arm", "gripper=hinge", *(f"robot.hinge.{word}" for word in words)).robot
    with pytest.raises(ConfigError, match=re.escape(message)):
        read_kinematics(jaws)
