"""The summary of a sweep."""

from __future__ import annotations

import json

import pytest

from tests.helpers.run_folders import add_run, config
from trainers.sweeps.runs import find_runs
from trainers.sweeps.sweep import HEADER, format_table, summarize, table_rows


def test_the_table_has_a_row_for_each_run(tmp_path):
    add_run(tmp_path / "0_a", config(0))
    add_run(tmp_path / "1_a", config(1), success=None, error="boom")
    finished, failed = table_rows(find_runs(tmp_path))
    assert finished[:2] == ("seed=0", "0.900")
    assert failed == ("seed=1", "failed: boom", "", "", "", "", "")


def test_the_table_tells_how_many_successes_disturbed_objects_and_takes_runs_that_did_not_measure_it(tmp_path):
    folder = add_run(tmp_path / "0_a", config(0))
    add_run(tmp_path / "1_a", config(1))
    result = json.loads((folder / "eval.json").read_text())
    (folder / "eval.json").write_text(json.dumps(result | {"disturbed": 0.125}))
    column = HEADER.index("disturbed")
    assert [row[column] for row in table_rows(find_runs(tmp_path))] == ["0.125", "-"]


def test_columns_are_aligned():
    lines = format_table([("run", "success", "ci95"), ("a", "0.9", "0.8-1.0")]).splitlines()
    assert lines == ["run  success  ci95", "---  -------  -------", "a    0.9      0.8-1.0"]


@pytest.mark.slow
def test_a_summary_says_whether_all_runs_have_finished(tmp_path, capsys):
    add_run(tmp_path / "0_a", config(0))
    assert summarize(tmp_path)
    assert "report: " in capsys.readouterr().out
    add_run(tmp_path / "1_a", config(1), success=None)
    assert not summarize(tmp_path)
