"""Parquet files of limited size."""

from __future__ import annotations

import numpy as np
from pyarrow import parquet

from trainers.datasets.lerobot_dataset import Shards, as_column, write_index


def test_a_full_file_is_continued_in_another(tmp_path):
    shards = Shards(tmp_path, files=2, megabytes=0.01)
    values = np.random.default_rng(0).random((5, 100, 9))
    places = [shards.write({"values": as_column(value)}) for value in values]
    shards.close()
    assert places == [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0)] or len(set(places)) > 2
    assert len(list(tmp_path.rglob("*.parquet"))) == len(set(places))
    for place in set(places):
        rows = parquet.read_table(tmp_path / "chunk-{:03d}/file-{:03d}.parquet".format(*place))["values"].to_pylist()
        mine = [value for value, where in zip(values, places, strict=True) if where == place]
        np.testing.assert_array_equal(rows, np.concatenate(mine))


def test_rows_are_collected_before_they_are_written(tmp_path):
    shards = Shards(tmp_path, files=2, megabytes=1, rows=3)
    for value in range(4):
        assert shards.write({"value": [value]}) == (0, 0)
    shards.close()
    table = parquet.read_table(tmp_path / "chunk-000" / "file-000.parquet")
    assert table["value"].to_pylist() == [0, 1, 2, 3]


def test_an_index_holds_words_and_their_numbers(tmp_path):
    write_index(tmp_path / "tasks.parquet", ["reach", "push"], "task_index")
    assert parquet.read_table(tmp_path / "tasks.parquet")["task_index"].to_pylist() == [0, 1]
