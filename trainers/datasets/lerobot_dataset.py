"""Writing and reading demonstrations as a LeRobot dataset, version 3: https://huggingface.co/docs/lerobot.

Tables are Parquet files of limited size; pictures are one video for each episode and camera; each feature of numbers
has statistics.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import numpy as np
from numpy.typing import NDArray
from torchrl.envs import EnvBase

from core.system import import_optional
from trainers.datasets.demonstrations import Demonstration
from trainers.evaluation.video import open_video
from trainers.utils.files import write_json

COMPRESSION = "snappy"


QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
SAMPLED_IMAGES, PIXEL_STRIDE = 20, 4  # of an episode: enough for the statistics of its colours
Stats = dict[str, NDArray[np.float64]]  # minimum, maximum, mean, ... of one feature, and the count
VERSION = "v3.0"
FILE_PATH = "chunk-{chunk_index:03d}/file-{file_index:03d}"
CHUNK_FILES, DATA_MB, VIDEO_MB = 1000, 100, 200  # files in a chunk, and the maximum size of a file
IMAGES = "observation.images"  # of each camera: IMAGES.name
FEATURES = {"robot": "observation.state", "objects": "observation.environment_state"}
PIXEL_FORMAT = "yuv420p"
# What is said to the robot: in every frame what is in force, and what is said in that very frame. Deixis says one
# sentence at the beginning of an episode, so there are no events.
SPOKEN, EVENTS = "language_persistent", "language_events"
LANGUAGE_FEATURES = {name: {"dtype": "language", "shape": [1], "names": None} for name in (SPOKEN, EVENTS)}
# Who says the sentence, in which style, as the library's recipes look it up: the task in the person's words, and what
# the robot is doing now, which is the whole task.
ROLES = (("user", "task_aug"), ("assistant", "subtask"))


class LeRobotWriter:
    """Writes a dataset episode by episode.

    Args:
        folder: a new directory.
        name: of the dataset; LeRobot takes it from the directory.
        env: the environment of the episodes.
        about: "robot", "fps", and "names" of the numbers of each observation, by key.
        shapes: of the pictures (H, W, 3) of each camera.
    """

    def __init__(
        self, folder: Path, name: str, env: EnvBase, about: dict[str, Any], shapes: Mapping[str, tuple[int, ...]]
    ) -> None:
        import_optional("pyarrow")
        self._folder, self._about = folder, about
        self._shapes = {camera: _even_size(shape) for camera, shape in shapes.items()}
        self._data = Shards(folder / "data", CHUNK_FILES, DATA_MB)
        self._episodes = Shards(folder / "meta" / "episodes", CHUNK_FILES, DATA_MB, rows=100)
        self._tasks: dict[str, int] = {}
        self._features: dict[str, dict[str, Any]] = {}
        self._stats: dict[str, Stats] = {}
        self._count = self._frames = 0

    def add(self, episode: Demonstration) -> None:
        """Write one episode."""
        values = self._columns(episode)
        columns = {key: as_column(value) for key, value in values.items()}
        columns |= (language := language_columns(episode.sentence, len(episode)))
        if not self._features:
            self._features = self._feature_table(values) | {key: LANGUAGE_FEATURES[key] for key in language}
        first, self._frames = self._frames, self._frames + len(episode)
        row: dict[str, Any] = {"episode_index": self._count, "tasks": [episode.sentence], "length": len(episode)}
        row |= _file_columns("data", self._data.write(columns))
        row |= {"dataset_from_index": first, "dataset_to_index": self._frames}
        stats = {key: of_values(value) for key, value in values.items()}
        for camera in self._shapes:
            row |= self._write_video(camera, episode.images[camera][:-1])
            stats[f"{IMAGES}.{camera}"] = of_images(episode.images[camera][:-1])
        row |= _file_columns("meta/episodes", self._episodes.place)
        row |= {"seed": episode.seed, "success": episode.success}
        for key, each in stats.items():
            self._stats[key] = merge(self._stats.get(key), each)
            row |= {f"stats/{key}/{name}": value for name, value in as_lists(each).items()}
        self._episodes.write({key: [value] for key, value in row.items()})
        self._count += 1

    def _columns(self, episode: Demonstration) -> dict[str, NDArray]:
        """Return the values (T, n) of each feature."""
        steps, done = len(episode), episode.outcomes["terminated"] | episode.outcomes["truncated"]
        task = self._tasks.setdefault(episode.sentence, len(self._tasks))
        columns = {FEATURES.get(key, f"observation.{key}"): value[:-1] for key, value in episode.observations.items()}
        columns |= {"action": episode.actions}
        columns |= {f"next.{key}": value for key, value in (episode.outcomes | {"done": done}).items()}
        columns |= {f"label.{key}": value[:-1] for key, value in episode.labels.items()}
        frame = np.arange(steps)
        columns |= {"timestamp": (frame / self._about["fps"]).astype(np.float32), "frame_index": frame}
        columns |= {"episode_index": np.full(steps, self._count), "index": self._frames + frame}
        columns |= {"task_index": np.full(steps, task)}
        return {key: value.reshape(steps, -1) for key, value in columns.items()}

    def _feature_table(self, values: dict[str, NDArray]) -> dict[str, dict[str, Any]]:
        """Return the features of info.json. values: an episode's columns."""
        names = {FEATURES.get(key, key): each for key, each in self._about["names"].items()}
        features = {
            key: {"dtype": str(value.dtype), "shape": list(value.shape[1:]), "names": names.get(key)}
            for key, value in values.items()
        }
        for camera, (height, width, channels) in self._shapes.items():
            video = {"height": height, "width": width, "channels": channels, "fps": self._about["fps"]}
            video |= {"codec": "h264", "pix_fmt": PIXEL_FORMAT, "is_depth_map": False}
            info = {**{f"video.{name}": value for name, value in video.items()}, "has_audio": False}
            shape = {"shape": [height, width, channels], "names": ["height", "width", "channels"]}
            features[f"{IMAGES}.{camera}"] = {"dtype": "video", **shape, "info": info}
        return features

    def _write_video(self, camera: str, pictures: Sequence[NDArray[np.uint8]]) -> dict[str, Any]:
        """Write the video of a camera in an episode; returns its place for the episode's row."""
        height, width, _ = self._shapes[camera]
        place = divmod(self._count, CHUNK_FILES)
        key = f"videos/{IMAGES}.{camera}"
        path = self._folder / key / f"{_path(place)}.mp4"
        path.parent.mkdir(parents=True, exist_ok=True)
        fps = self._about["fps"]
        # Short groups of pictures, because training reads single frames in any order.
        with open_video(path, fps, "-g", "2") as video:
            for picture in pictures:
                video.append_data(picture[:height, :width])
        times = {"from_timestamp": 0.0, "to_timestamp": len(pictures) / fps}
        return _file_columns(key, place) | {f"{key}/{name}": at for name, at in times.items()}

    def finish(self) -> None:
        """Close the open files, and write the metadata of the whole dataset."""
        self._data.close()
        self._episodes.close()
        write_index(self._folder / "meta" / "tasks.parquet", list(self._tasks), "task_index")
        stats = {key: as_lists(each) for key, each in self._stats.items()}
        write_json(self._folder / "meta" / "stats.json", stats)
        info = {
            "codebase_version": VERSION,
            "robot_type": self._about["robot"],
            "total_episodes": self._count,
            "total_frames": self._frames,
            "total_tasks": len(self._tasks),
            "chunks_size": CHUNK_FILES,
            "data_files_size_in_mb": DATA_MB,
            "video_files_size_in_mb": VIDEO_MB,
            "fps": self._about["fps"],
            "splits": {"train": f"0:{self._count}"},
            "data_path": f"data/{FILE_PATH}.parquet",
            "video_path": f"videos/{{video_key}}/{FILE_PATH}.mp4" if self._shapes else None,
            "features": self._features,
        }
        write_json(self._folder / "meta" / "info.json", info)


