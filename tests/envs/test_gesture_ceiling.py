"""What words and finger tell of who is meant: never more than they can, and together more than either alone."""

import numpy as np
import pytest

from benchmarks.gesture import told
from envs.experts import Oracle
from tests.helpers.env_cases import make
from trainers.rollout.evaluation import evaluate

SCENES, NOISE = 200, 2.0


@pytest.fixture(scope="module")
def env():
    env = make("kuka", "step", "nl_reach_gesture", worlds=20, seed=7)
    yield env
    env.close()


@pytest.fixture(scope="module")
def known(env):
    rng = np.random.default_rng(7)
    episodes = [env.task.draw(rng) for _ in range(SCENES)]
    return told(episodes, env.task._person, NOISE, env.config.task.object_size)


def test_words_and_finger_are_weak_alone_and_strong_together(known):
    assert 0.4 < known["words"]["right"] < 0.6
    assert 0.6 < known["finger"]["right"] < 0.93
    assert known["both"]["right"] > 0.97


def test_what_is_believed_of_a_finger_is_as_often_true(known):
    for name in ("words", "finger", "both", "insider"):
        assert known[name]["low"] <= known[name]["expected"] <= known[name]["high"], name


def test_to_know_how_the_arm_comes_to_point_helps_next_to_nothing(known):
    assert abs(known["insider"]["expected"] - known["both"]["expected"]) < 0.01


def test_the_oracle_beats_either_alone_and_keeps_below_the_ceiling(env, known):
    result = evaluate(env, Oracle(env), 100, seed=11)
    assert result.success_at_end >= 0.95
    assert result.ci95[0] > max(known["words"]["high"], known["finger"]["right"])
    assert result.ci95[0] <= known["insider"]["high"]


def test_the_fingers_place_does_not_tell_how_far_away_its_aim_is(env):
    """Aims at any distance along one ray must look alike: a posture that told would tell which object is meant."""
    person, rng = env.task._person, np.random.default_rng(3)
    near, far = np.array([0.36, 0.0, 0.015]), np.array([0.52, 0.0, 0.015])
    levels = []
    for place in (near, far):
        gesture = person.show(place, rng)
        fall = (place[2] - gesture.origin[2]) / gesture.direction[2]
        again = person.aim(gesture.origin + fall * gesture.direction)
        levels.append(np.abs(again.origin - gesture.origin).max())
    assert max(levels) < 1e-4


def test_with_an_unsteady_finger_the_ceiling_is_low_and_the_oracle_stands_at_it():
    """At 10 degrees words and finger leave a doubt: whoever did better would know more than they tell."""
    env = make("kuka", "step", "nl_reach_gesture", "gesture.noise_deg=10", worlds=20, seed=7)
    rng = np.random.default_rng(8)
    episodes = [env.task.draw(rng) for _ in range(4 * SCENES)]
    best = told(episodes, env.task._person, 10.0, env.config.task.object_size)["insider"]
    assert best["expected"] < 0.985
    result = evaluate(env, Oracle(env), 200, seed=11)
    assert result.ci95[0] <= best["expected"] <= result.ci95[1]
    env.close()
