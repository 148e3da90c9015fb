"""The runs that a directory holds: what each was told, what it measured, and how it ended."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml

from conf.schema import ConfigError
from trainers.run.metrics import read_metrics

# What does not make another configuration of a run: the seed, and how or on what it was run.
ASIDE = ("seed", "resume", "sweep", "device", "logger", "update_threads", "eval", "collector.workers")
FIRST = ("scenario", "robot.name", "control.name", "task.name", "algo.name", "policy.name")  # what groups are named by
NEEDED = ("success_at_end", "ci95", "episodes", "wrong_object", "frames", "wall_s")


@dataclass(frozen=True)
class Run:
    """config: as composed; empty where the run was refused. result: eval.json; None where the run has not finished."""

    folder: Path
    config: dict[str, Any]
    overrides: list[str]
    result: dict[str, Any] | None
    error: str | None

    @cached_property
    def rows(self) -> list[dict[str, float]]:
        """metrics.csv. Raises ConfigError where it is damaged."""
        return read_metrics(self.folder / "metrics.csv")

    @property
    def evaluated(self) -> list[dict[str, float]]:
        """The rows in which the deterministic policy was judged on fresh episodes."""
        return [row for row in self.rows if row.get("eval/success_at_end", float("nan")) >= 0]

    @property
    def seed(self) -> Any:
        return self.config.get("seed")

    @property
    def reason(self) -> str:
        """The line of `error` that says most: a traceback's last one."""
        return (self.error or "").strip().splitlines()[-1]

    @property
    def ending(self) -> str:
        """How it ended, where it did not finish."""
        return f"failed: {self.reason}" if self.error else "not finished"

    @property
    def command(self) -> str:
        """What one types to get this run by itself; "-" where nothing tells."""
        return typed(self.overrides) if self.overrides else "-"


def find_runs(folder: Path) -> list[Run]:
    """The runs in a directory: itself, those in it, and those of the sweeps in it. Raises ConfigError."""
    if not folder.is_dir():
        raise ConfigError(f"{folder} is not a directory" if folder.exists() else f"{folder} does not exist")
    names = ("config.yaml", "job.json")
    files = [file for depth in ("", "*/", "*/*/") for name in names for file in folder.glob(depth + name)]
    places = sorted({file.parent for file in files}, key=_order)
    if not places:
        raise ConfigError(f"{folder} holds no runs: there is no config.yaml in it, nor in the directories in it")
    return [_load(place) for place in places]


def _order(place: Path) -> tuple[Any, ...]:
    """Jobs of a sweep by their numbers."""
    number = place.name.partition("_")[0]
    return (str(place.parent), int(number) if number.isdigit() else -1, place.name)


def _load(place: Path) -> Run:
    result, error = place / "eval.json", place / "error.txt"
    return Run(
        place,
        config=_mapping(place / "config.yaml"),
        overrides=list(_mapping(place / "job.json").get("overrides", [])),
        result=_mapping(result, NEEDED) if result.is_file() else None,
        error=(error.read_text(errors="replace").strip() or "unknown") if error.is_file() else None,
    )


def _mapping(file: Path, needed: Sequence[str] = ()) -> dict[str, Any]:
    """What a YAML or JSON file holds, {} where there is none. Raises ConfigError."""
    if not file.is_file():
        return {}
    try:
        text = file.read_text()
        known = json.loads(text) if file.suffix == ".json" else yaml.safe_load(text) or {}
        missing = [name for name in needed if name not in known]
    except (ValueError, TypeError, yaml.YAMLError):
        raise ConfigError(f"{file} is damaged") from None
    if not isinstance(known, dict) or missing:
        raise ConfigError(f"{file} is damaged" + f": it has no {', '.join(missing)}" * bool(missing))
    return known


def typed(overrides: Sequence[str], *flags: str) -> str:
    """A command as a person types it in a shell."""
    return shlex.join(["python", "train.py", *flags, *map(plain, overrides)])


def plain(override: str) -> str:
    """An override without the quotes that Hydra wants about an option that is a number."""
    return re.sub(r"'(\d+)'", r"\1", override)


def differing(overrides: Sequence[Sequence[str]]) -> list[str]:
    """Each list of overrides as words, without those that all of them have."""
    everywhere = set.intersection(*map(set, overrides)) if len(overrides) > 1 else set()
    return [" ".join(plain(word) for word in words if word not in everywhere) or "default" for words in overrides]


def groups(runs: Sequence[Run]) -> dict[str, list[Run]]:
    """Runs of the same configuration but for the seed, by a label that tells them from the others.

    The label names what differs: robot, control, task, algo and policy, and of other keys as few as it takes.
    """
    flat = [dict(flatten(run.config)) for run in runs]
    keys = telling(flat)
    found: dict[str, list[Run]] = {}
    for run, values in zip(runs, flat, strict=True):
        found.setdefault(label(keys, values), []).append(run)
    return found


def flatten(config: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """Every value of a nested config with its dotted key, but for those `ASIDE`."""
    out: list[tuple[str, Any]] = []
    for name, value in config.items():
        key = f"{prefix}{name}"
        if key in ASIDE:
            continue
        out += flatten(value, f"{key}.") if isinstance(value, dict) else [(key, value)]
    return out


def telling(configs: Sequence[Mapping[str, Any]]) -> list[str]:
    """Keys by which the configs fall into as many groups as by all keys: names that differ, and what else it takes."""
    chosen = [key for key in FIRST if _count(configs, [key]) > 1]
    for key in sorted({key for config in configs for key in config} - set(FIRST)):
        if _count(configs, [*chosen, key]) > _count(configs, chosen):
            chosen.append(key)
    return chosen


def _count(configs: Sequence[Mapping[str, Any]], keys: Sequence[str]) -> int:
    return len({repr([config.get(key) for key in keys]) for config in configs})


def label(keys: Sequence[str], values: Mapping[str, Any]) -> str:
    """ "2: kuka step ppo", "panda joints sac", "kuka step ppo, policy.networks=2"."""
    scenario = values.get("scenario") if "scenario" in keys else None
    names = {"robot.name", "control.name", "algo.name"} if "scenario" in keys else set(FIRST) & set(keys)
    names = names or {"robot.name", "control.name", "task.name", "algo.name"}
    named = [key for key in FIRST[1:] if key in {*names, *keys}]
    head = " ".join(str(values.get(key, "-")) for key in named)
    rest = [f"{key}={values.get(key)}" for key in keys if key not in FIRST]
    return (f"{scenario}: " if scenario else "") + ", ".join(part for part in (head, *rest) if part)