def read_lerobot(folder: Path, cameras: Sequence[str] = ()) -> Iterator[Demonstration]:
    """Return the episodes of a dataset, with the pictures of these cameras, as H.264 left them.

    The observation and the pictures after the last action are missing.
    """
    import_optional("pyarrow")
    from pyarrow import parquet

    keys = {feature: key for key, feature in FEATURES.items()}
    features = json.loads((folder / "meta" / "info.json").read_text())["features"]
    names = [name for name, each in features.items() if each["dtype"] not in ("video", "language")]
    sentences = parquet.read_table(folder / "meta" / "tasks.parquet")[1].to_pylist()
    columns = ["episode_index", "data/chunk_index", "data/file_index", "seed"]
    for file in sorted((folder / "meta" / "episodes").glob("*/*.parquet")):
        for row in parquet.read_table(file, columns=columns).to_pylist():
            place = row["data/chunk_index"], row["data/file_index"]
            own_rows = [("episode_index", "==", row["episode_index"])]
            steps = parquet.read_table(folder / "data" / f"{_path(place)}.parquet", filters=own_rows)
            values_of = {name: np.array(steps[name].to_pylist()) for name in names}
            groups: dict[str, dict[str, NDArray]] = {"observation": {}, "next": {}, "label": {}}
            for name, values in values_of.items():
                group, _, key = name.partition(".")
                if group in groups:
                    groups[group][keys.get(name, key)] = values
            groups["next"].pop("done")
            yield Demonstration(
                seed=row["seed"],
                sentence=sentences[values_of["task_index"][0]],
                observations=groups["observation"],
                labels=groups["label"],
                actions=values_of["action"].astype(np.float32).reshape(len(steps), -1),
                outcomes=groups["next"],
                images={name: _read_video(folder, name, row["episode_index"]) for name in cameras},
            )


