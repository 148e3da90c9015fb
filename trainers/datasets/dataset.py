"""Datasets of demonstrations in other libraries' formats, with the metadata that a replay needs."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from torchrl.envs import EnvBase

from core.errors import ConfigError, Interrupted, did_you_mean
from core.stored_config import config_from_file
from trainers.datasets.demonstrations import Demonstration
from trainers.datasets.lerobot_dataset import LeRobotWriter, read_lerobot
from trainers.datasets.minari_dataset import MinariWriter, read_minari
from trainers.evaluation.evaluation import wilson
from trainers.utils.files import atomic_directory, write_json

FORMATS: dict[str, Any] = {"lerobot": (LeRobotWriter, read_lerobot), "minari": (MinariWriter, read_minari)}
METADATA = "deixis.json"  # beside the files of the format
METADATA_KEYS = ("kind", "config", "actor", "instruction", "seed", "episodes", "steps", "success_at_end", "ci95")


def write(
    place: Path,
    kind: str,
    env: EnvBase,
    recorded: Iterator[Demonstration],
    episodes: int,
    seed: int,
    about: dict[str, Any],
    images: bool = False,
    stop: Callable[[], bool] = lambda: False,
) -> dict[str, Any]:
    """Write episodes to a new directory, which appears under its name when it is complete.

    Args:
        place: the directory.
        kind: the format, a key of `FORMATS`.
        env: of one world, like those of the episodes; built for rendering if images are recorded.
        recorded: the episodes of `demonstrate`.
        episodes: their number.
        seed: of the recording.
        about: config, actor and instruction for the metadata, and the entries that the format's writer needs.
        images: whether to record camera images.
        stop: called after each episode; True interrupts the recording.

    Returns:
        The metadata.

    Raises:
        Interrupted: `stop` returned True.
        ConfigError: the directory exists or cannot be written, or a library is missing.
    """
    steps = successes = 0
    with atomic_directory(place) as folder:
        shape = env.render().shape if images else None
        writer = FORMATS[kind][0](folder, place.name, env, about, shape)
        for episode in recorded:
            writer.add(episode)
            steps, successes = steps + len(episode), successes + episode.success
            if stop():
                raise Interrupted
        writer.finish()
        share = {"success_at_end": successes / episodes, "ci95": list(wilson(successes, episodes))}
        values: dict[str, Any] = about | share | {"kind": kind, "seed": seed, "episodes": episodes, "steps": steps}
        metadata = {name: values[name] for name in METADATA_KEYS}
        write_json(folder / METADATA, metadata)
    return metadata


def read(folder: Path) -> tuple[dict[str, Any], Iterator[Demonstration]]:
    """Return the metadata and the episodes of a recording. Raises ConfigError for a missing or damaged one."""
    file = folder / METADATA
    if not file.is_file():
        problem = f"is not a recording of this project: it has no {METADATA}" if folder.exists() else "does not exist"
        raise ConfigError(f"{folder} {problem}")
    try:
        metadata = json.loads(file.read_text())
        missing = [name for name in METADATA_KEYS if name not in metadata]
    except (ValueError, TypeError):
        raise ConfigError(f"{file} is damaged") from None
    if missing:
        raise ConfigError(f"{file} is damaged: it has no {', '.join(missing)}")
    if metadata["kind"] not in FORMATS:
        raise ConfigError(f"{file}: kind={metadata['kind']} is not known" + did_you_mean(metadata["kind"], FORMATS))
    metadata["config"] = config_from_file(metadata["config"], file)
    return metadata, FORMATS[metadata["kind"]][1](folder)
