"""Policies read the finger where there is one: as geometry, beside the words."""

import numpy as np
import pytest
import torch

from envs import make_env
from human import ray_offsets
from tests.helpers.training_configs import training
from trainers.models.grounding import grounding_loss, ray_features
from trainers.models.policy import build_policy


@pytest.fixture(scope="module")
def scenes():
    """A policy's specs and unit, with 1000 scenes to learn from and 300 fresh ones, of nl_reach_gesture."""
    env = make_env(["task=nl_reach_gesture"], num_worlds=1)
    yield env.observation_spec, env.action_unit, env.draw_scenes(1000, 1), env.draw_scenes(300, 2)
    env.close()


def accuracy(policy, scenes):
    with torch.no_grad():
        return float(grounding_loss(policy.encode(scenes.clone()))[1])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["grounded", "mlp"])
def test_a_policy_reads_the_gesture_only_where_there_is_one(name, scenes):
    spec, unit, _, _ = scenes
    assert "gesture" in build_policy(training(policy=name).policy, spec, unit).act.in_keys
    wordy = make_env(["task=nl_reach"], num_worlds=1)
    assert "gesture" not in build_policy(training(policy=name).policy, wordy.observation_spec, unit).act.in_keys
    wordy.close()


@pytest.mark.parametrize("name", ["grounded", "mlp"])
def test_another_ray_changes_the_action(name, scenes):
    spec, unit, known, _ = scenes
    torch.manual_seed(0)
    policy = build_policy(training(policy=name).policy, spec, unit)
    frames = known[:8].clone()
    turned = frames.clone()
    turned["gesture"][:, 4] += 0.3
    one, other = (policy.encode(each)[policy.context_key] for each in (frames, turned))
    assert not torch.equal(one, other)


def test_ray_features_agree_with_the_pointing_module():
    rng = np.random.default_rng(0)
    places, origin = rng.normal(size=(20, 5, 3)), rng.normal(size=(20, 3))
    direction = rng.normal(size=(20, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    lies = ray_offsets(origin, direction, places)
    gesture = np.concatenate((origin, direction, np.ones((20, 1))), axis=1)
    seen = ray_features(torch.from_numpy(places), torch.from_numpy(gesture)).numpy()
    np.testing.assert_allclose(seen[..., 0], 10 * lies.angle, atol=1e-9)
    np.testing.assert_allclose(seen[..., 1], 100 * lies.distance, atol=1e-9)
    assert ((seen[..., 4] == 1) == (lies.along < 0)).all()


def test_ray_features_are_zero_without_a_ray():
    gesture = torch.zeros(4, 7)
    assert (ray_features(torch.randn(4, 6, 3), gesture) == 0).all()


@pytest.mark.slow
def test_the_encoder_learns_to_combine_words_and_ray(scenes):
    spec, unit, known, fresh = scenes
    torch.manual_seed(0)
    policy = build_policy(training(policy="grounded").policy, spec, unit)
    optimizer = torch.optim.Adam(policy.encoder.parameters(), lr=3e-3)
    for _ in range(300):
        loss = grounding_loss(policy.encode(known[torch.randint(len(known), (128,))]))[0]
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    blank, hidden = fresh.clone(), fresh.clone()
    blank["instruction"].zero_()
    hidden["gesture"].zero_()
    assert accuracy(policy, fresh) > 0.93
    assert accuracy(policy, blank) < 0.93
    assert accuracy(policy, hidden) < 0.65
