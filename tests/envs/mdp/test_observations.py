"""Observations are declared once: everything else follows from the table."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
import torch
from torchrl.data import Bounded

from envs.mdp import observations
from envs.mdp.observation_terms import ObservationTerm
from tests.helpers.env_cases import TASKS, act, make
from trainers.algorithms.algorithm import DivergedError, check_batch
from trainers.datasets.demonstrations import demonstrate
from trainers.run.checkpoint import widths

HEIGHT = ObservationTerm(
    "height",
    "(1,): the height of the gripper centre (m)",
    spec=lambda setup: Bounded(-1, 2, shape=(1,), dtype=torch.float32),
    compute=lambda source: source.state.gripper[:, 2:],
    gymnasium=True,
)


@pytest.fixture
def with_height(monkeypatch):
    """One more term in the table."""
    for module in ("envs.mdp.observations", "envs.workspace_env", "envs.gym_interface"):
        monkeypatch.setattr(f"{module}.OBSERVATIONS", (*observations.OBSERVATIONS, HEIGHT))


def test_an_added_term_is_in_the_spec_and_observed(with_height):
    env = make(worlds=2)
    assert env.observation_spec["height"].shape == (2, 1)
    np.testing.assert_allclose(env.reset()["height"][:, 0], env.gripper[:, 2], rtol=1e-6)
    env.close()


def test_an_added_term_is_described(with_height):
    assert observations.descriptions()["height"] == HEIGHT.description


def test_an_added_term_is_in_the_gymnasium_observation(with_height):
    env = gymnasium.make("Deixis/NLReach-v0")
    observation, _ = env.reset(seed=0)
    assert observation["height"] in env.observation_space["height"]
    env.close()


@pytest.mark.slow
def test_an_added_term_is_recorded_and_in_the_widths_of_a_checkpoint(with_height):
    env = make("kuka", "step", "nl_reach", "task.max_steps=3", "task.hold_steps=3")
    (episode,) = demonstrate(env, lambda td: td.set("action", env.towards(env.gripper)), 1, seed=0)
    assert episode.observations["height"].shape == (len(episode) + 1, 1)
    assert widths(env.observation_spec, env.action_spec)["height"] == [1]
    env.close()


def test_an_added_term_is_checked_for_finite_values(with_height):
    env = make()
    td = env.reset()
    after = act(env, td, env.towards(env.gripper))
    batch = td.exclude("reward").set("action", env.towards(env.gripper)).set("next", after)
    check_batch(batch)
    batch["next", "height"][:] = torch.nan
    with pytest.raises(DivergedError, match="next/height is not finite"):
        check_batch(batch)
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize("task", TASKS)
def test_what_is_observed_is_in_the_spec(task):
    env = make("kuka", "step", task, worlds=2)
    td = env.reset()
    assert set(env.observation_spec.keys(True, True)) <= set(td.keys(True, True))
    for key, spec in env.observation_spec.items(True, True):
        assert spec.is_in(td[key]), key
        assert td[key].dtype == spec.dtype, key
    env.close()


@pytest.mark.parametrize(
    ("key", "reader", "message"),
    [("x", "policy", "reader='policy' must be one of"), ("privileged/x", "actor", "may not see what is privileged")],
)
def test_a_reader_that_may_not_see_an_observation_is_refused(key, reader, message):
    with pytest.raises(ValueError, match=message):
        replace(HEIGHT, key=key, reader=reader)
