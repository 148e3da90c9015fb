"""metrics.csv: its header, resumed files and truncated lines."""

from __future__ import annotations

import random

import pytest

from core.errors import ConfigError
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


def written(folder, rows=20):
    metrics = MetricsWriter(folder, ["frames", "a", "b"])
    for frames in range(1, rows + 1):
        metrics.write({"frames": frames, "a": frames / 3} | ({"b": 1.5} if frames % 3 else {}))
    metrics.close()
    return folder / "metrics.csv"


def test_no_damage_gives_other_numbers(tmp_path):
    path = written(tmp_path)
    content, rows = path.read_bytes(), read_metrics(path)
    rng = random.Random(0)
    for _ in range(300):
        damaged, place = bytearray(content), rng.randrange(len(content))
        damaged[place : place + rng.choice([0, 1, 1, 1, 40])] = bytes([rng.randrange(256)] * rng.choice([0, 1]))
        path.write_bytes(bytes(damaged))
        try:
            found = read_metrics(path)
        except ConfigError as error:
            assert "\n" not in str(error)  # noqa: PT017
            continue
        assert repr(found) == repr(rows[: len(found)])


def test_a_damaged_file_costs_the_curve_not_the_resume(tmp_path, capsys):
    path = written(tmp_path)
    path.write_bytes(path.read_bytes().replace(b"1.5", b"2.5", 1))
    with pytest.raises(ConfigError, match="the checksum of line 2 does not fit"):
        read_metrics(path)
    metrics = MetricsWriter(tmp_path, ["frames", "a", "b"], after=10, iterations=10)
    metrics.write({"frames": 11})
    metrics.close()
    assert [row["frames"] for row in read_metrics(path)] == [11]
    said = capsys.readouterr().err
    assert "checksum" in said
    assert said.count("\n") == 1
    assert (tmp_path / "metrics.csv.damaged").exists()


@pytest.mark.parametrize(("kept", "said"), [(19, "lacks 1 of the 20 rows"), (0, "lacks all of the 20 rows"), (20, "")])
def test_a_resumed_run_says_which_rows_are_missing(tmp_path, capsys, kept, said):
    path = written(tmp_path)
    path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[: kept + 1]))
    MetricsWriter(tmp_path, ["frames", "a", "b"], after=20, iterations=20).close()
    assert len(read_metrics(path)) == kept
    lines = capsys.readouterr().err.splitlines()
    assert lines == ([f"warning: {path} {said} up to frame 20; training goes on without them"] if said else [])


def test_rows_are_never_written_through_a_link(tmp_path):
    (tmp_path / "others").write_text("precious")
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "metrics.csv").symlink_to(tmp_path / "others")
    written(tmp_path / "run")
    (tmp_path / "run" / "metrics.csv").unlink()
    (tmp_path / "run" / "metrics.csv").hardlink_to(tmp_path / "others")
    assert len(read_metrics(written(tmp_path / "run"))) == 20
    assert (tmp_path / "others").read_text() == "precious"


def test_a_full_disk_is_named(tmp_path, monkeypatch):
    metrics = MetricsWriter(tmp_path, ["frames"])
    monkeypatch.setattr("trainers.run.metrics.os.write", lambda *_: 3)
    with pytest.raises(ConfigError, match=r"metrics\.csv cannot be written: No space left on device"):
        metrics.write({"frames": 1})
