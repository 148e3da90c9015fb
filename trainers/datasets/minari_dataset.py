"""Writing and reading demonstrations as a Minari dataset: https://minari.farama.org.

Observations are a Dict of `Demonstration.observations`, and of the pictures of each camera under its name: Minari
stores them as JPEG. Infos hold the labels, and whether the step ended in success. The metadata of an episode are its
seed, its sentence and its success. Minari rebuilds the environment (`recover_environment`) if its Gymnasium spec is
known.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from torchrl.envs import EnvBase

from core.errors import ConfigError
from core.spaces import action_space, public_keys, space_of
from core.system import import_optional
from trainers.datasets.demonstrations import Demonstration

Shapes = Mapping[str, tuple[int, ...]]  # (H, W, 3) of the pictures of each camera


class MinariWriter:
    """Writes a dataset episode by episode; Minari's files are in folder/data.

    Args:
        folder: a new directory.
        name: of the dataset.
        env: the environment of the episodes.
        about: "actor", "instruction" and "gym" (an EnvSpec or None).
        shapes: of the pictures (H, W, 3) of each camera.

    Raises:
        ConfigError: a library is missing, or a camera has the name of an observation.
    """

    def __init__(self, folder: Path, name: str, env: EnvBase, about: dict[str, Any], shapes: Shapes) -> None:
        minari, _ = import_optional("minari", "h5py")
        from minari.data_collector import EpisodeBuffer
        from minari.dataset.minari_storage import MinariStorage

        self._buffer = EpisodeBuffer
        self._count = 0
        self._storage = MinariStorage.new(
            folder.absolute() / "data",  # absolute: Minari prefixes a relative path twice when it computes its size
            observation_space=_observation_space(env, shapes),
            action_space=action_space(env.action_spec),
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
        """Write one episode."""
        buffer = self._buffer(
            id=self._count,
            seed=episode.seed,
            observations=episode.observations | episode.images,
            actions=episode.actions,
            rewards=episode.outcomes["reward"],
            terminations=episode.outcomes["terminated"],
            truncations=episode.outcomes["truncated"],
            infos=episode.labels | {"success": np.concatenate(([False], episode.outcomes["success"]))},
        )
        self._storage.update_episodes([buffer])
        metadata = {"sentence": episode.sentence, "success": episode.success}
        self._storage.update_episode_metadata([metadata], [self._count])
        self._count += 1

    def finish(self) -> None:
        """Do nothing: `add` has written everything."""


def check_minari_name(folder: Path) -> None:
    """Raise ConfigError for a folder that Minari cannot list: then it lists none of those beside it either."""
    if not re.fullmatch(r"[-_\w]+-v\d+", folder.name):
        stem = re.sub(r"[^-_\w]+", "_", re.sub(r"-v\d+$", "", folder.name)) or "recording"
        raise ConfigError(
            f"out={folder}: Minari lists no folder whose name does not end in a version; "
            f"give out={folder.parent / stem}-v0"
        )


def read_minari(folder: Path, cameras: Sequence[str] = ()) -> Iterator[Demonstration]:
    """Return the episodes of a dataset, with the pictures of these cameras, as JPEG left them.

    Raises ConfigError if minari is not installed.
    """
    (minari,) = import_optional("minari")
    dataset = minari.MinariDataset(folder / "data")
    pictures = [key for key, space in dataset.observation_space.items() if _is_picture(space)]
    metadata = dataset.storage.get_episode_metadata(range(dataset.total_episodes))
    for episode, own in zip(dataset.iterate_episodes(), metadata, strict=True):
        infos = dict(episode.infos)
        success = infos.pop("success")[1:]
        yield Demonstration(
            seed=own["seed"],
            sentence=own["sentence"],
            observations={key: values for key, values in episode.observations.items() if key not in pictures},
            labels=infos,
            actions=episode.actions,
            outcomes={
                "reward": episode.rewards,
                "success": success,
                "terminated": episode.terminations,
                "truncated": episode.truncations,
            },
            images={name: list(episode.observations[name]) for name in cameras},
        )


def _observation_space(env: EnvBase, shapes: Shapes) -> spaces.Dict:
    """Return the Gymnasium space of one world's observations and pictures. Raises ConfigError.

    It has no MultiBinary and no MultiDiscrete, which TorchRL's reader of Minari datasets does not know.
    """
    members: dict[str, spaces.Space] = {
        key: _as_box(space_of(env.observation_spec[key])) for key in public_keys(env.observation_spec)
    }
    for name, shape in shapes.items():
        if name in members:
            raise ConfigError(f"cameras=[{','.join(shapes)}]: {name} is the name of an observation; give another name")
        members[name] = spaces.Box(0, 255, shape, np.uint8)
    return spaces.Dict(members)


def _is_picture(space: spaces.Space) -> bool:
    return isinstance(space, spaces.Box) and space.dtype == np.uint8 and len(space.shape) == 3


def _as_box(space: spaces.Space) -> spaces.Space:
    """Return the space as a Box if it holds several whole numbers, otherwise as it is."""
    if isinstance(space, spaces.MultiBinary):
        return spaces.Box(0, 1, space.shape, np.uint8)
    if isinstance(space, spaces.MultiDiscrete):
        return spaces.Box(0, space.nvec - 1, dtype=np.int64)
    return space
