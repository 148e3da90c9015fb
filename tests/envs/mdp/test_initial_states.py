"""Training episodes that begin nearer to their end, and evaluation episodes, which never do."""

import numpy as np
import pytest
import torch

from core.errors import ConfigError
from core.overrides import compose
from envs import read_env
from envs.tasks import NOTHING
from tests.helpers.env_cases import ROBOTS, act, make

WORLDS = 4


def begun(robot, near=0.0, held=0.0, placed=0.0, off_centre=0.0):
    shares = f"task.curriculum={{near: {near}, held: {held}, placed: {placed}, off_centre: {off_centre}}}"
    env = make(robot, "step", "nl_pick_and_place", shares, worlds=WORLDS, seed=8)
    return env, env.reset()


def spot(env, name):
    """(N, 3) where each world's referent or target is."""
    return env.state.objects[np.arange(WORLDS), getattr(env.state, name)]


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
def test_near_begins_above_the_object_with_an_empty_gripper(robot):
    env, _ = begun(robot, near=1)
    offset = env.gripper - spot(env, "referent")
    assert (np.abs(offset[:, :2]) < 0.045).all()
    assert (env.state.held == NOTHING).all()
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
def test_held_begins_with_the_object_in_the_gripper(robot):
    env, _ = begun(robot, held=1)
    assert (env.state.held == env.state.referent).sum() >= WORLDS - 1  # where there is no room, it begins at rest
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["kuka", "jaco"])
def test_a_magnet_keeps_hold_of_objects_that_begin_off_its_middle(robot):
    env, td = begun(robot, held=1, off_centre=0.04)
    held = env.state.held == env.state.referent
    before = (spot(env, "referent") - env.gripper)[held]
    assert held.sum() >= WORLDS - 1
    assert (np.abs(before[:, :2]) < 0.042).all()
    assert np.abs(before[:, :2]).max() > 0.02
    for _ in range(5):
        td = act(env, td, torch.cat([td["hold"][:, :-1], torch.ones(WORLDS, 1)], 1))
    assert (env.state.held == env.state.referent)[held].all()
    np.testing.assert_allclose((spot(env, "referent") - env.gripper)[held], before, atol=0.005)
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
def test_placed_begins_at_the_target_and_succeeds_if_the_gripper_stays_open(robot):
    env, td = begun(robot, placed=1)
    np.testing.assert_allclose(spot(env, "referent"), spot(env, "target"), atol=1e-6)
    assert (env.state.held == NOTHING).all()
    for step in range(env.config.task.success_steps):
        assert not td["success"].any(), step
        td = act(env, td, torch.cat([td["hold"][:, :-1], -torch.ones(WORLDS, 1)], 1))
    assert td["success"].all()
    env.close()


def test_a_placed_object_that_is_grasped_again_is_no_success():
    env, td = begun("kuka", placed=1)
    for _ in range(env.config.task.hold_steps + 2):
        td = act(env, td, torch.cat([td["hold"][:, :-1], torch.ones(WORLDS, 1)], 1))
    assert not td["success"].any()
    assert (env.state.held == env.state.referent).all()
    env.close()


def test_evaluation_episodes_begin_at_rest():
    config = read_env(compose(["task=nl_pick_and_place"]))
    assert config.task.curriculum.share > 0
    assert config.without_curriculum().task.curriculum.share == 0


def test_shares_above_1_in_sum_are_an_error():
    with pytest.raises(ConfigError, match=r"near=0\.6, held=0\.3 and placed=0\.2 must come to 1 at most"):
        read_env(compose(["task=nl_pick_and_place", "task.curriculum={near: 0.6, held: 0.3, placed: 0.2}"]))
