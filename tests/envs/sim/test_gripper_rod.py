"""The rod of a magnet: every robot of full reach gets to every cell of the board, at every height, between stacks."""

import numpy as np
import pybullet as bullet
import pytest

from core.errors import ConfigError
from core.overrides import compose
from envs import read_env
from envs.sim.robot import Robot, read_kinematics
from envs.tasks.board import Grid
from envs.workspace_env import make_kinematics, make_task
from tests.helpers.env_cases import LONG_ARMS

LEVELS, STEPS = 8, 6
CLEAR = 0.004  # metres between the arm and the stacks about the one that it reaches into, at least


@pytest.fixture(scope="module", params=LONG_ARMS)
def arm(request):
    config = read_env(compose(["task=rearrange", f"robot={request.param}"]))
    return config, make_kinematics(config, make_task(config, 1, None))


def columns(config):
    """(64, 2) x and y of every cell."""
    grid = Grid(config.workspace.object_area, config.task.spacing, config.task.object_size)
    return np.array([grid.place(i, j, 0)[:2] for i in range(8) for j in range(8)])


def lowered(config, kinematics):
    """Heights from over all stacks downwards, and the joints with the gripper there over every cell, (64, J)."""
    size, cells = config.task.object_size, columns(config)
    rotation = kinematics.forward(kinematics.rest[None]).rotation[0]
    joints = np.repeat(kinematics.rest[None], len(cells), axis=0)
    start = kinematics.forward(joints).position
    heights = [config.workspace.gripper_box[-1], *(level * size for level in range(LEVELS, 0, -1))]
    goal = np.column_stack((cells, np.full(len(cells), heights[0])))
    for share in np.linspace(0, 1, 15):
        joints = kinematics.solve(joints, start + share * (goal - start), rotation, STEPS)
    for height in heights:
        goal[:, 2] = height
        joints = kinematics.solve(joints, goal, rotation, 5 * STEPS)
        yield height, goal.copy(), joints


@pytest.mark.slow
def test_the_gripper_reaches_every_cell_at_every_height_pointing_down(arm):
    config, kinematics = arm
    down = kinematics.forward(kinematics.rest[None]).rotation[0]
    for _, goal, joints in lowered(config, kinematics):
        pose = kinematics.forward(joints)
        assert np.abs(pose.position - goal).max() < 0.004  # a ninth of a cell
        assert np.einsum("nij,ij->n", pose.rotation, down).min() > 1 + 2 * np.cos(np.radians(1))


@pytest.mark.slow
def test_neither_arm_nor_rod_touches_the_stacks_of_eight_around_it(arm):
    config, kinematics = arm
    size, cells = config.task.object_size, columns(config)
    client = bullet.connect(bullet.DIRECT)
    robot = Robot(config.robot, client, visuals=False, magnet=True)
    half = [size / 2, size / 2, LEVELS * size / 2]
    shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=half, physicsClientId=client)
    stacks = [bullet.createMultiBody(0, shape, -1, (*cell, half[2]), physicsClientId=client) for cell in cells]
    fixed, upright = robot.fixed_links(), (0, 0, 0, 1)
    for height, _, joints in lowered(config, kinematics):
        if height not in (size, 4 * size):
            continue
        for i in (0, 7, 27, 31, 56, 63):
            robot.place(joints[i].tolist(), 0.0)
            bullet.resetBasePositionAndOrientation(stacks[i], (*cells[i], -1.0), upright, client)
            near = [stack for stack in stacks if stack != stacks[i]]
            found = [bullet.getClosestPoints(robot.body, stack, CLEAR, physicsClientId=client) for stack in near]
            assert not [point for points in found for point in points if point[3] not in fixed], (height, i)
            bullet.resetBasePositionAndOrientation(stacks[i], (*cells[i], half[2]), upright, client)
    bullet.disconnect(client)


def test_a_rod_without_lengths_or_lengths_without_a_rod_are_refused():
    for overrides, message in (
        (["gripper=rod", "gripper.rod=[]"], r"gripper.rod=\[\] must be a radius and a length with name=rod"),
        (["gripper.rod=[0.01, 0.1]"], r"gripper.rod=\[0.01, 0.1\] must be \[\] with name=own"),
    ):
        with pytest.raises(ConfigError, match=message):
            read_env(compose(overrides))


def test_a_rod_is_ignored_by_tasks_that_move_nothing():
    plain, rod = (read_env(compose(["task=nl_reach", f"gripper={name}"])).robot for name in ("own", "rod"))
    assert plain == rod


@pytest.mark.slow
def test_worlds_with_and_without_a_rod_live_in_one_process():
    lengths = []
    for overrides in (["task=nl_stack"], ["task=rearrange"], ["task=nl_stack"]):
        config = read_env(compose(overrides))
        client = bullet.connect(bullet.DIRECT)
        robot = Robot(config.robot, client, visuals=False, magnet=True)
        robot.place(config.robot.rest, 0.0)
        low, _ = bullet.getAABB(robot.body, robot.hand, client)
        gripper = read_kinematics(config.robot)
        lengths.append(gripper.forward(gripper.rest[None]).position[0, 2] - low[2])
        bullet.disconnect(client)
    np.testing.assert_allclose(lengths, 0.0, atol=0.01)  # the magnet ends at the gripper centre
