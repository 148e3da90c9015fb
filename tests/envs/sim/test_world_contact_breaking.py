"""Bullet has one contact breaking threshold for all worlds of a process: each world steps with its own."""

import pytest

from tests.helpers.env_cases import Poker, differences, make, rollout

WIDE = ("physics.contact_breaking=0.1",)


def poked(*overrides):
    env = make("kuka", "step", "nl_reach", "task.hold_steps=60", *overrides, seed=5)
    history = rollout(env, 60, Poker(env))
    env.close()
    return history


@pytest.mark.slow
def test_a_world_with_another_threshold_changes_no_other_world():
    alone = poked()
    other = make("kuka", "step", "nl_reach", *WIDE, seed=5)
    rollout(other, 3, Poker(other))
    assert differences(poked(), alone) == []
    other.close()
    assert differences(poked(), alone) == []
    assert differences(poked(*WIDE), alone) != []
