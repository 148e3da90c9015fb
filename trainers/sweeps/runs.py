"""The records that sweeps and runs leave in their folders: sweep.yaml, config.yaml, job.json, eval.json, metrics.csv.

`find_runs` reads them, `group_by_configuration` compares them, and `overrides_of` says how to repeat one.
"""

from __future__ import annotations

import json
import math
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import yaml

from core.errors import ConfigError
from core.overrides import compose, groups
from core.path_keys import PATH_KEYS
from core.safe_files import FileError, check_plain, read_bytes
from core.system import system_info
from trainers.run.metrics import read_metrics
from trainers.utils.files import read_checked_json, read_checked_yaml, write_checked_yaml

NAME = "sweep.yaml"
SWEEP_FILE_BYTES = 2**20


FIRST = ("scenario", "task")  # their options choose options of other groups
# Keys that do not identify a configuration: the seed, and how or on what hardware it was run. `choices` repeats values.
NOT_CONFIGURATION = (
    "seed",
    "resume",
    "sweep",
    "device",
    "logger",
    "update_threads",
    "eval",
    "collector.name",
    "collector.workers",
    "collector.address",
    "collector.cpus",
    "collector.dashboard",
    "choices",
)
NAME_KEYS = ("scenario", "robot.name", "control.name", "task.name", "algo.name", "policy.name")  # they name a group
RESULT_KEYS = ("success_at_end", "ci95", "episodes", "wrong_object", "frames", "wall_s")  # required in eval.json
CONFIG_KEYS = ("robot", "control", "task", "policy", "algo")  # required in config.yaml
MAX_BYTES = 256 * 1024  # of a record of a run


@dataclass(frozen=True)
class RunRecord:
    """The files that a run has left in its folder.

    config: as composed; empty if the run was refused. overrides: of a sweep's job; empty otherwise. result: eval.json;
    None if the run has not finished. error: why it failed, if it did.
    """

    folder: Path
    config: dict[str, Any]
    overrides: list[str]
    result: dict[str, Any] | None
    error: str | None

    @cached_property
    def rows(self) -> list[dict[str, float]]:
        """metrics.csv. Raises ConfigError for a damaged file, and for one that ends before its run."""
        path, wanted = self.folder / "metrics.csv", (self.result or {}).get("frames")
        rows = read_metrics(path)
        if rows and wanted is not None and rows[-1]["frames"] < wanted:
            raise ConfigError(f"{path} is damaged: it ends at frames={rows[-1]['frames']:.0f} of {wanted}")
        return rows

    @property
    def evaluations(self) -> list[dict[str, float]]:
        """The rows with an evaluation of the deterministic policy."""
        return [row for row in self.rows if row.get("eval/success_at_end", float("nan")) >= 0]

    @property
    def seed(self) -> Any:
        """The run's seed; None if the run was refused."""
        return self.config.get("seed")

    @property
    def reason(self) -> str:
        """The last line of `error`: of a traceback, the exception."""
        return (self.error or "").strip().splitlines()[-1]

    @property
    def status(self) -> str:
        """How the run ended, if it has not finished."""
        return f"failed: {self.reason}" if self.error else "not finished"

    @property
    def command(self) -> str:
        """The command that repeats this run alone; "-" if its overrides are not known."""
        return command_line(self.overrides) if self.overrides else "-"


def find_runs(folder: Path) -> list[RunRecord]:
    """Return the runs in a directory: the directory itself, those in it, and those of sweeps in it.

    Raises:
        ConfigError: it is not a directory, holds no runs, or holds damaged files.
    """
    if not folder.is_dir():
        raise ConfigError(f"{folder} is not a directory" if folder.exists() else f"{folder} does not exist")
    names = ("config.yaml", "job.json")
    files = [file for depth in ("", "*/", "*/*/") for name in names for file in folder.glob(depth + name)]
    places = sorted({file.parent for file in files}, key=_job_number)
    if not places:
        raise ConfigError(f"{folder} holds no runs: there is no config.yaml in it, nor in the directories in it")
    return [_load(place) for place in places]


def _job_number(place: Path) -> tuple[Any, ...]:
    """Sort the jobs of a sweep by their numbers."""
    number = place.name.partition("_")[0]
    return (str(place.parent), int(number) if number.isdigit() else -1, place.name)


def _load(place: Path) -> RunRecord:
    result, error = place / "eval.json", place / "error.txt"
    return RunRecord(
        place,
        config=read_config(place),
        overrides=read_overrides(place),
        result=read_result(place) if result.exists() else None,
        error=_read_error(error) if error.exists() else None,
    )


