"""The short arm of five joints: the position comes first, and the gripper tilts as little as it can."""

import re

import numpy as np
import pytest

from core.errors import ConfigError
from core.overrides import compose
from envs import make_env, read_env
from envs.sim.robot import read_kinematics


@pytest.fixture(scope="module")
def config():
    return read_env(compose(["robot=so_arm"]))


@pytest.fixture(scope="module")
def kinematics(config):
    return read_kinematics(config.robot)


def grid(low, high, count=6):
    return np.stack(np.meshgrid(*np.linspace(low, high, count).T), axis=-1).reshape(-1, 3)


def solved(kinematics, places):
    """Joints, and degrees that the gripper is tilted, at each place."""
    rotation = kinematics.forward(kinematics.rest[None]).rotation[0]
    joints = np.repeat(kinematics.rest[None], len(places), axis=0)
    for _ in range(4):
        joints = kinematics.solve(joints, places, rotation)
    pose = kinematics.forward(joints)
    np.testing.assert_allclose(pose.position, places, atol=0.002)
    return joints, np.degrees(np.arccos(np.clip(-pose.rotation[:, 2, 2], -1, 1)))


@pytest.mark.slow
def test_joints_stay_within_their_limits_where_the_gripper_must_tilt(kinematics):
    joints, tilt = solved(kinematics, grid([0.36, -0.15, 0.1], [0.44, 0.15, 0.2]))
    assert tilt.max() > 20
    assert (joints >= kinematics.low).all()
    assert (joints <= kinematics.high).all()


def test_near_the_table_the_gripper_points_down(kinematics):
    _, tilt = solved(kinematics, grid([0.35, -0.1, 0.03], [0.42, 0.1, 0.06]))
    assert tilt.max() < 1


@pytest.mark.slow
def test_the_tilt_is_the_least_that_the_arm_can_have(kinematics):
    rng = np.random.default_rng(0)
    joints = rng.uniform(kinematics.low, kinematics.high, (60_000, len(kinematics.rest)))
    joints[:, 0] = 0.0
    pose = kinematics.forward(joints)
    tilts = np.degrees(np.arccos(np.clip(-pose.rotation[:, 2, 2], -1, 1)))
    for place in grid([0.37, 0.0, 0.1], [0.43, 0.0, 0.2], 3)[::3]:
        near = np.abs(pose.position - place)[:, [0, 2]].max(1) < 0.008
        _, tilt = solved(kinematics, place[None])
        assert near.sum() > 10
        assert tilt[0] < tilts[near].min() + 6


def test_the_workspace_is_cut_to_the_reach(config):
    table, reach = read_env(compose(["robot=kuka"])).workspace, config.robot.reach
    assert config.workspace.gripper_box == [*reach[:4], table.gripper_box[4], reach[5]]
    x0, x1, y0, y1 = config.workspace.object_area
    assert reach[0] < x0 < x1 < reach[1]
    assert reach[2] < y0 < y1 < reach[3]


@pytest.mark.parametrize(
    ("reach", "message"),
    [
        ("[0.0, 0.2, -0.2, 0.2, 0.0, 0.2]", "is beyond the robot's reach=[0.0, 0.2, -0.2, 0.2, 0.0, 0.2]"),
        ("[0.3, 0.5]", "robot.reach=[0.3, 0.5] must be 6 numbers"),
        ("[0.3, 0.5, -0.2, 0.2, 0.0, 9]", "reach=9.0 is out of range"),
    ],
)
def test_a_reach_that_leaves_nothing_is_refused(reach, message):
    with pytest.raises(ConfigError, match=re.escape(message)) as caught:
        read_env(compose(["robot=so_arm", f"robot.reach={reach}"]))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("robot", "task"), [("so_arm", "nl_push")])
def test_a_task_that_needs_more_room_than_the_arm_reaches_is_refused(robot, task):
    with pytest.raises(ConfigError, match=r"does not fit its 4 objects into workspace\.object_area"):
        make_env([f"robot={robot}", f"task={task}"])
