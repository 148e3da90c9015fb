"""The gripper's yaw: one more number of an action, where a task turns things."""

import numpy as np
import pytest

from envs.mdp.controls import MAX_YAW, MAX_YAW_STEP
from tests.helpers.env_cases import CONTROLS, LONG_ARMS, ROBOTS, act, make

PLACE = np.array([[0.45, 0.05, 0.2]])


def turning(robot, control):
    env = make(
        robot,
        control,
        "pick_and_rotate",
        "task.curriculum={near: 0, held: 0, placed: 0}",
        seed=2,
    )
    return env, env.reset()


def place_of(env):
    """(1, 3) where the gripper turns: a place over which each arm points down."""
    return PLACE if env.config.robot.name in LONG_ARMS else np.array([[0.4, 0.05, 0.06]])


def turned(env, td, yaw, steps=60):
    for _ in range(steps):
        td = act(env, td, env.towards(place_of(env), yaw=np.array([yaw])))
    return td


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.parametrize("control", CONTROLS)
@pytest.mark.parametrize("robot", ROBOTS)
def test_yaw_turns_the_gripper_in_place_while_it_points_down(robot, control):
    env, td = turning(robot, control)
    for yaw in (0.0, 1.2, -1.2):
        turned(env, td, yaw)
        assert env.yaw[0] == pytest.approx(yaw, abs=0.05)
        assert np.abs(env.gripper - place_of(env)).max() < 0.01
        down = env._arrays.pose.rotation[0] @ env.control._rotation.T
        assert down[2, 2] > 0.995
    env.close()


@pytest.mark.parametrize("control", ["absolute", "step"])
def test_yaw_is_at_most_90_degrees(control):
    env, td = turning("kuka", control)
    for way in (1.0, -1.0):
        for _ in range(40):
            action = env.towards(PLACE)
            action[0, 3] = way
            td = act(env, td, action)
        assert env.yaw[0] == pytest.approx(way * MAX_YAW, abs=0.05)
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize("control", CONTROLS)
def test_hold_keeps_the_yaw(control):
    env, td = turning("kuka", control)
    td = turned(env, td, 0.8)
    for _ in range(10):
        td = act(env, td, td["hold"])
    assert env.yaw[0] == pytest.approx(0.8, abs=0.06)
    env.close()


def test_a_control_step_turns_by_max_yaw_step_as_action_unit_says():
    env, td = turning("kuka", "step")
    turned(env, td, 0.0, 30)
    before = env.control.yaw(env.kinematics.forward(env._arrays.commanded).rotation)
    act(env, td, [[0.0, 0.0, 0.0, 1.0, -1.0]])
    after = env.control.yaw(env.kinematics.forward(env._arrays.commanded).rotation)
    assert (after - before)[0] == pytest.approx(MAX_YAW_STEP, rel=0.05)
    assert env.action_unit[:4] == (1.0, 1.0, 1.0, 1.0)
    env.close()
    env, _ = turning("kuka", "absolute")
    assert env.action_unit[3] == pytest.approx(MAX_YAW_STEP / MAX_YAW)
    env.close()


@pytest.mark.slow
def test_tasks_that_turn_nothing_have_no_yaw_in_the_action():
    for control, width in (("step", 4), ("absolute", 4), ("joints", 8)):
        for task, more in (("nl_pick_and_place", 0), ("pick_and_rotate", control != "joints")):
            env = make("kuka", control, task)
            assert env.action_spec.shape[-1] == width + more
            env.close()
