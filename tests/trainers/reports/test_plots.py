"""Figures of one run."""

from __future__ import annotations

from types import SimpleNamespace
from unittest.mock import patch

import pytest
from matplotlib.figure import Figure

from tests.helpers.fake_env import make_env
from tests.helpers.fake_expert import EXPERT
from trainers.evaluation.evaluation import BINS, EpisodeOutcome, by_pointing, evaluate, wilson
from trainers.reports.evaluation_text import bin_name, describe
from trainers.reports.plots import learning_curve, pointing_plot

NAMES = {"task": "nl_reach", "robot": "kuka", "control": "step", "algo": "ppo"}
CONFIG = {group: {"name": name} for group, name in NAMES.items()}
CONFIG["seed"] = 3
EVALUATION = SimpleNamespace(interval_episodes=20, episodes=500)


def episode(success, **pointing):
    return EpisodeOutcome(0, success, success, False, 0.0, 1, pointing)


def test_the_figure_and_the_text_show_every_bin(tmp_path):
    ended = [episode(k % 3 > 0, angle=k, objects=2.0 + k % 7, distance=40.0 + k, stray=k / 30) for k in range(40)]
    report = evaluate(make_env(4, 0), EXPERT, 8, seed=0).as_dict()
    report["by_pointing"] = {name: [b.as_dict() for b in bins] for name, bins in by_pointing(ended).items()}
    assert set(report["by_pointing"]) == set(BINS)
    pointing_plot(report["by_pointing"], tmp_path / "all.png", "everything")
    pointing_plot({"objects": report["by_pointing"]["objects"]}, tmp_path / "one.png", "a single panel")
    assert all((tmp_path / name).stat().st_size > 5000 for name in ("all.png", "one.png"))
    text = describe(report)
    assert "angle 30+ " in text
    assert "objects 8 " in text
    assert bin_name("stray", [0.1, 0.2]) == "0.1-0.2"


def test_a_learning_curve_is_drawn_from_the_metrics(tmp_path):
    head = "frames,train/success,train/episodes,eval/success_at_end"
    rows = [head, "100,0.2,50,", "200,0.5,60,0.7", "300,0.9,70,0.8"]
    (tmp_path / "metrics.csv").write_text("\n".join(rows) + "\n")
    with patch.object(Figure, "savefig", autospec=True, side_effect=Figure.savefig) as saved:
        learning_curve(tmp_path / "metrics.csv", tmp_path / "curve.png", CONFIG, EVALUATION)
    (axes,) = saved.call_args.args[0].axes
    assert axes.get_title() == "nl_reach, kuka, step, ppo, seed 3"
    training, policy = axes.lines
    assert training.get_ydata() == pytest.approx(
        [0.2, (0.2 * 50 + 0.5 * 60) / 110, (0.5 * 60 + 0.9 * 70) / 130], abs=1e-6
    )
    assert policy.get_ydata() == pytest.approx([0.7, 0.8])
    (band,) = axes.collections
    low, high = band.get_paths()[0].vertices[:, 1].min(), band.get_paths()[0].vertices[:, 1].max()
    assert (low, high) == pytest.approx((wilson(14, 20)[0], wilson(14, 20)[1]))


def test_a_learning_curve_without_an_evaluation_is_drawn(tmp_path):
    (tmp_path / "metrics.csv").write_text("frames,train/success,train/episodes\n100,0.2,50\n")
    learning_curve(tmp_path / "metrics.csv", tmp_path / "curve.png", {}, EVALUATION)
    assert (tmp_path / "curve.png").stat().st_size > 5000
