"""Demonstrations as a LeRobot dataset, version 3.0 of its format: https://huggingface.co/docs/lerobot/lerobot-dataset-v3.

    meta/info.json                     features, their shapes, and where files are
    meta/stats.json                    of all episodes together
    meta/tasks.parquet                 the sentences
    meta/episodes/chunk-*/file-*       a row an episode: its length, files, statistics, seed and success
    data/chunk-*/file-*.parquet        a row a step
    videos/<camera>/chunk-*/file-*.mp4 an episode a file

Written without the library of that name, which wants other versions of PyTorch than ours. A step's row holds what was
seen before the action, the action, and as next.* what came of it: what was seen after an episode's last action is left
out, as the format has no place for it.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torchrl.envs import EnvBase

from trainers.datasets import lerobot_stats
from trainers.datasets.demonstrations import Demonstration
from trainers.datasets.lerobot_stats import Stats
from trainers.datasets.parquet import Shards, as_column, write_index
from trainers.rollout.video import writer
from trainers.utils.atomic_io import write_json
from trainers.utils.optional_imports import import_optional

VERSION = "v3.0"
PLACE = "chunk-{chunk_index:03d}/file-{file_index:03d}"
FILES, DATA_MB, VIDEO_MB = 1000, 100, 200  # files in a chunk, and what a file holds at most
CAMERA = "observation.images.camera"
STATES = {"robot": "observation.state", "objects": "observation.environment_state"}
PIXELS = "yuv420p"


class LeRobotWriter:
    """Writes to the new directory `folder`, an episode at a time.

    about: what is known of all episodes, under "robot", "fps" and "names" (of numbers, by key). env: that they come
    from. shape: of pictures (H, W, 3), or None for none. name: is the directory's own, here.
    """

    def __init__(
        self, folder: Path, name: str, env: EnvBase, about: dict[str, Any], shape: tuple[int, ...] | None
    ) -> None:
        import_optional("pyarrow")
        self._folder, self._about, self._shape = folder, about, shape and _even(shape)
        self._data = Shards(folder / "data", FILES, DATA_MB)
        self._episodes = Shards(folder / "meta" / "episodes", FILES, DATA_MB, rows=100)
        self._tasks: dict[str, int] = {}
        self._features: dict[str, dict[str, Any]] = {}
        self._stats: dict[str, Stats] = {}
        self._count = self._frames = 0

    def add(self, episode: Demonstration) -> None:
        values = self._columns(episode)
        if not self._features:
            self._features = self._described(values)
        first, self._frames = self._frames, self._frames + len(episode)
        row: dict[str, Any] = {"episode_index": self._count, "tasks": [episode.sentence], "length": len(episode)}
        row |= _numbered("data", self._data.write({key: as_column(value) for key, value in values.items()}))
        row |= {"dataset_from_index": first, "dataset_to_index": self._frames}
        stats = {key: lerobot_stats.of_values(value) for key, value in values.items()}
        if self._shape:
            row |= self._film(episode)
            stats[CAMERA] = lerobot_stats.of_pictures(episode.pictures[:-1])
        row |= _numbered("meta/episodes", self._episodes.place)
        row |= {"seed": episode.seed, "success": episode.success}
        for key, each in stats.items():
            self._stats[key] = lerobot_stats.together(self._stats.get(key), each)
            row |= {f"stats/{key}/{name}": value for name, value in lerobot_stats.plain(each).items()}
        self._episodes.write({key: [value] for key, value in row.items()})
        self._count += 1

    def _columns(self, episode: Demonstration) -> dict[str, NDArray]:
        """(T, n) by the names of features."""
        steps, done = len(episode), episode.came_to["terminated"] | episode.came_to["truncated"]
        task = self._tasks.setdefault(episode.sentence, len(self._tasks))
        kept = {STATES.get(key, f"observation.{key}"): value[:-1] for key, value in episode.seen.items()}
        kept |= {"action": episode.actions}
        kept |= {f"next.{key}": value for key, value in (episode.came_to | {"done": done}).items()}
        kept |= {f"label.{key}": value[:-1] for key, value in episode.meant.items()}
        frame = np.arange(steps)
        kept |= {"timestamp": (frame / self._about["fps"]).astype(np.float32), "frame_index": frame}
        kept |= {"episode_index": np.full(steps, self._count), "index": self._frames + frame}
        kept |= {"task_index": np.full(steps, task)}
        return {key: value.reshape(steps, -1) for key, value in kept.items()}

    def _described(self, values: dict[str, NDArray]) -> dict[str, dict[str, Any]]:
        """The features as info.json has them."""
        names = {STATES.get(key, key): each for key, each in self._about["names"].items()}
        found = {
            key: {"dtype": str(value.dtype), "shape": list(value.shape[1:]), "names": names.get(key)}
            for key, value in values.items()
        }
        if self._shape:
            height, width, channels = self._shape
            film = {"height": height, "width": width, "channels": channels, "fps": self._about["fps"]}
            film |= {"codec": "h264", "pix_fmt": PIXELS, "is_depth_map": False}
            info = {**{f"video.{name}": value for name, value in film.items()}, "has_audio": False}
            shape = {"shape": list(self._shape), "names": ["height", "width", "channels"]}
            found[CAMERA] = {"dtype": "video", **shape, "info": info}
        return found

    def _film(self, episode: Demonstration) -> dict[str, Any]:
        """Write the video of the episode; where in the row of the episode it is said to be."""
        assert self._shape is not None
        height, width, _ = self._shape
        place = divmod(self._count, FILES)
        path = self._folder / "videos" / CAMERA / f"{_path(place)}.mp4"
        path.parent.mkdir(parents=True, exist_ok=True)
        fps = self._about["fps"]
        with writer(path, fps, "-g", "2", "-pix_fmt", PIXELS) as film:  # frames are read one by one, in any order
            for picture in episode.pictures[:-1]:
                film.append_data(picture[:height, :width])
        times = {"from_timestamp": 0.0, "to_timestamp": len(episode) / fps}
        return _numbered(f"videos/{CAMERA}", place) | {f"videos/{CAMERA}/{name}": at for name, at in times.items()}

    def finish(self) -> None:
        """Close what is open, and write what is known only now."""
        self._data.close()
        self._episodes.close()
        write_index(self._folder / "meta" / "tasks.parquet", list(self._tasks), "task_index")
        stats = {key: lerobot_stats.plain(each) for key, each in self._stats.items()}
        write_json(self._folder / "meta" / "stats.json", stats)
        info = {
            "codebase_version": VERSION,
            "robot_type": self._about["robot"],
            "total_episodes": self._count,
            "total_frames": self._frames,
            "total_tasks": len(self._tasks),
            "chunks_size": FILES,
            "data_files_size_in_mb": DATA_MB,
            "video_files_size_in_mb": VIDEO_MB,
            "fps": self._about["fps"],
            "splits": {"train": f"0:{self._count}"},
            "data_path": f"data/{PLACE}.parquet",
            "video_path": f"videos/{{video_key}}/{PLACE}.mp4" if self._shape else None,
            "features": self._features,
        }
        write_json(self._folder / "meta" / "info.json", info)


def read_lerobot(folder: Path) -> Iterator[Demonstration]:
    """The episodes that were written, without pictures, and without what was seen after the last action."""
    import_optional("pyarrow")
    from pyarrow import parquet

    keys = {feature: key for key, feature in STATES.items()}
    names = list(json.loads((folder / "meta" / "info.json").read_text())["features"])
    sentences = parquet.read_table(folder / "meta" / "tasks.parquet")[1].to_pylist()
    wanted = ["episode_index", "data/chunk_index", "data/file_index", "seed"]
    for file in sorted((folder / "meta" / "episodes").glob("*/*.parquet")):
        for row in parquet.read_table(file, columns=wanted).to_pylist():
            place = row["data/chunk_index"], row["data/file_index"]
            mine = [("episode_index", "==", row["episode_index"])]
            steps = parquet.read_table(folder / "data" / f"{_path(place)}.parquet", filters=mine)
            found = {name: np.array(steps[name].to_pylist()) for name in names if name != CAMERA}
            groups: dict[str, dict[str, NDArray]] = {"observation": {}, "next": {}, "label": {}}
            for name, values in found.items():
                group, _, key = name.partition(".")
                if group in groups:
                    groups[group][keys.get(name, key)] = values
            groups["next"].pop("done")
            yield Demonstration(
                seed=row["seed"],
                sentence=sentences[found["task_index"][0]],
                seen=groups["observation"],
                meant=groups["label"],
                actions=found["action"].astype(np.float32).reshape(len(steps), -1),
                came_to=groups["next"],
            )


def _path(place: tuple[int, int]) -> str:
    return PLACE.format(chunk_index=place[0], file_index=place[1])


def _numbered(name: str, place: tuple[int, int]) -> dict[str, Any]:
    return {f"{name}/chunk_index": place[0], f"{name}/file_index": place[1]}


def _even(shape: tuple[int, ...]) -> tuple[int, ...]:
    """H.264 knows no odd heights and widths."""
    return (shape[0] - shape[0] % 2, shape[1] - shape[1] % 2, shape[2])
