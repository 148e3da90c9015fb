"""LeRobot datasets: published layout and statistics."""

from __future__ import annotations

import json

import numpy as np
import pytest
from pyarrow import parquet

from trainers.datasets import lerobot_dataset

pytestmark = pytest.mark.slow


def test_a_lerobot_dataset_has_the_published_layout(recordings, recorded_episodes):
    folder, steps = recordings["lerobot"], sum(map(len, recorded_episodes))
    info = json.loads((folder / "meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"], info["robot_type"]) == ("v3.0", 20, "kuka")
    assert (info["total_episodes"], info["total_frames"], info["splits"]) == (3, steps, {"train": "0:3"})
    place = {"chunk_index": 0, "file_index": 0}
    rows = parquet.read_table(folder / info["data_path"].format(**place)).to_pydict()
    assert set(rows) == set(info["features"])
    for name, feature in info["features"].items():
        width = feature["shape"][0]
        assert feature["dtype"] == "language" or all(np.size(value) == width for value in rows[name])
        assert feature["names"] is None or len(feature["names"]) == width
    assert rows["index"] == list(range(steps))
    assert rows["timestamp"][:3] == [0.0, np.float32(0.05), np.float32(0.1)]
    metadata = parquet.read_table(folder / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [row["dataset_to_index"] - row["dataset_from_index"] for row in metadata] == list(
        map(len, recorded_episodes)
    )
    assert [row["tasks"] for row in metadata] == [[episode.sentence] for episode in recorded_episodes]
    tasks = parquet.read_table(folder / "meta/tasks.parquet")
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == [tasks.column_names[1]]
    said = dict(zip(*(tasks[i].to_pylist() for i in (0, 1)), strict=True))
    assert [said[task] for task in dict.fromkeys(rows["task_index"])] == list(
        dict.fromkeys(e.sentence for e in recorded_episodes)
    )


def test_every_frame_has_the_sentence_of_its_episode(recordings, recorded_episodes):
    rows = parquet.read_table(recordings["lerobot"] / "data/chunk-000/file-000.parquet").to_pylist()
    for row in rows:
        said, sentence = row["language_persistent"], recorded_episodes[row["episode_index"]].sentence
        assert {(each["role"], each["style"]) for each in said} == {("user", "task_aug"), ("assistant", "subtask")}
        assert {(each["content"], each["timestamp"]) for each in said} == {(sentence, 0.0)}
        assert row["language_events"] == []


def test_without_words_there_are_no_language_columns():
    assert lerobot_dataset.language_columns("", 3) == {}


def test_the_statistics_cover_all_steps(recordings, recorded_episodes):
    known = json.loads((recordings["lerobot"] / "meta/stats.json").read_text())["action"]
    actions = np.concatenate([episode.actions for episode in recorded_episodes]).astype(np.float64)
    for name, value in (("min", actions.min(0)), ("max", actions.max(0)), ("mean", actions.mean(0))):
        np.testing.assert_allclose(known[name], value)
    np.testing.assert_allclose(known["std"], actions.std(0))
    assert known["count"] == [len(actions)]
    parts = [lerobot_dataset.of_values(actions[:7]), lerobot_dataset.of_values(actions[7:])]
    np.testing.assert_allclose(lerobot_dataset.merge(*parts)["std"], actions.std(0))


def test_the_lerobot_library_reads_the_dataset(recordings, recorded_episodes):
    library = pytest.importorskip("lerobot.datasets.lerobot_dataset")
    loaded = library.LeRobotDataset("deixis/recorded", root=recordings["lerobot"])
    assert (loaded.num_episodes, loaded.num_frames) == (3, sum(map(len, recorded_episodes)))
    np.testing.assert_array_equal(loaded[2]["observation.state"].numpy(), recorded_episodes[0].observations["robot"][2])
    assert loaded[0]["task"] == recorded_episodes[0].sentence
    assert loaded.meta.has_language_columns
    assert loaded[0]["language_persistent"][0]["content"] == recorded_episodes[0].sentence