def read_config(place: Path) -> dict[str, Any]:
    """Return the config of the run in `place`; {} if it was refused. Raises ConfigError for a damaged config.yaml."""
    file = place / "config.yaml"
    values = _read_mapping(file, CONFIG_KEYS if file.exists() else ())
    try:
        check_plain(values)
    except FileError as error:
        raise _damaged(file, error) from None
    return values


def read_overrides(place: Path) -> list[str]:
    """Return the overrides of the job in `place`; [] if it is no job. Raises ConfigError for a damaged job.json."""
    file = place / "job.json"
    words = _read_mapping(file, ("overrides",) if file.exists() else ()).get("overrides", [])
    if not isinstance(words, list) or not all(isinstance(word, str) for word in words):
        raise ConfigError(f"{file} is damaged: overrides={words} must be a list of key=value")
    return words


def read_result(place: Path) -> dict[str, Any]:
    """Return the result of the run in `place`. Raises ConfigError for a damaged eval.json."""
    values = _read_mapping(place / "eval.json", RESULT_KEYS)
    numbers = [*(values[name] for name in RESULT_KEYS if name != "ci95"), *_pair(values["ci95"])]
    if not all(type(number) in (int, float) and math.isfinite(number) for number in numbers):
        raise ConfigError(f"{place / 'eval.json'} is damaged: {', '.join(RESULT_KEYS)} must be numbers")
    return values


def _pair(values: Any) -> list[Any]:
    return values if isinstance(values, list) and len(values) == 2 else [None]


def _read_error(file: Path) -> str:
    try:
        return read_bytes(file, MAX_BYTES).decode(errors="replace").strip() or "unknown"
    except FileError as error:
        return f"unknown: {file.name} {error}"


def _read_mapping(file: Path, required: Sequence[str] = ()) -> dict[str, Any]:
    """Return the mapping in a YAML or JSON file; {} if there is no file. Raises ConfigError."""
    if not file.exists():
        return {}
    try:
        values = read_checked_json(file) if file.suffix == ".json" else read_checked_yaml(file, MAX_BYTES)
    except FileError as error:
        raise _damaged(file, error) from None
    if not isinstance(values, dict) or not values:
        raise ConfigError(f"{file} is damaged: it holds no keys")
    missing = [name for name in required if name not in values]
    if missing:
        raise ConfigError(f"{file} is damaged: it has no {', '.join(missing)}")
    return values


def _damaged(file: Path, error: FileError) -> ConfigError:
    said = str(error).startswith("is damaged")
    return ConfigError(f"{file} {error}" if said else f"{file} is damaged: it {error}")


def read_starts(folder: Path) -> list[dict[str, Any]]:
    """Return the starts recorded in a sweep's directory, oldest first.

    Raises:
        ConfigError: the directory has no sweep.yaml, or a damaged one.
    """
    path = folder / NAME
    if not path.exists():
        raise ConfigError(f"sweep.resume={folder} is not the directory of a sweep: it has no {NAME}")
    try:
        starts = read_checked_yaml(path, SWEEP_FILE_BYTES)
    except FileError as error:
        raise _damaged(path, error) from None
    if not isinstance(starts, list) or not starts or not all(_is_start(start) for start in starts):
        raise ConfigError(f"{path} is damaged: it is no list of starts with their overrides")
    return starts


def _is_start(start: Any) -> bool:
    words = start.get("overrides") if isinstance(start, dict) else None
    machine = start.get("machine", {}) if isinstance(start, dict) else None
    return isinstance(words, list) and all(isinstance(word, str) for word in words) and isinstance(machine, dict)


def add_start(folder: Path, overrides: list[str]) -> None:
    """Record that the sweep in `folder` starts now with these overrides. Raises ConfigError for a damaged file."""
    earlier = read_starts(folder) if (folder / NAME).exists() else []
    start = {"time": f"{datetime.now():%Y-%m-%d %H:%M:%S}", "overrides": overrides, "machine": system_info()}
    write_checked_yaml(folder / NAME, yaml.safe_dump([*earlier, start], sort_keys=False))


def overrides_of(config: Mapping[str, Any]) -> list[str]:
    """Return the words after `python train.py` that compose this config, without `NOT_CONFIGURATION`.

    Args:
        config: a composed config as plain values, or groups of it, with the option of each group under `choices`.

    Returns:
        Options first, then each key whose value differs from that of the options.

    Raises:
        ConfigError: the config has no `choices`, or one of its options no longer exists.
    """
    if "choices" not in config:
        raise ConfigError("the config was saved by an earlier version, which did not record the options of its groups")
    words: list[str] = []
    for group in (*FIRST, *(name for name in groups() if name not in FIRST)):
        if group not in config:  # the groups of an environment alone
            continue
        option = config["choices"].get(group)  # None: the config is older than the group
        if option is not None and _composed(words)["choices"][group] != option:
            words.append(f"{group}={option}")
    defaults = dict(flatten(_composed(words)))
    values = flatten(config)
    return words + [_word(key, value) for key, value in values if defaults.get(key) != value]


