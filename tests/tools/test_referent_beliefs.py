"""Words and finger together tell the referent better than either alone, and the oracle stays below the ceiling."""

import numpy as np
import pytest

from envs.experts import Oracle
from envs.mdp.gestures import make_person
from tests.helpers.env_cases import make
from tools.referent_beliefs import accuracy_by_cue
from trainers.evaluation.evaluation import evaluate

SCENES, NOISE = 200, 2.0

pytestmark = pytest.mark.slow


def person_of(env):
    """A person equal to the one in the environment's task."""
    return make_person(env.config.workspace.human, env.config.gesture)


@pytest.fixture(scope="module")
def env():
    env = make("kuka", "step", "nl_reach_gesture", worlds=20, seed=7)
    yield env
    env.close()


@pytest.fixture(scope="module")
def known(env):
    rng = np.random.default_rng(7)
    episodes = [env.task.draw(rng) for _ in range(SCENES)]
    return accuracy_by_cue(episodes, person_of(env), NOISE, env.config.task.object_size)


def test_words_and_finger_are_weak_alone_and_strong_together(known):
    assert 0.4 < known["words"]["right"] < 0.6
    assert 0.6 < known["finger"]["right"] < 0.93
    assert known["both"]["right"] > 0.97


def test_beliefs_are_calibrated(known):
    for name in ("words", "finger", "both", "insider"):
        assert known[name]["low"] <= known[name]["expected"] <= known[name]["high"], name


def test_knowing_the_kinematics_of_the_person_adds_almost_nothing(known):
    assert abs(known["insider"]["expected"] - known["both"]["expected"]) < 0.01


def test_the_oracle_beats_either_cue_and_stays_below_the_ceiling(env, known):
    result = evaluate(env, Oracle(env), 100, seed=11)
    assert result.success_at_end >= 0.95
    assert result.ci95[0] > max(known["words"]["high"], known["finger"]["right"])
    assert result.ci95[0] <= known["insider"]["high"]


def test_the_fingertip_does_not_reveal_the_distance_of_the_target(env):
    """Targets at any distance along one ray must give the same fingertip: else the posture would tell the referent."""
    person, rng = person_of(env), np.random.default_rng(3)
    near, far = np.array([0.36, 0.0, 0.015]), np.array([0.52, 0.0, 0.015])
    levels = []
    for place in (near, far):
        gesture = person.show(place, rng)
        fall = (place[2] - gesture.origin[2]) / gesture.direction[2]
        again = person.aim(gesture.origin + fall * gesture.direction)
        levels.append(np.abs(again.origin - gesture.origin).max())
    assert max(levels) < 1e-4


def test_with_10_degrees_of_noise_the_oracle_reaches_the_lower_ceiling():
    """At 10 degrees words and finger leave doubt: a higher success would need information that they do not hold."""
    env = make("kuka", "step", "nl_reach_gesture", "gesture.noise_deg=10", worlds=20, seed=7)
    rng = np.random.default_rng(8)
    episodes = [env.task.draw(rng) for _ in range(4 * SCENES)]
    best = accuracy_by_cue(episodes, person_of(env), 10.0, env.config.task.object_size)["insider"]
    assert best["expected"] < 0.985
    result = evaluate(env, Oracle(env), 200, seed=11)
    assert result.ci95[0] <= best["expected"] <= result.ci95[1]
    env.close()
