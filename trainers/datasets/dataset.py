"""Datasets of demonstrations in other libraries' formats, with the metadata that a replay needs."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from torchrl.envs import EnvBase

from core.cameras import Camera, calibration_of
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
CAMERAS = "cameras"  # in the metadata: the calibration of each, by name; recordings of older versions lack it
NO_CAMERAS: Mapping[str, Camera] = {}


def write(
    place: Path,
    kind: str,
    env: EnvBase,
    recorded: Iterator[Demonstration],
    episodes: int,
    seed: int,
    about: dict[str, Any],
    cameras: Mapping[str, Camera] = NO_CAMERAS,
    stop: Callable[[], bool] = lambda: False,
) -> dict[str, Any]:
    """Write episodes to a new directory, which appears under its name when it is complete.

    Args:
        place: the directory.
        kind: the format, a key of `FORMATS`.
        env: of one world, like those of the episodes.
        recorded: the episodes of `demonstrate`.
        episodes: their number.
        seed: of the recording.
        about: config, actor and instruction for the metadata, and the entries that the format's writer needs.
        cameras: those whose pictures the episodes have, by name.
        stop: called after each episode; True interrupts the recording.

    Returns:
        The metadata.

    Raises:
        Interrupted: `stop` returned True.
        ConfigError: the directory exists or cannot be written, or a library is missing.
    """
    steps = successes = 0
    with atomic_directory(place) as folder:
        shapes = {name: (camera.height, camera.width, 3) for name, camera in cameras.items()}
        writer = FORMATS[kind][0](folder, place.name, env, about, shapes)
        for episode in recorded:
            writer.add(episode)
            steps, successes = steps + len(episode), successes + episode.success
            if stop():
                raise Interrupted
        writer.finish()
        share = {"success_at_end": successes / episodes, "ci95": list(wilson(successes, episodes))}
        values: dict[str, Any] = about | share | {"kind": kind, "seed": seed, "episodes": episodes, "steps": steps}
        metadata = {name: values[name] for name in METADATA_KEYS}
        metadata[CAMERAS] = {name: calibration_of(camera) for name, camera in cameras.items()}
        write_json(folder / METADATA, metadata)
    return metadata


def read(folder: str | Path, cameras: Sequence[str] = ()) -> tuple[dict[str, Any], Iterator[Demonstration]]:
    """Return the metadata and the episodes of a recording, with the pictures of these cameras.

    Raises ConfigError for a missing or damaged recording, and for a camera that it lacks.
    """
    folder = Path(folder)
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
    known = metadata.setdefault(CAMERAS, {})
    if not isinstance(known, dict):
        raise ConfigError(f"{file} is damaged: its {CAMERAS} are no group of names")
    for name in cameras:
        if name not in known:
            has = did_you_mean(name, known) if known else ": it has no pictures"
            raise ConfigError(f"cameras=[{','.join(cameras)}]: {folder} has no camera {name}{has}")
    return metadata, _whole(folder, FORMATS[metadata["kind"]][1](folder, cameras))


def _whole(folder: Path, episodes: Iterator[Demonstration]) -> Iterator[Demonstration]:
    """Yield the episodes. Raises ConfigError for a file that cannot be read."""
    try:
        yield from episodes
    except ConfigError:
        raise
    except Exception as error:  # pyarrow, h5py, Minari, PIL and json raise many types for a bad file
        reason = (str(error).splitlines() or [type(error).__name__])[0][:200]
        raise ConfigError(f"{folder} is damaged: {reason}") from None
