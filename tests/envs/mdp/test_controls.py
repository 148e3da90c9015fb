"""What an action does to the arm, measured on real physics."""

import itertools

import numpy as np
import pytest
import torch

from tests.helpers.env_cases import CONTROLS, LONG_ARMS, ROBOTS, TOUCHING, UPRIGHT, act, hold, make

DIRECTIONS = [np.eye(3)[axis] * sign for axis, sign in itertools.product(range(3), (1, -1))]
EXACT = 0.003  # metres


@pytest.fixture(scope="module", params=ROBOTS)
def robot(request):
    return request.param


def start(robot, control, worlds=1, *more):
    """An environment without noise at reset, and its first observation."""
    still = ("task.reset_noise=0", "task.randomize.start=0", "task.max_steps=10000")
    env = make(robot, control, "reach", *still, *more, worlds=worlds)
    return env, env.reset()


def lift(env, td, place, steps=40):
    """The gripper brought to place (N, 3) and settled."""
    for _ in range(steps):
        td = act(env, td, env.towards(place))
    return td


def tilt(env, td):
    """Degrees between the gripper's rotation and that at rest, (N,)."""
    rest = env.kinematics.forward(env.kinematics.rest[None]).rotation[0]
    first = 2 * len(env.config.robot.joints) + 3
    columns = td["robot"][:, first : first + 6].double().numpy().reshape(-1, 2, 3)
    rotation = np.concatenate((columns, np.cross(columns[:, :1], columns[:, 1:])), axis=1).transpose(0, 2, 1)
    return np.degrees(np.arccos(np.clip((rotation * rest).sum((1, 2)) / 2 - 0.5, -1, 1)))


@pytest.fixture(scope="module")
def stepping(robot):
    env, _ = start(robot, "step", len(DIRECTIONS), TOUCHING)
    yield env
    env.close()


def middle(env):
    """(6, 3) a place in the open from which every direction is free, and a short arm points down."""
    place = [0.45, 0.0, 0.2] if env.config.robot.name in LONG_ARMS else [0.4, 0.0, 0.08]
    return np.tile(place, (6, 1))


@pytest.mark.slow
@pytest.mark.parametrize("amount", [1.0, 0.25])
def test_step_moves_the_gripper_by_the_action_along_each_axis(stepping, amount):
    env = stepping
    td = lift(env, env.reset(), middle(env))
    before = env.gripper
    asked = amount * env.config.control.max_move * np.array(DIRECTIONS)
    asked *= speed_allows(env, td, before + asked)[:, None]
    td = act(env, td, amount * np.array(DIRECTIONS))
    for _ in range(4):
        td = act(env, td, np.zeros((6, 3)))
    np.testing.assert_allclose(env.gripper - before, asked, atol=EXACT)


def speed_allows(env, td, place):
    """The part of the way to place (N, 3) that the joints' speeds let the gripper go in one step, (N,)."""
    joints = td["robot"][:, : len(env.kinematics.rest)].double().numpy()
    rotation = env.kinematics.forward(env.kinematics.rest[None]).rotation[0]
    turn = np.abs(env.kinematics.solve(joints, place, rotation, 2 if env.config.robot.name in UPRIGHT else 1) - joints)
    period = env.config.physics.time_step * env.config.physics.substeps
    return 1 / np.maximum(1, (turn / (np.array(env.config.robot.max_speed) * period)).max(1))


@pytest.mark.slow
def test_many_small_steps_add_up(stepping):
    env = stepping
    td = lift(env, env.reset(), middle(env))
    before = env.gripper
    count = 20 if env.config.robot.name in LONG_ARMS else 12  # 9 cm, or 5.4 cm
    for _ in range(count):
        td = act(env, td, 0.15 * np.array(DIRECTIONS))
    for _ in range(4):
        td = act(env, td, np.zeros((6, 3)))
    asked = count * 0.15 * env.config.control.max_move * np.array(DIRECTIONS)
    np.testing.assert_allclose(env.gripper - before, asked, atol=2 * EXACT)


@pytest.mark.slow
def test_step_stays_where_it_is_while_the_action_is_zero(stepping):
    env = stepping
    td = lift(env, env.reset(), middle(env))
    before = env.gripper
    for _ in range(60):
        td = act(env, td, np.zeros((6, 3)))
    assert np.abs(env.gripper - before).max() < EXACT


