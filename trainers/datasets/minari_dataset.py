"""Demonstrations as a Minari dataset, and back: https://minari.farama.org.

Observations are a Dict of `Demonstration.seen`, and of "camera" where there are pictures (which Minari keeps as JPEG);
infos hold the slots that are meant, and whether the step ended in success. Each episode has its seed, its sentence and
its success as metadata. Minari gives the environment back (`recover_environment`) where its Gymnasium spec is known.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from torchrl.data import Binary, Bounded
from torchrl.envs import EnvBase

from trainers.datasets.demonstrations import SEEN, Demonstration
from trainers.utils.optional_imports import import_optional

CAMERA = "camera"


class MinariWriter:
    """Writes to the new directory `folder`, an episode at a time; Minari's own files are in folder/data.

    about: what is known of all episodes, under "actor", "instruction" and "gym" (an EnvSpec, or None). name: of the
    dataset. env: that they come from. shape: of pictures (H, W, 3), or None for none.
    """

    def __init__(
        self, folder: Path, name: str, env: EnvBase, about: dict[str, Any], shape: tuple[int, ...] | None
    ) -> None:
        minari, _ = import_optional("minari", "h5py")
        from minari.data_collector import EpisodeBuffer
        from minari.dataset.minari_storage import MinariStorage

        self._buffer = EpisodeBuffer
        self._pictures, self._count = shape is not None, 0
        self._storage = MinariStorage.new(
            folder.absolute() / "data",  # it looks for its own size below a relative path twice
            observation_space=_observed(env, shape),
            action_space=spaces.Box(-1.0, 1.0, (env.action_spec.shape[-1],), np.float32),
            env_spec=about["gym"],
        )
        self._storage.update_metadata(
            {
                "dataset_id": name if re.fullmatch(r".*-v\d+", name) else f"{name}-v0",
                "algorithm_name": about["actor"],
                "description": about["instruction"],
                "minari_version": minari.__version__,
                "author": {"deixis"},
            }
        )

    def add(self, episode: Demonstration) -> None:
        pictures = {CAMERA: episode.pictures} if self._pictures else {}
        buffer = self._buffer(
            id=self._count,
            seed=episode.seed,
            observations=episode.seen | pictures,
            actions=episode.actions,
            rewards=episode.came_to["reward"],
            terminations=episode.came_to["terminated"],
            truncations=episode.came_to["truncated"],
            infos=episode.meant | {"success": np.concatenate(([False], episode.came_to["success"]))},
        )
        self._storage.update_episodes([buffer])
        told = {"sentence": episode.sentence, "success": episode.success}
        self._storage.update_episode_metadata([told], [self._count])
        self._count += 1

    def finish(self) -> None:
        """Nothing is left to be written."""


def read_minari(folder: Path) -> Iterator[Demonstration]:
    """The episodes that were written, without pictures. Raises ConfigError."""
    (minari,) = import_optional("minari")
    dataset = minari.MinariDataset(folder / "data")
    metadata = dataset.storage.get_episode_metadata(range(dataset.total_episodes))
    for episode, told in zip(dataset.iterate_episodes(), metadata, strict=True):
        infos = dict(episode.infos)
        success = infos.pop("success")[1:]
        yield Demonstration(
            seed=told["seed"],
            sentence=told["sentence"],
            seen={key: values for key, values in episode.observations.items() if key != CAMERA},
            meant=infos,
            actions=episode.actions,
            came_to={
                "reward": episode.rewards,
                "success": success,
                "terminated": episode.terminations,
                "truncated": episode.truncations,
            },
        )


def _observed(env: EnvBase, shape: tuple[int, ...] | None) -> spaces.Dict:
    found: dict[str, spaces.Space] = {
        key: _space(env.observation_spec[key]) for key in SEEN if key in env.observation_spec.keys()
    }
    if shape is not None:
        found[CAMERA] = spaces.Box(0, 255, shape, np.uint8)
    return spaces.Dict(found)


def _space(spec: Any) -> spaces.Space:
    """The space of one world's values."""
    if isinstance(spec, Bounded):
        return spaces.Box(spec.space.low[0].numpy(), spec.space.high[0].numpy(), dtype=np.float32)
    if isinstance(spec, Binary):
        return spaces.MultiBinary(spec.shape[-1])
    count = int(spec.space.n)
    return spaces.MultiDiscrete([count] * spec.shape[-1]) if len(spec.shape) > 1 else spaces.Discrete(count)