def _composed(words: list[str]) -> dict[str, Any]:
    return _composed_once(tuple(words))


@lru_cache(maxsize=64)
def _composed_once(words: tuple[str, ...]) -> dict[str, Any]:
    from omegaconf import OmegaConf

    plain: Any = OmegaConf.to_container(compose(words), resolve=True)
    return plain


def _hydra_value(value: Any) -> str:
    """Return a plain value in Hydra's override syntax."""
    if isinstance(value, list):
        return f"[{','.join(map(_hydra_value, value))}]"
    if isinstance(value, str) and re.fullmatch(r"[A-Za-z][\w.-]*", value) and value not in ("true", "false", "null"):
        return value
    return json.dumps(value)


def _word(key: str, value: Any) -> str:
    """Return the override that gives a key this value."""
    return f"{key}={value if key in PATH_KEYS and isinstance(value, str) else _hydra_value(value)}"


def share_cell(share: float | None) -> str:
    """Return a share in a table; "-" where it was not measured."""
    return "-" if share is None else f"{share:.3f}"


def command_line(overrides: Sequence[str], *flags: str) -> str:
    """Return the shell command that runs train.py with these overrides and flags."""
    return shlex.join(["python", "train.py", *flags, *map(unquote_numbers, overrides)])


def unquote_numbers(override: str) -> str:
    """Return an override without the quotes that Hydra requires around an option that is a number."""
    return re.sub(r"'(\d+)'", r"\1", override)


def distinct_overrides(overrides: Sequence[Sequence[str]]) -> list[str]:
    """Return a name for each list of overrides: the overrides that not all lists contain."""
    common = set.intersection(*map(set, overrides)) if len(overrides) > 1 else set()
    return [" ".join(unquote_numbers(w) for w in words if w not in common) or "default" for words in overrides]


def group_by_configuration(runs: Sequence[RunRecord]) -> dict[str, list[RunRecord]]:
    """Run that have the same configuration except for the seed, by a label of the configuration.

    A label names what differs between the groups: robot, control, task, algo and policy, and few other keys.
    """
    flat = [dict(flatten(run.config)) for run in runs]
    keys = distinguishing_keys(flat)
    grouped: dict[str, list[RunRecord]] = {}
    for run, values in zip(runs, flat, strict=True):
        grouped.setdefault(label(keys, values), []).append(run)
    return grouped


def flatten(config: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """Return the values of a nested config with their dotted keys.

    Excludes keys that do not identify a configuration.
    """
    items: list[tuple[str, Any]] = []
    for name, value in config.items():
        key = f"{prefix}{name}"
        if key in NOT_CONFIGURATION:
            continue
        items += flatten(value, f"{key}.") if isinstance(value, dict) else [(key, value)]
    return items


def distinguishing_keys(configs: Sequence[Mapping[str, Any]]) -> list[str]:
    """Keys that split the configs into as many groups as all keys do: first `NAME_KEYS`, then others as needed."""
    chosen = [key for key in NAME_KEYS if _count_groups(configs, [key]) > 1]
    for key in sorted({key for config in configs for key in config} - set(NAME_KEYS)):
        if _count_groups(configs, [*chosen, key]) > _count_groups(configs, chosen):
            chosen.append(key)
    return chosen


def _count_groups(configs: Sequence[Mapping[str, Any]], keys: Sequence[str]) -> int:
    return len({repr([config.get(key) for key in keys]) for config in configs})


def label(keys: Sequence[str], values: Mapping[str, Any]) -> str:
    """Return the label of a configuration: "2: kuka step ppo", "panda joints sac", "kuka step ppo, policy.networks=2".

    Args:
        keys: those that distinguish the configurations.
        values: of one configuration, flat.
    """
    scenario = values.get("scenario") if "scenario" in keys else None
    names = {"robot.name", "control.name", "algo.name"} if "scenario" in keys else set(NAME_KEYS) & set(keys)
    names = names or {"robot.name", "control.name", "task.name", "algo.name"}
    named = [key for key in NAME_KEYS[1:] if key in {*names, *keys}]
    head = " ".join(str(values.get(key, "-")) for key in named)
    rest = [f"{key}={values.get(key)}" for key in keys if key not in NAME_KEYS]
    return (f"{scenario}: " if scenario else "") + ", ".join(part for part in (head, *rest) if part)
