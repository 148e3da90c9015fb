"""Stacking in the simulation: drawn scenes, beginnings by the curriculum, and the outcome of a release on top."""

import numpy as np
import pytest
import torch

from core.errors import ConfigError
from envs.experts import expert
from envs.tasks import NOTHING
from language import parse
from tests.helpers.env_cases import ROBOTS, act, make, task_of

WORLDS = 4
SIZE = 0.05


def begun(robot="kuka", near=0.0, held=0.0, placed=0.0):
    shares = f"task.curriculum={{near: {near}, held: {held}, placed: {placed}}}"
    env = make(robot, "step", "nl_stack", shares, worlds=WORLDS, seed=8)
    return env, env.reset()


def above_the_base(env):
    """(N, 3) from the place on top of each base to the referent, metres."""
    rows = np.arange(WORLDS)
    return env.state.objects[rows, env.state.referent] - env.state.objects[rows, env.state.target] - [0.0, 0.0, SIZE]


def still(td, grip):
    """The action that keeps the arm in place, and the gripper at this command."""
    return torch.cat([td["hold"][:, :-1], torch.full((WORLDS, 1), grip)], 1)


def test_the_sentence_names_a_real_referent_and_another_real_object_as_its_base():
    task, rng = task_of("nl_stack"), np.random.default_rng(0)
    for _ in range(50):
        episode = task.draw(rng)
        step = parse(episode.sentence, episode.scene).steps[-1]
        assert episode.sentence.startswith("stack the ")
        assert (step.init, step.goal) == (episode.referent, episode.target)
        assert episode.referent != episode.target
        assert not episode.scene.targets.any()
        assert episode.goals.all()


def test_every_ordered_pair_of_objects_can_be_asked_for():
    episodes = task_of("nl_stack").each_in_turn(np.random.default_rng(0))
    assert len({(each.referent, each.target) for each in episodes}) == len(episodes) == 6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("override", "message"),
    [("task.num_targets=1", "task.num_targets=1 must be 0"), ("task.num_objects=1", "task.num_objects=1 must be at")],
)
def test_a_config_without_a_base_is_refused(override, message):
    with pytest.raises(ConfigError, match=message):
        task_of("nl_stack", override)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
def test_held_episodes_begin_with_the_referent_in_the_gripper_away_from_all_others(robot):
    env, _ = begun(robot, held=1)
    assert (env.state.held == env.state.referent).sum() >= WORLDS - 1  # a world without room begins at rest
    apart = np.linalg.norm(
        env.state.objects - env.state.objects[np.arange(WORLDS), env.state.referent][:, None], axis=2
    )
    assert (np.sort(apart, axis=1)[:, 1] > SIZE).all()
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
def test_placed_episodes_begin_stacked_and_succeed_while_the_gripper_stays_open(robot):
    env, td = begun(robot, placed=1)
    np.testing.assert_allclose(above_the_base(env), 0.0, atol=1e-6)
    assert (env.state.held == NOTHING).all()
    for step in range(env.config.task.hold_steps):
        assert not td["success"].any(), step
        td = act(env, td, still(td, -1.0))
    assert td["success"].all()
    env.close()


@pytest.mark.slow
def test_the_expert_leaves_the_referent_at_rest_on_top_of_its_base():
    env, td = begun()
    guide = expert(env)
    for _ in range(env.config.task.max_steps):
        td = act(env, td, guide(td.clone())["action"])
        if td["done"][0]:
            break
    assert td["success"][0]
    assert np.abs(above_the_base(env)[0]).max() < 0.01
    assert env.state.held[0] == NOTHING
    for _ in range(10):  # nothing holds it, and it stays
        td = act(env, td, still(td, -1.0))
    assert np.abs(above_the_base(env)[0]).max() < 0.01
    env.close()
