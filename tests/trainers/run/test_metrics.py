"""metrics.csv: its header, resumed files and truncated lines."""

from __future__ import annotations

import pytest

from tests.helpers.run_folders import add_run, config
from trainers.run.metrics import MetricsWriter, read_metrics
from trainers.sweeps.runs import find_runs


def test_the_header_is_fixed_and_resuming_drops_later_rows(tmp_path):
    metrics = MetricsWriter(tmp_path, ["frames", "a"])
    for frames in (1, 2, 3):
        metrics.write({"frames": frames, "a": frames / 3} if frames != 2 else {"frames": 2})
    with pytest.raises(ValueError, match="b"):
        metrics.write({"frames": 4, "b": 0})
    metrics.close()
    MetricsWriter(tmp_path, ["frames", "a"], after=2).close()
    assert [row["frames"] for row in read_metrics(tmp_path / "metrics.csv")] == [1, 2]
    assert read_metrics(tmp_path / "metrics.csv")[0]["a"] == 1 / 3


def test_a_truncated_last_line_is_ignored(tmp_path):
    folder = add_run(tmp_path / "run", config())
    with open(folder / "metrics.csv", "a") as file:
        file.write("400,1.0,0.1,0.1,0.9")
    assert [row["frames"] for row in find_runs(folder)[0].evaluations] == [100, 200, 300]


def test_a_missing_file_has_no_rows(tmp_path):
    assert read_metrics(tmp_path / "metrics.csv") == []
