"""A scripted expert does every task with every robot and control, and keeps the arm off the table."""

import numpy as np
import pybullet as bullet
import pytest

from envs.experts import expert
from envs.experts.reach import ReachExpert
from tests.helpers.env_cases import COMBINATIONS, ROBOTS, act, make, name_of, options, partial_reset
from tests.helpers.thorough import cases

WORLDS, EPISODES = 4, cases(8, 16)
ENOUGH = 0.85  # one of eight may fail, two of sixteen; `python -m benchmarks.experts` asks for 0.95 of 200


def arm_touches_furniture(env):
    """Whether a moving link of any world's arm is in contact with something fixed. Reads private attributes.

    Fingertips may brush the table on both sides of what they take up.
    """
    for world in env._worlds:
        robot, client = world.robot, world.client
        fixed = {*robot.fixed_links(), *robot.fingers}
        for contact in bullet.getContactPoints(bodyA=robot.body, physicsClientId=client):
            body, link = contact[2], contact[3]
            furniture = body != robot.body and bullet.getDynamicsInfo(body, -1, client)[0] == 0
            operated = {*world.furniture.bodies.values(), *world.devices.bodies}  # a drawer by its handle, a button
            handled = body in operated and link >= robot.hand
            if furniture and not handled and link not in fixed and contact[8] < 0:
                return True
    return False


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.parametrize("combination", COMBINATIONS, ids=name_of)
def test_the_expert_solves_the_task_without_touching_the_table(combination):
    solves_without_touching_the_table(*combination)


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.parametrize(
    ("control", "task"), [("absolute", "nl_lift"), ("step", "nl_pick_and_place"), ("joints", "nl_stack")]
)
def test_the_expert_solves_the_task_with_jaws_on_a_hinge(control, task):
    solves_without_touching_the_table("so_arm", control, task, "gripper=hinge")


def solves_without_touching_the_table(*options):
    env = make(*options, "task.curriculum={near: 0, held: 0, placed: 0}", worlds=WORLDS, seed=21)
    actor, td = expert(env), env.reset()
    solved, lowest, steps = [], 1.0, 0
    while len(solved) < EPISODES:
        td = act(env, td, actor(td.clone())["action"])
        lowest, steps = min(lowest, env.gripper[:, 2].min()), steps + 1
        assert env.task.traits.operates or not arm_touches_furniture(env), f"step {steps}"  # a device is to be touched
        over = np.flatnonzero(td["done"][:, 0].numpy())
        solved += td["success"][over, 0].tolist()
        if len(over):
            td = partial_reset(env, td, over)
    env.close()
    assert np.mean(solved) >= ENOUGH
    assert lowest > 0


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.parametrize("workspace", options("workspace"))
@pytest.mark.parametrize("robot", ROBOTS)
def test_the_expert_reaches_every_goal_in_every_workspace(robot, workspace):
    for task in ("reach", "nl_reach"):
        env = make(robot, "step", task, f"workspace={workspace}", worlds=4, seed=22)
        for _ in range(2):  # episodes of each world
            expert, td, reached, steps = ReachExpert(env), env.reset(), np.zeros(4, bool), 0
            while not reached.all() and steps < env.config.task.max_steps:
                td, steps = act(env, td, expert(td.clone())["action"]), steps + 1
                reached |= td["success"][:, 0].numpy()
            assert reached.all()
        env.close()
