"""Figures of several runs."""

from __future__ import annotations

import pytest

from tests.helpers.run_folders import add_run, config
from trainers.reports import plots
from trainers.reports.report import write
from trainers.sweeps.runs import find_runs


def test_curves_show_evaluation_episodes_not_training_episodes(tmp_path):
    add_run(tmp_path / "0_a", config(0), (0.2, 0.6, 0.95))
    add_run(tmp_path / "1_a", config(1))
    first = plots.evaluation_curves(find_runs(tmp_path), "eval/success_at_end")[0]
    assert first.tolist() == [[100, 200, 300], [0.2, 0.6, 0.95]]


@pytest.mark.slow
def test_a_loss_that_is_always_zero_is_not_drawn(tmp_path):
    for name, loss in (("none", 0.0), ("some", 1.0)):
        add_run(tmp_path / name / "0_a", config(0), loss=loss)
        write(tmp_path / name)
    assert not (tmp_path / "none" / "losses.png").exists()
    assert (tmp_path / "some" / "losses.png").exists()


def test_a_binned_curve_averages_the_finite_values_of_each_interval(tmp_path):
    (run,) = find_runs(add_run(tmp_path / "run", config(0), (0.2, 0.6)))
    assert plots.binned_curve(run, "loss/actor").tolist() == [[50, 150], [0.1, 0.05]]
    assert plots.binned_curve(run, "loss/unknown").shape == (2, 0)
