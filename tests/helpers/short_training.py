"""Short training runs on the fake environment."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any
from unittest.mock import patch

from tests.helpers.fake_env import WORDS, make_env
from tests.helpers.training_configs import config, training
from trainers.collect.worker import MakeEnv
from trainers.run.metrics import read_metrics
from trainers.run.train_loop import fit


def train(
    folder: Path,
    algo: str = "ppo",
    policy: str = "grounded",
    make: MakeEnv = make_env,
    overrides: Sequence[str] = (),
    drawn: bool = False,
    **options: Any,
) -> dict[str, Any]:
    """Train in `folder` and return the values of eval.json.

    Args:
        folder: of the run.
        algo: its algorithm.
        policy: its networks.
        make: builds the environments.
        overrides: of the config.
        drawn: whether the learning curve is drawn, which takes as long as collecting all frames of a run so short.
        options: of `fit`.
    """
    small = training(algo, policy, tuple(overrides))
    with nullcontext() if drawn else patch("trainers.reports.plots.learning_curve"):
        return fit(small, make, folder, config(algo, policy, tuple(overrides)), WORDS, **options)


def untimed_rows(folder: Path) -> list[dict[str, str]]:
    """The rows of metrics.csv without the timings."""
    rows = read_metrics(folder / "metrics.csv")
    return [{name: repr(value) for name, value in row.items() if not name.startswith("time/")} for row in rows]
