"""Success has the highest return in every manipulation task, as follows from its potentials and weights.

Reward terms are differences of potentials (potential-based shaping, Ng et al. 1999, "Policy invariance under reward
transformations", ICML). Without discounting, an episode earns the weighted potentials at its end minus those at its
beginning. The potentials at success may be below their maxima. So an episode can earn more than a successful one from
the same beginning only by that difference.
"""

import numpy as np
import pytest

from envs.tasks import TASKS
from language import LIFTED
from tests.helpers.manipulation_cases import DONE, MOVING, four, judged, moment, state_for

MOST = {"approach": 0, "grasp": 1, "lift": 1, "transport": 0, "release": 1, "rest": 1, "height": LIFTED, "turn": 1} | {
    "touch": 1,
    "withdraw": 1,
}


def way_to_success(name):
    plain = name.removeprefix("nl_")
    ways = (
        way for names, way, end in DONE.values() if end == "success" and plain in [n.removeprefix("nl_") for n in names]
    )
    return next(ways)


def lacking(name):
    """How much less than they could be all weighted potentials are at success, at worst."""
    task = four(name)
    task.reset(np.array([0]), state_for(task, moment()))
    for each in way_to_success(name):
        task.step(state_for(task, each))
    ends = {term: float(values[0]) for term, values in task._potentials(state_for(task, each)).items()}
    if "transport" in ends and name != "throw":
        ends["transport"] = -task.config.radius
    return sum(task.config.reward[term] * (MOST[term] - value) for term, value in ends.items())


@pytest.mark.slow
@pytest.mark.parametrize("name", MOVING)
def test_an_episode_that_never_finishes_earns_less_than_one_that_does(name):
    weights = four(name).config.reward
    assert lacking(name) < weights["success"]  # the one that finishes is the shorter one, and time costs


@pytest.mark.slow
@pytest.mark.parametrize("name", MOVING)
def test_an_early_failure_earns_less_than_a_late_success(name):
    config = four(name).config
    time = -config.reward["time"] * config.max_steps
    for end in {"wrong_object", "wrong_target", "failed"} & set(config.reward):
        assert lacking(name) + time < config.reward["success"] - config.reward[end]


@pytest.mark.slow
@pytest.mark.parametrize("name", MOVING)
def test_potentials_never_exceed_their_declared_maximum(name):
    task, rng = four(name), np.random.default_rng(0)
    task.reset(np.array([0]), state_for(task, moment()))
    for _ in range(300):
        place, gripper = rng.uniform([0.3, -0.3, 0.02], [0.6, 0.3, 0.3], (2, 3))
        state = state_for(task, moment(place, held=int(rng.integers(-1, 2)), gripper=gripper, yaw=rng.uniform(-3, 3)))
        task.step(state)
        assert all(values[0] <= MOST[term] + 1e-9 for term, values in task._potentials(state).items())


@pytest.mark.slow
@pytest.mark.parametrize("name", MOVING)
def test_every_term_has_a_weight_of_its_sign(name):
    weights = four(name).config.reward
    assert set(weights) == set(TASKS[name].terms)
    bad = {"wrong_object", "wrong_target", "failed", "time"}
    assert all(weight < 0 if term in bad else weight > 0 for term, weight in weights.items())


@pytest.mark.slow
@pytest.mark.parametrize("name", MOVING)
def test_success_is_rewarded_once(name):
    outcomes = judged(name, way_to_success(name))
    assert [float(outcome.terms["success"][0]) for outcome in outcomes[:-1]][-1] in (0.0, 1.0)
    assert float(outcomes[-1].terms["success"][0]) == 1.0
