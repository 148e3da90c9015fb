"""Picking and placing: how high an object must be lifted, and how near its target it must be released."""

import numpy as np
import pytest

from tests.helpers.env_cases import config_of
from tests.helpers.manipulation_cases import CARRIED, GOAL, THING, UP, four, judged, moment


def test_a_release_at_the_border_earns_more_than_an_object_that_is_never_released():
    task = four("nl_pick_and_place")
    nearer = task.config.radius * task.config.reward["transport"]  # what all of the way within the radius earns
    assert task.config.reward["release"] > nearer


@pytest.mark.parametrize(("beside", "succeeds"), [(0.029, True), (0.031, False)])
def test_training_episodes_succeed_within_the_radius_of_the_curriculum(beside, succeeds):
    released = CARRIED + [moment(GOAL + [0, beside, 0])] * 4
    outcome = judged("nl_pick_and_place", released, "task.curriculum.radius=0.03")[-1]
    assert outcome.success[0] == succeeds


@pytest.mark.parametrize(("height", "share"), [(0.0, 0.0), (0.04, 0.5), (0.08, 1.0), (0.12, 1.0)])
def test_carrying_an_object_towards_its_target_earns_less_the_lower_it_is_carried(height, share):
    begin = THING + height * UP
    end = begin + (GOAL - THING) / 2
    outcome = judged("nl_pick_and_place", [moment(begin, held=0), moment(end, held=0)])[-1]
    assert outcome.terms["transport"][0] == pytest.approx(share * np.linalg.norm(end - begin), abs=1e-9)


def test_an_object_that_is_not_held_costs_nothing_on_its_way():
    outcome = judged("nl_pick_and_place", [moment(THING), moment((THING + GOAL) / 2)])[-1]
    assert outcome.terms["transport"][0] == pytest.approx(np.linalg.norm(GOAL - THING) / 2)


def test_a_radius_of_the_curriculum_makes_no_episode_easier():
    assert config_of("task=nl_pick_and_place", "task.curriculum.radius=0.08").task.success_radius == 0.05


@pytest.mark.parametrize(("given", "steps"), [(0, 3), (2, 2), (9, 3)])
def test_training_episodes_succeed_after_the_steps_of_the_curriculum_and_at_most_those_of_evaluations(given, steps):
    released = CARRIED + [moment(GOAL)] * 7
    outcomes = judged("nl_pick_and_place", released, f"task.curriculum.hold_steps={given}")
    succeeded = [bool(outcome.success[0]) for outcome in outcomes]
    assert succeeded.index(True) == len(CARRIED) + steps - 1


def test_evaluations_succeed_after_the_steps_of_the_task():
    config = config_of("task=nl_pick_and_place", "task.curriculum.hold_steps=2")
    assert config.task.success_steps == 2
    assert config.without_curriculum().task.success_steps == config.task.hold_steps == 5


@pytest.mark.parametrize(("given", "steps"), [(0, 80), (40, 40), (100, 80)])
def test_training_episodes_are_as_long_as_the_curriculum_says_and_at_most_as_evaluations(given, steps):
    config = config_of("task=nl_pick_and_place", f"task.curriculum.max_steps={given}")
    assert config.task.most_steps == steps
    assert config.without_curriculum().task.most_steps == config.task.max_steps == 80


def test_evaluations_succeed_within_the_radius_of_the_task():
    config = config_of("task=nl_pick_and_place", "task.curriculum.radius=0.03")
    assert config.task.success_radius == 0.03
    assert config.without_curriculum().task.success_radius == config.task.radius == 0.05


@pytest.mark.parametrize(
    ("place", "succeeds"), [(THING, False), (THING + 0.019 * UP, False), (THING + 0.021 * UP, True), (GOAL, True)]
)
def test_an_episode_that_begins_with_the_object_held_requires_lifting_unless_it_is_high_or_near_its_target(
    place, succeeds
):
    task = four("nl_pick_and_place")
    task.reset(np.array([0]), moment(place, held=0))
    outcomes = [task.step(each) for each in [moment(GOAL, held=0)] + [moment(GOAL)] * 4]
    assert outcomes[-1].success[0] == succeeds
