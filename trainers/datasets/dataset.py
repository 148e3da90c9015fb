"""A directory of demonstrations in a format of others, and what it takes to play them again."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from torchrl.envs import EnvBase

from conf.schema import ConfigError, did_you_mean
from trainers.datasets.demonstrations import Actor, Demonstration, demonstrate
from trainers.datasets.lerobot_dataset import LeRobotWriter, read_lerobot
from trainers.datasets.minari_dataset import MinariWriter, read_minari
from trainers.rollout.evaluation import Interrupted, wilson
from trainers.utils.atomic_io import atomic_directory, write_json

FORMATS: dict[str, Any] = {"lerobot": (LeRobotWriter, read_lerobot), "minari": (MinariWriter, read_minari)}
ABOUT = "deixis.json"  # beside the format's own files
KEPT = ("kind", "config", "actor", "instruction", "seed", "episodes", "steps", "success_at_end", "ci95")


def write(
    place: Path,
    kind: str,
    env: EnvBase,
    actor: Actor,
    episodes: int,
    seed: int,
    about: dict[str, Any],
    pictures: bool = False,
    stop: Callable[[], bool] = lambda: False,
) -> dict[str, Any]:
    """Write so many episodes to the new directory `place`; what `ABOUT` holds of them. Nothing is there before the end.

    kind: of `FORMATS`. env: of one world. about: of `KEPT` config, actor and instruction, and what the format's writer
    asks for. stop: asked at each episode; raises Interrupted once it says so. Raises ConfigError.
    """
    steps = successes = 0
    with atomic_directory(place) as folder:
        shape = env.render().shape if pictures else None
        writer = FORMATS[kind][0](folder, place.name, env, about, shape)
        for episode in demonstrate(env, actor, episodes, seed, pictures):
            writer.add(episode)
            steps, successes = steps + len(episode), successes + episode.success
            if stop():
                raise Interrupted
        writer.finish()
        share = {"success_at_end": successes / episodes, "ci95": list(wilson(successes, episodes))}
        known: dict[str, Any] = about | share | {"kind": kind, "seed": seed, "episodes": episodes, "steps": steps}
        told = {name: known[name] for name in KEPT}
        write_json(folder / ABOUT, told)
    return told


def read(folder: Path) -> tuple[dict[str, Any], Iterator[Demonstration]]:
    """What `ABOUT` holds, and the episodes. Raises ConfigError."""
    file = folder / ABOUT
    if not file.is_file():
        why = f"is no recording of ours: it has no {ABOUT}" if folder.exists() else "does not exist"
        raise ConfigError(f"{folder} {why}")
    try:
        about = json.loads(file.read_text())
        missing = [name for name in KEPT if name not in about]
    except (ValueError, TypeError):
        raise ConfigError(f"{file} is damaged") from None
    if missing:
        raise ConfigError(f"{file} is damaged: it has no {', '.join(missing)}")
    if about["kind"] not in FORMATS:
        raise ConfigError(f"{file}: kind={about['kind']} is not known" + did_you_mean(about["kind"], FORMATS))
    return about, FORMATS[about["kind"]][1](folder)