def _read_video(folder: Path, camera: str, episode: int) -> list[NDArray[np.uint8]]:
    """Return the pictures (H, W, 3) of a camera in an episode."""
    place = divmod(episode, CHUNK_FILES)
    return list(imageio.imiter(folder / "videos" / f"{IMAGES}.{camera}" / f"{_path(place)}.mp4"))


def _path(place: tuple[int, int]) -> str:
    """Return the path of a file without its suffix. place: the numbers of its chunk and of the file."""
    return FILE_PATH.format(chunk_index=place[0], file_index=place[1])


def _file_columns(name: str, place: tuple[int, int]) -> dict[str, Any]:
    """Return the columns of an episode's row that say in which file of `name` its data are."""
    return {f"{name}/chunk_index": place[0], f"{name}/file_index": place[1]}


def _even_size(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Return the shape with even height and width, as H.264 requires."""
    return (shape[0] - shape[0] % 2, shape[1] - shape[1] % 2, shape[2])


class Shards:
    """Writes a table to chunk-000/file-000.parquet and so on. The rows of one `write` go to the same file.

    Args:
        folder: the directory of the chunks.
        files: in a chunk.
        megabytes: size after which a new file is started.
        rows: how many are collected before they are written together.
    """

    def __init__(self, folder: Path, files: int, megabytes: float, rows: int = 1) -> None:
        self._folder, self._files, self._max_bytes, self._rows = folder, files, megabytes * 2**20, rows
        self._number = 0
        self._writer: Any = None
        self._pending: list[Any] = []

    @property
    def place(self) -> tuple[int, int]:
        """The numbers of the chunk and the file of the next rows."""
        return divmod(self._number, self._files)

    def write(self, columns: dict[str, Any]) -> tuple[int, int]:
        """Add rows, given by column; returns the numbers of their chunk and file."""
        import pyarrow

        place = self.place
        self._pending.append(pyarrow.table(columns))
        if sum(map(len, self._pending)) >= self._rows:
            self._flush()
        return place

    def _flush(self) -> None:
        import pyarrow
        from pyarrow import parquet

        if not self._pending:
            return
        table, self._pending = pyarrow.concat_tables(self._pending), []
        path = self._folder / "chunk-{:03d}/file-{:03d}.parquet".format(*self.place)
        if self._writer is None:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = parquet.ParquetWriter(path, table.schema, compression=COMPRESSION)
        self._writer.write_table(table)
        if path.stat().st_size >= self._max_bytes:
            self._start_next_file()

    def _start_next_file(self) -> None:
        self._writer.close()
        self._writer, self._number = None, self._number + 1

    def close(self) -> None:
        """Write the pending rows and close the last file, which is not readable before."""
        self._flush()
        if self._writer is not None:
            self._writer.close()


def language_columns(sentence: str, steps: int) -> dict[str, Any]:
    """Return the pyarrow columns of `LANGUAGE_FEATURES` of an episode; {} without words."""
    import pyarrow

    if not sentence:
        return {}
    text = pyarrow.string()
    names = ("role", "content", "style", "camera")
    said = [*[pyarrow.field(name, text) for name in names], pyarrow.field("tool_calls", pyarrow.list_(text))]
    timed = [*said, pyarrow.field("timestamp", pyarrow.float32())]
    rows = [{"role": role, "content": sentence, "style": style, "timestamp": 0.0} for role, style in ROLES]
    return {
        SPOKEN: pyarrow.array([rows] * steps, pyarrow.list_(pyarrow.struct(timed))),
        EVENTS: pyarrow.array([[]] * steps, pyarrow.list_(pyarrow.struct(said))),
    }


def as_column(values: NDArray) -> Any:
    """Return values (T, n) as a column of lists of length n, or of plain values if n is 1."""
    import pyarrow

    flat = pyarrow.array(values.reshape(-1))
    return flat if values.shape[1] == 1 else pyarrow.FixedSizeListArray.from_arrays(flat, values.shape[1])


def write_index(path: Path, words: list[str], column: str) -> None:
    """Write a table that pandas reads with the words as its index and their numbers as its only column."""
    import pyarrow
    from pyarrow import parquet

    index = "__index_level_0__"

    def column_metadata(name: str | None, field: str | None, kind: str, numpy: str) -> dict[str, Any]:
        return {"name": name, "field_name": field, "pandas_type": kind, "numpy_type": numpy, "metadata": None}

    metadata = {
        "index_columns": [index],
        "column_indexes": [column_metadata(None, None, "unicode", "object") | {"metadata": {"encoding": "UTF-8"}}],
        "columns": [
            column_metadata(column, column, "int64", "int64"),
            column_metadata(None, index, "unicode", "object"),
        ],
        "creator": {"library": "pyarrow", "version": pyarrow.__version__},
        "pandas_version": "2.0.0",
    }
    table = pyarrow.table({column: pyarrow.array(range(len(words)), pyarrow.int64()), index: words})
    path.parent.mkdir(parents=True, exist_ok=True)
    parquet.write_table(table.replace_schema_metadata({"pandas": json.dumps(metadata)}), path)


def of_values(values: NDArray) -> Stats:
    """Return statistics of a feature's values (T, n), for each of its n numbers."""
    values = values.astype(np.float64)
    out = {"min": values.min(0), "max": values.max(0), "mean": values.mean(0), "std": values.std(0)}
    out["count"] = np.array([len(values)])
    return out | {name: np.quantile(values, share, axis=0) for name, share in QUANTILES.items()}


def of_images(images: Sequence[NDArray[np.uint8]]) -> Stats:
    """Return statistics of each colour channel, (3, 1, 1), in [0, 1]. images: (H, W, 3) each."""
    chosen = np.unique(np.linspace(0, len(images) - 1, SAMPLED_IMAGES).astype(int))
    pixels = np.stack([images[i][::PIXEL_STRIDE, ::PIXEL_STRIDE] for i in chosen]).reshape(-1, 3) / 255.0
    colours = {name: value.reshape(3, 1, 1) for name, value in of_values(pixels).items() if name != "count"}
    return colours | {"count": np.array([len(chosen)])}


def merge(one: Stats | None, other: Stats) -> Stats:
    """Return statistics over the values of two sets. Quantiles are weighted means of both, as in LeRobot itself."""
    if one is None:
        return other
    counts = one["count"][0], other["count"][0]
    total = sum(counts)

    def mean(name: str) -> NDArray[np.float64]:
        return (counts[0] * one[name] + counts[1] * other[name]) / total

    means = mean("mean")
    variance = sum(
        count * (each["std"] ** 2 + (each["mean"] - means) ** 2)
        for count, each in zip(counts, (one, other), strict=True)
    )
    return {
        "min": np.minimum(one["min"], other["min"]),
        "max": np.maximum(one["max"], other["max"]),
        "mean": means,
        "std": np.sqrt(variance / total),
        "count": np.array([total]),
        **{name: mean(name) for name in QUANTILES},
    }


def as_lists(stats: Stats) -> dict[str, Any]:
    """Return the statistics as lists of numbers."""
    return {name: value.tolist() for name, value in stats.items()}
