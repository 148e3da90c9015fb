"""The keys that a policy may read."""

from __future__ import annotations

from tests.helpers.fake_env import make_env
from trainers.utils.observation_keys import public_keys


def test_privileged_keys_and_outcomes_are_left_out():
    env = make_env(1, 0)
    expected = {"robot", "objects", "objects_mask", "hold", "instruction"}
    assert set(public_keys(env.observation_spec)) == set(public_keys(env.reset())) == expected
