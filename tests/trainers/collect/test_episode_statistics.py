"""Statistics of training episodes."""

from __future__ import annotations

import math

import pytest

from tests.helpers.fake_env import make_env
from trainers.collect.rollouts import EpisodeStatistics


def test_episodes_continue_from_batch_to_batch():
    env = make_env(4, 0)
    batch = env.rollout(60, break_when_any_done=False)
    whole, parts = EpisodeStatistics(env.reward_names), EpisodeStatistics(env.reward_names)
    expected = whole.measure(batch)
    pieces = [parts.measure(batch[:, i : i + 7]) for i in range(0, 60, 7)]
    count = sum(p["train/episodes"] for p in pieces)
    mean = sum(p["train/return"] * p["train/episodes"] for p in pieces if p["train/episodes"]) / count
    assert count == expected["train/episodes"]
    assert mean == pytest.approx(expected["train/return"], rel=1e-6)
    assert expected["reward/there"] + expected["reward/near"] == pytest.approx(float(batch["next", "reward"].mean()))


def test_a_batch_in_which_no_episode_ends_has_no_means():
    env = make_env(2, 0)
    batch = env.rollout(1)
    batch["next", "done"][:] = False
    measured = EpisodeStatistics().measure(batch)
    assert measured["train/episodes"] == 0
    assert math.isnan(measured["train/success"])
