"""Time to the target success from two metrics.csv. The peer's packages are not required."""

import csv
import math

import pytest

from tools.peer_comparison import (
    COLUMNS,
    Evaluation,
    compare_sides,
    first_at_target,
    our_overrides,
    ratio_line,
    read_curve,
    summarize,
    table,
)

TARGET = 0.9


def write_csv(folder, rows, columns=COLUMNS):
    with open(folder / "metrics.csv", "w", newline="") as file:
        csv.writer(file).writerows([columns, *(["" if math.isnan(cell) else cell for cell in row] for row in rows)])
    return folder / "metrics.csv"


def pair(ours, peer):
    return {"setting": "light", "seed": 0, **compare_sides(summarize(ours, TARGET), summarize(peer, TARGET))}


def test_seconds_leave_out_the_time_of_evaluations(tmp_path):
    rows = [(100, 0.2, math.nan, 5.0, 65.0), (200, math.nan, math.nan, 1.0, 90.0), (300, 0.5, math.nan, 5.0, 131.0)]
    curve = read_curve(write_csv(tmp_path, rows))
    assert curve == [Evaluation(60.0, 65.0, 100, 0.2, None), Evaluation(120.0, 131.0, 300, 0.5, None)]
    assert read_curve(tmp_path / "none.csv") == []


def test_the_peer_reaches_the_target_only_with_confirmation(tmp_path):
    rows = [(100, 0.92, 0.85, 5.0, 65.0), (200, 0.8, math.nan, 5.0, 130.0), (300, 0.9, 0.93, 5.0, 195.0)]
    assert first_at_target(read_curve(write_csv(tmp_path, rows)), TARGET).frames == 300
    names = [name for name in COLUMNS if name != "eval/confirmed"]
    plain = [[cell for column, cell in enumerate(row) if column != 2] for row in rows]
    assert first_at_target(read_curve(write_csv(tmp_path, plain, names)), TARGET).frames == 100


@pytest.mark.parametrize(
    ("peer", "line"),
    [
        ([Evaluation(600, 660, 50_000, 0.92, 0.91)], "ours/peer = 0.333 (seconds), = 2.000 (frames): holds"),
        ([Evaluation(400, 440, 50_000, 0.92, 0.91)], "ours/peer = 0.500 (seconds), = 2.000 (frames): does not hold"),
        ([Evaluation(800, 880, 50_000, 0.4, None)], "ours/peer < 0.250 (seconds), < 2.000 (frames): holds"),
        ([Evaluation(400, 440, 50_000, 0.4, None)], "ours/peer < 0.500 (seconds), < 2.000 (frames): not shown"),
        ([], "nothing to compare"),
    ],
)
def test_a_peer_below_the_target_gives_an_upper_bound(peer, line):
    ours = [Evaluation(200, 210, 100_000, 0.95, 0.95)]
    assert ratio_line(pair(ours, peer)) == f"light, seed 0: {line}"
    assert ("not after" in table([pair(ours, peer)], TARGET)) == ("<" in line)


def test_there_is_no_ratio_if_our_run_missed_the_target():
    peer, ours = [Evaluation(600, 660, 50_000, 0.92, 0.91)], [Evaluation(200, 210, 100_000, 0.5, 0.5)]
    assert ratio_line(pair(ours, peer)).endswith("nothing to compare")


def test_given_overrides_replace_the_defaults_of_our_side():
    words = our_overrides(["task=reach", "total_frames=10_000"], seed=3)
    assert [word for word in words if word.startswith("task=")] == ["task=reach"]
    assert {"robot=panda", "total_frames=10_000", "seed=3"} <= set(words)