@pytest.mark.slow
def test_step_never_leaves_the_gripper_box(stepping):
    env = stepping
    td = env.reset()
    for _ in range(40):
        td = act(env, td, np.array(DIRECTIONS))
    low, high = env.control.box
    assert (env.gripper > low - 0.005).all()
    assert (env.gripper < high + 0.005).all()
    at_border = np.array([high[0], low[0], high[1], low[1], high[2]])
    reached = [env.gripper[i, i // 2] for i in range(5)]  # downwards an object may be in the way
    np.testing.assert_allclose(reached, at_border, atol=0.01)


@pytest.mark.slow
def test_absolute_reaches_the_commanded_position_and_stays(robot):
    corners = np.array([(-0.9, -0.9, 0.2), (-0.9, 0.9, -0.3), (0.9, -0.9, -0.3), (0.9, 0.9, 0.2)])  # above the object
    env, td = start(robot, "absolute", len(corners))
    low, high = env.control.box
    for _ in range(60):
        td = act(env, td, corners)
    place = low + (corners + 1) / 2 * (high - low)
    np.testing.assert_allclose(env.gripper, place, atol=EXACT)
    for _ in range(20):
        td = act(env, td, corners)
        np.testing.assert_allclose(env.gripper, place, atol=EXACT)
    env.close()


@pytest.mark.slow
def test_absolute_moves_at_most_max_move_a_step(robot):
    env, td = start(robot, "absolute", 2)
    far, largest = np.array([[1.0, 1.0, 0.5], [1.0, -1.0, 0.9]]), 0.0
    for _ in range(15):
        before = env.gripper
        td = act(env, td, far)
        largest = max(largest, np.linalg.norm(env.gripper - before, axis=1).max())
    assert largest < 1.1 * env.config.control.max_move
    env.close()


@pytest.mark.slow
def test_joints_reach_the_commanded_angles(robot):
    env, td = start(robot, "joints", 2)
    kinematics = env.kinematics
    rng = np.random.default_rng(0)
    middle = kinematics.rest
    if robot not in LONG_ARMS:  # it rests too near to the table
        middle = kinematics.solve(
            kinematics.rest[None], np.array([[0.4, 0.0, 0.18]]), kinematics.forward(kinematics.rest[None]).rotation
        )
    angles = middle + rng.uniform(-0.25, 0.25, (2, len(kinematics.rest)))
    angles = np.clip(angles, kinematics.low, kinematics.high)
    action = 2 * (angles - kinematics.low) / (kinematics.high - kinematics.low) - 1
    for _ in range(40):
        td = act(env, td, action)
    measured = td["robot"][:, : len(kinematics.rest)].numpy()
    assert (kinematics.forward(angles).position[:, 2] > 0.08).all()  # in the open: nothing holds the arm back
    np.testing.assert_allclose(measured, angles, atol=0.01)
    env.close()


@pytest.mark.slow
def test_joint_actions_span_the_limits_at_limited_speed(robot):
    env, _ = start(robot, "joints")
    kinematics, period = env.kinematics, env.config.physics.time_step * env.config.physics.substeps
    limit = np.array(env.config.robot.max_speed) * period
    commanded = kinematics.rest[None]
    low = env.control.targets(-np.ones((1, len(limit))), kinematics.low[None], kinematics.low[None])
    high = env.control.targets(np.ones((1, len(limit))), kinematics.high[None], kinematics.high[None])
    np.testing.assert_allclose(low[0], kinematics.low)
    np.testing.assert_allclose(high[0], kinematics.high)
    for sign in (-1.0, 1.0):
        asked = env.control.targets(np.full((1, len(limit)), sign), commanded, commanded)
        assert (np.abs(asked - commanded) <= limit + 1e-9).all()
    env.close()


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.parametrize("control", [name for name in CONTROLS if name != "joints"])
def test_the_gripper_points_down_all_along_a_path_through_the_box(robot, control):
    rng = np.random.default_rng(0)
    env, td = start(robot, control, 2)
    low, high = env.control.box
    worst = 0.0
    for _ in range(6):
        aim = rng.uniform([low[0], low[1], 0.1], high, (2, 3))
        for _ in range(18):
            td = act(env, td, env.towards(aim))
            worst = max(worst, tilt(env, td).max())
    assert worst < 3.0 or robot not in UPRIGHT
    env.close()


@pytest.mark.parametrize("control", CONTROLS)
def test_actions_are_clipped_to_1(control):
    ends = []
    for size in (1.0, 50.0):
        env, td = start("kuka", control, 2)
        signs = np.where(np.arange(env.action_spec.shape[-1]) % 2, 1.0, -1.0)
        for _ in range(5):
            td = act(env, td, np.stack((signs, -signs)) * size)
        ends.append(td["robot"])
        env.close()
    assert torch.equal(*ends)


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.parametrize("bad", [float("nan"), float("inf"), float("-inf")])
@pytest.mark.parametrize("control", CONTROLS)
def test_a_non_finite_action_is_an_error_and_moves_nothing(control, bad):
    env, td = start("kuka", control, 2)
    action = hold(env, td)
    before = env.gripper
    action[1, 0] = bad
    with pytest.raises(ValueError, match="action is not a finite number"):
        act(env, td, action)
    assert (env.gripper == before).all()
    td = act(env, td, hold(env, td))
    assert td["robot"].isfinite().all()
    env.close()


@pytest.mark.parametrize("control", CONTROLS)
def test_the_action_tensor_is_not_written_to(control):
    env, td = start("kuka", control)
    action = torch.full(env.action_spec.shape, 3.0)
    act(env, td, action)
    assert (action == 3.0).all()
    env.close()


@pytest.mark.parametrize("control", CONTROLS)
def test_the_gripper_rises_at_once_after_pressing_on_the_table(control):
    env, td = start("kuka", control)
    below = np.array([[0.45, 0.0, -0.2]])
    for _ in range(60):
        td = act(env, td, env.towards(below))
    pressed = env.gripper[0, 2]
    for _ in range(8):
        td = act(env, td, env.towards(env.gripper + np.array([0.0, 0.0, 0.1])))
    assert env.gripper[0, 2] > pressed + 0.03
    env.close()


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.parametrize("control", CONTROLS)
def test_a_gripper_that_is_to_move_nothing_stays_above_the_objects(robot, control):
    """It is commanded to go down through an object. With joints as actions, it may overshoot by some millimetres."""
    env, td = start(robot, control, 2)
    begun, floor = env.state.objects.copy(), env.config.task.object_size - 0.01 * (control == "joints")
    for _ in range(50):
        td = act(env, td, env.towards(begun[:, 0] - [0.0, 0.0, 0.1]))
        assert (env.gripper[:, 2] > floor).all()
    assert np.linalg.norm((env.gripper - begun[:, 0])[:, :2], axis=1).max() < 0.02
    assert np.linalg.norm(env.state.objects - begun, axis=-1).max() < 0.01
    env.close()


def test_joints_whose_angles_lead_below_the_box_slide_along_its_floor():
    """Without that, a policy whose action leads a little below the box stands still for the rest of the episode."""
    env, _ = start("kuka", "joints")
    kinematics, floor = env.kinematics, env.control.box[0, 2]
    down = kinematics.forward(kinematics.rest[None]).rotation
    beside, below = np.array([[0.45, 0.1, floor]]), np.array([[0.5, -0.15, floor - 0.05]])
    joints = kinematics.solve(kinematics.rest[None], beside, down)
    wanted = env.control._scaled(kinematics.solve(joints, below, down))
    for _ in range(60):
        joints = env.control.targets(wanted, joints, joints)
        assert kinematics.forward(joints).position[0, 2] > floor - 1e-3
    np.testing.assert_allclose(kinematics.forward(joints).position[0, :2], below[0, :2], atol=0.05)
    env.close()


def test_a_gripper_that_begins_below_the_objects_tops_rises():
    env, _ = start("kuka", "joints")
    kinematics, low = env.kinematics, np.array([[0.45, 0.3, 0.035]])
    down = kinematics.solve(kinematics.rest[None], low, kinematics.forward(kinematics.rest[None]).rotation)
    up = kinematics.solve(down, low + [0.0, 0.0, 0.1], kinematics.forward(kinematics.rest[None]).rotation)
    for _ in range(40):
        down = env.control.targets(env.control._scaled(up), down, down)
    np.testing.assert_allclose(down, up, atol=0.01)
    env.close()
