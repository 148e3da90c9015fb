"""Verbs that are drawn evenly, or by how often they have failed."""

from collections import Counter

import numpy as np
import pytest

from envs.tasks.anything import LEAST, VerbSampler

VERBS = ("lift", "stack", "open")


def sampler_after(automatic):
    """A sampler that has seen 200 instructions of each verb: every "stack" failed, and the others succeeded."""
    sampler = VerbSampler(VERBS, automatic)
    for _ in range(200):
        sampler.note(np.arange(3), np.array([True, False, True]))
    return sampler


def shares(sampler, feasible=VERBS):
    rng = np.random.default_rng(0)
    drawn = Counter(sampler.draw(feasible, rng) for _ in range(3000))
    return [drawn[verb] / 3000 for verb in feasible]


def test_without_an_automatic_curriculum_each_verb_is_drawn_as_often_whatever_failed():
    assert shares(sampler_after(automatic=False)) == pytest.approx([1 / 3] * 3, abs=0.03)


def test_a_verb_is_drawn_in_proportion_to_its_failures_and_never_left_out():
    weights = np.array([LEAST, 1 + LEAST, LEAST])
    assert shares(sampler_after(automatic=True)) == pytest.approx(weights / weights.sum(), abs=0.03)


def test_only_feasible_verbs_are_drawn():
    assert shares(sampler_after(automatic=True), ("lift", "open")) == pytest.approx([0.5, 0.5], abs=0.03)


def test_recent_outcomes_outweigh_former_ones():
    sampler = sampler_after(automatic=True)
    for _ in range(200):
        sampler.note(np.array([1]), np.array([True]))
    assert sampler.failures[1] < 0.01
