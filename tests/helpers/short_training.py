"""Short training runs on the fake environment."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

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
    **options: Any,
) -> dict[str, Any]:
    """Train in `folder` and return the values of eval.json. options: of `fit`."""
    small = training(algo, policy, tuple(overrides))
    return fit(small, make, folder, config(algo, policy, tuple(overrides)), WORDS, **options)


def untimed_rows(folder: Path) -> list[dict[str, str]]:
    """The rows of metrics.csv without the timings."""
    rows = read_metrics(folder / "metrics.csv")
    return [{name: repr(value) for name, value in row.items() if not name.startswith("time/")} for row in rows]
