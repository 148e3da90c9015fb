"""Verbs that are drawn evenly, or by how often they have failed."""

from collections import Counter

import numpy as np
import pytest

from envs.tasks.verb_sampling import LEAST, VerbSampler

VERBS = ("lift", "stack", "open")
OUTCOMES = {"lift": True, "stack": False, "open": True}


def sampler_after(outcomes, automatic):
    """A sampler of one world that saw 200 instructions with each of these verbs."""
    sampler, world = VerbSampler(VERBS, 1, automatic), np.zeros(1, int)
    success = False
    for verb in [*outcomes] * 200:
        sampler.begin(world, np.array([VERBS.index(verb)]), np.array([success]))
        success = outcomes[verb]
    return sampler


def shares(sampler, feasible=VERBS):
    rng = np.random.default_rng(0)
    drawn = Counter(sampler.draw(feasible, rng) for _ in range(3000))
    return [drawn[verb] / 3000 for verb in feasible]


def test_without_an_automatic_curriculum_each_verb_is_drawn_as_often_whatever_failed():
    assert shares(sampler_after(OUTCOMES, automatic=False)) == pytest.approx([1 / 3] * 3, abs=0.03)


def test_a_verb_is_drawn_in_proportion_to_its_failures_and_never_left_out():
    weights = np.array([LEAST, 1 + LEAST, LEAST])
    assert shares(sampler_after(OUTCOMES, automatic=True)) == pytest.approx(weights / weights.sum(), abs=0.03)


def test_only_feasible_verbs_are_drawn():
    assert shares(sampler_after(OUTCOMES, automatic=True), ("lift", "open")) == pytest.approx([0.5, 0.5], abs=0.03)


def test_recent_outcomes_outweigh_former_ones():
    sampler = sampler_after(OUTCOMES, automatic=True)
    for _ in range(200):
        sampler.begin(np.zeros(1, int), np.array([1]), np.array([True]))
    assert sampler.failures[1] < 0.01
