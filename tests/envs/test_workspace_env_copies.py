"""Copies of environments: of their own worlds, where the original is."""

import copy
import pickle

import gymnasium
import pytest
import torch

from core.errors import UseError
from envs import make_env
from tests.helpers.thorough import some

TASKS = {
    "grasping": ["task=nl_pick_and_place", "robot=panda"],
    "pointing": ["task=nl_reach_gesture"],
    "randomized": ["task=nl_push", "task.randomize.action_noise=0.1", "task.randomize.delay=[0,2]"],
    "several instructions": ["task=anything", "task.instructions=3"],
    "automatic curriculum": ["task=anything", "task.curriculum.automatic=true"],
}


def actions(env, steps, seed=0):
    generator = torch.Generator().manual_seed(seed)
    return [torch.rand(*env.action_spec.shape, generator=generator) * 2 - 1 for _ in range(steps)]


def drive(env, chosen, now):
    """The frames of these actions; a world whose episode ends begins another."""
    frames = []
    for action in chosen:
        frame, now = env.step_and_maybe_reset(now.clone().set("action", action))
        frames.append(frame.clone())
    return torch.stack(frames), now


def assert_equal(one, other):
    for key in one.keys(True, True):
        assert torch.equal(one[key], other[key]), key


@pytest.mark.slow
@pytest.mark.parametrize("way", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copy", "pickle"])
@pytest.mark.parametrize("name", some(TASKS, 2))
def test_a_copy_goes_on_as_the_original_and_leaves_it_alone(name, way):
    env = make_env([*TASKS[name], "task.max_steps=6"], num_worlds=2, seed=3)
    _, now = drive(env, actions(env, 9), env.reset())
    twin = way(env)
    twins, _ = drive(twin, actions(env, 8, seed=1), now)
    twin.close()
    own, _ = drive(env, actions(env, 8, seed=1), now)
    env.close()
    assert_equal(own, twins)


def test_a_copy_before_the_first_reset_begins_the_same_episode():
    env = make_env(["task=nl_reach"], seed=5)
    twin = copy.deepcopy(env)
    assert_equal(env.reset(), twin.reset())
    env.close(), twin.close()


def test_a_copy_of_a_gymnasium_environment_has_a_world_of_its_own():
    env = gymnasium.make("Deixis/NLReach-v0")
    env.reset(seed=1)
    env.step(env.action_space.sample())
    twin = copy.deepcopy(env)
    action = env.action_space.sample()
    first, *_ = twin.step(action)
    twin.step(action), twin.close()
    second, *_ = env.step(action)
    assert all((first[key] == second[key]).all() for key in first)
    env.close()


def test_what_cannot_be_copied_says_why():
    env = make_env(["task=nl_reach"])
    env.close()
    with pytest.raises(UseError, match="cannot be copied or pickled: it is closed"):
        copy.deepcopy(env)
