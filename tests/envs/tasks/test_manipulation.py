"""Outcomes of tasks that move objects: success, the wrong object, the wrong target, and other failures."""

import pickle

import numpy as np
import pytest

from tests.helpers.manipulation_cases import (
    AWAY,
    BOARD,
    DONE,
    MOVING,
    OTHER,
    THING,
    ends,
    four,
    judged,
    moment,
    state_for,
)


@pytest.mark.slow
@pytest.mark.parametrize("what", DONE)
def test_each_course_of_events_has_its_outcome(what):
    names, moments, end = DONE[what]
    for name in names:
        outcomes = judged(name, moments)
        assert ends(outcomes) == ([end] if end else []), name


@pytest.mark.slow
@pytest.mark.parametrize("name", MOVING)
def test_another_object_moved_by_5_cm_or_half_a_cell_is_the_wrong_object(name):
    bound = 0.01875 if name in BOARD else 0.05
    for moved, end in ((bound - 0.001, []), (bound + 0.001, ["wrong_object"])):
        assert ends(judged(name, [moment(other=OTHER + [0, moved, 0])])) == end


@pytest.mark.slow
@pytest.mark.parametrize("what", DONE)
def test_evaluating_a_state_changes_no_memory(what):
    names, moments, _ = DONE[what]
    task = four(names[0])
    task.reset(np.array([0]), state_for(task, moment()))
    for each in moments:
        state = state_for(task, each)
        outcome, memory = task.step(state), pickle.dumps(vars(task))
        for _ in range(2):
            again = task._outcome(state)
            assert again.terms == outcome.terms
            task._at_goal(state), task._potentials(state), task.stage(state), task.seen(state), task.memory
        assert pickle.dumps(vars(task)) == memory


@pytest.mark.slow
@pytest.mark.parametrize("name", MOVING)
def test_an_episode_without_motion_does_not_terminate(name):
    assert ends(judged(name, [moment()] * 10)) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", MOVING)
def test_a_reset_clears_the_memory_of_the_task(name):
    plain = name.removeprefix("nl_")
    moments = next(
        moments
        for names, moments, end in DONE.values()
        if plain in [each.removeprefix("nl_") for each in names] and end == "success"
    )
    task = four(name)
    first = state_for(task, moment())
    task.reset(np.array([0]), first)
    assert [task.step(state_for(task, each)) for each in moments][-1].success[0]
    task.reset(np.array([0]), first)
    after = task.step(first)
    assert not after.success[0]
    assert not after.at_goal[0]
    assert all(float(after.terms[term][0]) == 0 for term in task.potentials)


@pytest.mark.slow
@pytest.mark.parametrize("name", MOVING)
def test_moving_to_and_fro_earns_no_reward(name):
    task, rng = four(name), np.random.default_rng(0)
    loop = [
        moment(THING + 0.01 * rng.uniform(-1, 1, 3) * [1, 1, 0], gripper=AWAY + 0.1 * rng.uniform(-1, 1, 3))
        for _ in range(20)
    ]
    task.reset(np.array([0]), state_for(task, moment()))
    terms = [task.step(state_for(task, each)).terms for each in [*loop, moment()]]
    for term in task.potentials:
        assert sum(float(each[term][0]) for each in terms) == pytest.approx(0, abs=1e-9)
