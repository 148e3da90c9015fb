"""Folders of made-up runs with known numbers."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from trainers.evaluation.evaluation import wilson

EPISODES = 500


def config(seed: int = 0, robot: str = "kuka", control: str = "step", algo: str = "ppo", **rest: Any) -> dict[str, Any]:
    """The keys of a composed config that a report reads, and some that it must ignore."""
    named = {"robot": robot, "control": control, "algo": algo, "policy": "grounded"}
    named["task"] = rest.pop("task", "nl_reach")
    groups: dict[str, Any] = {group: {"name": name} for group, name in named.items()}
    groups["policy"]["networks"] = rest.pop("networks", 1)
    aside = {"collector": {"workers": seed, "worlds": 64}, "resume": f"somewhere/{seed}", "device": f"cuda:{seed}"}
    return {"seed": seed, **groups, **aside, **rest}


def add_run(
    folder: Path,
    values: dict[str, Any],
    curve: Sequence[float] = (0.2, 0.6, 0.95),
    success: float | None = 0.9,
    wrong: float = 0.02,
    error: str | None = None,
    loss: float = 1.0,
) -> Path:
    """A run evaluated every 100 frames, which took a second for 10 frames, and rows of training alone in between.

    curve: success in each evaluation. success: of the final one; None if the run did not get there. loss: of the
    critic, at first.
    """
    folder.mkdir(parents=True)
    (folder / "config.yaml").write_text(yaml.safe_dump(values))
    overrides = [f"{key}={values[key]}" for key in ("scenario", "seed") if key in values]
    (folder / "job.json").write_text(json.dumps({"overrides": overrides}))
    (folder / "metrics.csv").write_text("\r\n".join(_lines(curve, loss)) + "\r\n")
    if success is not None:
        interval = wilson(round(success * EPISODES), EPISODES)
        final = {"success_at_end": success, "ci95": interval, "episodes": EPISODES, "wrong_object": wrong}
        (folder / "eval.json").write_text(json.dumps(final | {"frames": 100 * len(curve), "wall_s": 10.0 * len(curve)}))
    if error is not None:
        (folder / "error.txt").write_text(error)
    return folder


def _lines(curve: Sequence[float], loss: float) -> list[str]:
    """Success while exploring is 1 all along: a report that reads it is wrong."""
    lines = ["frames,train/success,loss/actor,loss/critic,eval/success_at_end,eval/mean_return,time/total"]
    for i, success in enumerate(curve, 1):
        lines.append(f"{100 * i - 50},1.0,{0.1 * loss / i},{loss / i},,,{10 * i - 5}")
        lines.append(f"{100 * i},1.0,,{loss / i},{success},{10 * success - 2},{10 * i}")
    return lines
