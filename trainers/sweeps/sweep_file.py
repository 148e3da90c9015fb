"""sweep.yaml: each start of a sweep, with its time, overrides and machine."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Any

import yaml

from conf.schema import ConfigError
from trainers.utils.atomic_io import write_text
from trainers.utils.system_info import system_info

NAME = "sweep.yaml"


def read_starts(folder: Path) -> list[dict[str, Any]]:
    """The starts recorded in a sweep's directory, oldest first.

    Raises:
        ConfigError: the directory has no sweep.yaml, or a damaged one.
    """
    try:
        starts = yaml.safe_load((folder / NAME).read_text())
        return [start | {"overrides": list(start["overrides"])} for start in starts]
    except FileNotFoundError:
        raise ConfigError(f"sweep.resume={folder} is not the directory of a sweep: it has no {NAME}") from None
    except (yaml.YAMLError, TypeError, KeyError, UnicodeDecodeError):
        raise ConfigError(f"{folder / NAME} is damaged") from None


def add_start(folder: Path, overrides: list[str]) -> None:
    """Record that the sweep in `folder` starts now with these overrides. Raises ConfigError for a damaged file."""
    earlier = read_starts(folder) if (folder / NAME).exists() else []
    start = {"time": f"{datetime.now():%Y-%m-%d %H:%M:%S}", "overrides": overrides, "machine": system_info()}
    write_text(folder / NAME, yaml.safe_dump([*earlier, start], sort_keys=False))
