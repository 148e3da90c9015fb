"""Statistics over seeds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.helpers.run_folders import add_run, config
from trainers.reports.scores import bootstrap, final_over_best, iqm, result_of, score, time_to_level
from trainers.sweeps.runs import find_runs


def test_the_interquartile_mean_leaves_out_a_quarter_at_each_end():
    assert iqm(np.array([0.0, 0.5, 0.7, 1.0])) == pytest.approx(0.6)
    assert iqm(np.array([0.0, 0.3, 0.9])) == pytest.approx(0.4)
    assert iqm(np.array([[8.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0], [1.0] * 8])) == pytest.approx([4.5, 1.0])


def test_the_bootstrap_interval_has_the_width_of_resampled_seeds():
    assert bootstrap([[0.9, 0.9, 0.9]]) == pytest.approx((0.9, 0.9))
    low, high = bootstrap([[0.0, 1.0]])  # each end has a chance of a quarter
    assert (low, high) == (0.0, 1.0)
    rng = np.random.default_rng(3)
    scores = rng.normal(size=100)
    low, high = bootstrap([scores])
    assert low < iqm(scores) < high
    assert high - low == pytest.approx(2 * 1.96 * 1.1 / 10, rel=0.3)  # a trimmed mean of a hundred normal scores
    assert bootstrap([scores]) == (low, high)


def test_the_bootstrap_resamples_seeds_within_each_configuration():
    """Values between 0 and 1 come only from the shares of the configurations."""
    assert bootstrap([[0.0] * 4, [1.0] * 4]) == pytest.approx((0.5, 0.5))


def test_time_to_level_is_that_of_the_first_evaluation_at_the_level(tmp_path):
    (run,) = find_runs(add_run(tmp_path / "run", config(), (0.2, 0.9, 0.5, 0.95)))
    assert time_to_level(run.evaluations, 0.9) == (200, 20)
    assert time_to_level(run.evaluations, 0.95) == (400, 40)
    assert time_to_level(run.evaluations, 0.99) == (math.inf, math.inf)


def test_final_over_best_of_a_score_is_the_minimum_over_seeds(tmp_path):
    add_run(tmp_path / "0_a", config(0), (0.2, 1.0, 0.7), success=0.8)
    add_run(tmp_path / "1_a", config(1), (0.2, 0.5), success=0.5)
    add_run(tmp_path / "2_a", config(2), (0.0, 0.0), success=0.0)
    runs = find_runs(tmp_path)
    assert [final_over_best(run) for run in runs[:2]] == pytest.approx([0.8, 1.0])
    assert math.isnan(final_over_best(runs[2]))
    assert score(runs).final_over_best == pytest.approx(0.8)


def test_an_unfinished_run_has_no_result(tmp_path):
    (run,) = find_runs(add_run(tmp_path / "run", config(), success=None))
    with pytest.raises(ValueError, match="has not finished"):
        result_of(run)
