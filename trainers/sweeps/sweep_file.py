"""sweep.yaml: each start of a sweep, with its time, overrides and machine."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Any

import yaml

from conf.safe_files import FileError
from conf.schema import ConfigError
from trainers.utils.checked_files import read_checked_yaml, write_checked_yaml
from trainers.utils.system_info import system_info

NAME = "sweep.yaml"
MAX_BYTES = 2**20


def read_starts(folder: Path) -> list[dict[str, Any]]:
    """The starts recorded in a sweep's directory, oldest first.

    Raises:
        ConfigError: the directory has no sweep.yaml, or a damaged one.
    """
    path = folder / NAME
    if not path.exists():
        raise ConfigError(f"sweep.resume={folder} is not the directory of a sweep: it has no {NAME}")
    try:
        starts = read_checked_yaml(path, MAX_BYTES)
    except FileError as error:
        raise ConfigError(f"{path} is damaged: it {error}") from None
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
