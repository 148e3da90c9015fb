"""Picking and placing: how near its target an object must be released, in training and in evaluations."""

import numpy as np
import pytest

from tests.helpers.env_cases import config_of
from tests.helpers.manipulation_cases import CARRIED, GOAL, LEFT, UP, four, judged, moment, state_for


def test_a_release_at_the_border_earns_more_than_an_object_that_is_never_released():
    task = four("nl_pick_and_place")
    nearer = task.config.radius * task.config.reward["transport"]  # what all of the way within the radius earns
    assert task.config.reward["release"] > nearer


@pytest.mark.parametrize(("beside", "succeeds"), [(0.029, True), (0.031, False)])
def test_training_episodes_succeed_within_the_radius_of_the_curriculum(beside, succeeds):
    released = CARRIED + [moment(GOAL + [0, beside, 0])] * 4
    outcome = judged("nl_pick_and_place", released, "task.curriculum.radius=0.03")[-1]
    assert outcome.success[0] == succeeds


@pytest.mark.parametrize(("height", "share"), [(0.0, 1.0), (0.05, 1.0), (0.075, 0.5), (0.11, 0.0)])
def test_a_release_counts_by_how_near_its_target_the_object_was_let_go(height, share):
    """A policy that drops objects on the way to their targets earns less, although they may come to rest there."""
    carried = [*CARRIED[:-1], moment(GOAL + height * UP, held=0)]
    outcomes = judged("nl_pick_and_place", [*carried, *LEFT])
    assert sum(each.terms["release"][0] for each in outcomes) == pytest.approx(share)
    assert outcomes[-1].success[0]


def test_an_episode_that_begins_with_the_object_at_its_target_has_the_whole_release():
    task = four("nl_pick_and_place")
    task.reset(np.array([0]), state_for(task, moment(GOAL)))
    assert task._potentials(state_for(task, moment(GOAL)))["release"] == 1.0


def test_a_radius_of_the_curriculum_makes_no_episode_easier():
    assert config_of("task=nl_pick_and_place", "task.curriculum.radius=0.08").task.success_radius == 0.05


def test_evaluations_succeed_within_the_radius_of_the_task():
    config = config_of("task=nl_pick_and_place", "task.curriculum.radius=0.03")
    assert config.task.success_radius == 0.03
    assert config.without_curriculum().task.success_radius == config.task.radius == 0.05
