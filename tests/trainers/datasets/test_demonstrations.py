"""Demonstrations: their keys, lengths and seeds."""

from __future__ import annotations

import numpy as np
import pytest

from core.spaces import public_keys
from tests.helpers.fake_env import make_env
from tests.helpers.fake_expert import EXPERT
from trainers.datasets.demonstrations import demonstrate, replay_episode


@pytest.mark.slow
def test_the_gesture_moves_to_another_object_in_the_recording(recorded_episodes):
    """Otherwise a replay that ignores the movement would not be noticed."""
    assert any(len(np.unique(episode.labels["referent"])) > 1 for episode in recorded_episodes)
    assert {"gesture", "instruction", "robot", "objects", "objects_mask", "hold"} <= recorded_episodes[
        0
    ].observations.keys()


def test_observations_are_all_keys_that_a_policy_may_receive():
    keys = public_keys(make_env(1, 0).observation_spec)
    assert keys == ["robot", "objects", "objects_mask", "hold", "instruction"]


def test_an_episode_has_one_more_observation_than_actions():
    (episode,) = demonstrate(make_env(1, 0), EXPERT, 1, 3)
    steps = len(episode)
    assert {len(values) for values in (*episode.observations.values(), *episode.labels.values())} == {steps + 1}
    assert {len(values) for values in episode.outcomes.values()} == {steps}
    assert episode.success
    assert episode.sentence.startswith("touch the ")


def test_the_same_seed_and_actions_give_the_same_episode():
    first, other = demonstrate(make_env(1, 0), EXPERT, 2, 3)
    again = replay_episode(make_env(1, 9), first)
    for key, values in first.observations.items():
        np.testing.assert_array_equal(again.observations[key], values)
    assert first.seed != other.seed
