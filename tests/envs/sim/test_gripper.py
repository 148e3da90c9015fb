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
@pytest.mark.sampled
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


def swept(robot, *more):
    """Metres by which an open magnet moves a cube that it sweeps over from side to side, as low as it goes."""
    none = ("task.curriculum.near=0", "task.curriculum.placed=0", "task.curriculum.held=0", "task.max_steps=1000")
    env = make(robot, "step", "pick_and_place", *none, *more, worlds=4, seed=5)
    td, begun = env.reset(), referents(env).copy()
    for t in range(60):
        aside = 0.0 if t < 10 else 0.08 if t < 35 else -0.08
        td = act(env, td, env.towards(begun + [0.0, aside, 0.15 if t < 25 else -0.1], np.zeros(4, bool)))
    moved = np.linalg.norm(referents(env) - begun, axis=1)
    env.close()
    return moved.max()


STEADY = ("kuka", "jaco", "ur5", "xarm7")  # whose gripper stays within a millimetre of where it is sent


@pytest.mark.slow
@pytest.mark.parametrize("robot", STEADY)
def test_a_magnet_pushes_nothing_aside(robot):
    assert swept(robot, "gripper=magnet") < 0.001
    assert swept(robot, "gripper=magnet", "gripper.gap=0") > 0.01


@pytest.mark.slow
@pytest.mark.parametrize("robot", STEADY)
def test_a_magnet_takes_hold_over_its_gap(robot):
    env = make(
        robot,
        "step",
        "pick_and_place",
        "gripper=magnet",
        "task.curriculum.near=1",
        "task.curriculum.held=0",
        "task.curriculum.placed=0",
        worlds=4,
        seed=5,
    )
    td = env.reset()
    for t in range(20):
        td = act(env, td, env.towards(referents(env), np.full(4, t > 10)))
        assert (env.gripper[:, 2] > SIZE).all()
    assert (env.state.held == env.state.referent).all()
    env.close()


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
