"""Forces of grippers on objects, and on grippers. Private attributes reach into the physics."""

import numpy as np
import pybullet as bullet
import pytest

from tests.helpers.env_cases import ROBOTS, act, make

SIZE = 0.05  # metres


def referents(env):
    state = env.state
    return state.objects[np.arange(len(state.referent)), state.referent]


@pytest.mark.slow
@pytest.mark.parametrize("control", ["step", "joints"])
@pytest.mark.parametrize("robot", ROBOTS)
def test_no_object_is_pressed_through_the_table(robot, control):
    close = np.array([False, True, False, True])
    for task in ("pick_and_place", "push"):
        none = ("task.curriculum.near=0", "task.curriculum.placed=0", "task.curriculum.held=0", "task.max_steps=1000")
        env = make(robot, control, task, *none, worlds=4, seed=3)
        td, lowest = env.reset(), 1.0
        for t in range(70):
            place = referents(env).copy()
            place[:, 2] = 0.12 if t < 24 else 0.15 if t % 20 > 14 or t > 60 else -0.1
            td = act(env, td, env.towards(place, close & (t <= 60)))
            lowest = min(lowest, referents(env)[:, 2].min())
        rest = referents(env)[:, 2]
        env.close()
        assert lowest > -SIZE / 4, task  # a shut fist presses a cube half in; it comes up again
        assert (rest > SIZE / 2 - 0.005).all(), task


def pulled(robot, force, *more):
    """Whether what is held is still held after a while of being pulled aside with so many N."""
    held = ("task.curriculum.near=0", "task.curriculum.placed=0", "task.curriculum.held=1")
    env = make(robot, "step", "pick_and_place", *held, *more, seed=4)
    td, world = env.reset(), env._worlds[0]
    for _ in range(4):
        td = act(env, td, env.towards(env.gripper, np.ones(1, bool)))
    assert env.state.held[0] == env.state.referent[0]
    body = next(
        body for body in world.pool.shown if np.allclose(world.pool.pose(body)[0], referents(env)[0], atol=1e-9)
    )
    step = world.step_physics

    def pull(steps):
        for _ in range(steps):
            place = world.pool.pose(body)[0]
            bullet.applyExternalForce(body, -1, (force, 0, 0), place, bullet.WORLD_FRAME, world.client)
            step()

    world.step_physics = pull
    for _ in range(8):
        td = act(env, td, env.towards(env.gripper, np.ones(1, bool)))
        if env.state.held[0] < 0:
            break
    kept = env.state.held[0] == env.state.referent[0]
    env.close()
    return kept


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "gripper"), [("kuka", "magnet"), ("jaco", "magnet"), ("panda", "fingers"), ("panda", "magnet")]
)
def test_a_grasp_is_lost_under_more_force_than_the_grippers(robot, gripper):
    assert pulled(robot, 2.0, f"gripper={gripper}")
    assert not pulled(robot, 200.0, f"gripper={gripper}")


@pytest.mark.slow
def test_a_weak_magnet_loses_an_object_that_a_strong_one_holds():
    assert pulled("kuka", 20.0, "gripper.pull=60")
    assert not pulled("kuka", 20.0, "gripper.pull=5")
