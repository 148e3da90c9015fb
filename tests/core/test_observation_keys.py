"""The keys that a policy may read."""

from __future__ import annotations

from core.spaces import public_keys
from tests.helpers.fake_env import make_env


def test_privileged_keys_and_outcomes_are_left_out():
    env = make_env(1, 0)
    expected = {"robot", "objects", "objects_mask", "hold", "instruction"}
    assert set(public_keys(env.observation_spec)) == set(public_keys(env.reset())) == expected
