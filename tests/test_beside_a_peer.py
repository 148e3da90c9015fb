"""benchmarks/pick_and_place.py: what two metrics.csv say of who got there first. Nothing of the peer is needed."""

import csv
import math

import pytest

from benchmarks.pick_and_place import COLUMNS, Point, arrival, compared, our_overrides, ratio_line, read_curve, table

TARGET = 0.9


def written(folder, rows, columns=COLUMNS):
    with open(folder / "metrics.csv", "w", newline="") as file:
        csv.writer(file).writerows([columns, *(["" if math.isnan(cell) else cell for cell in row] for row in rows)])
    return folder / "metrics.csv"


def side(curve):
    there = arrival(curve, TARGET)
    last = curve[-1]._asdict() if curve else None
    best = max((point.success for point in curve), default=None)
    return {"reached": there._asdict() if there else None, "last": last, "best": best}


def pair(ours, peer):
    return {"setting": "light", "seed": 0, **compared(side(ours), side(peer))}


def test_seconds_leave_every_evaluation_so_far_out(tmp_path):
    rows = [(100, 0.2, math.nan, 5.0, 65.0), (200, math.nan, math.nan, 1.0, 90.0), (300, 0.5, math.nan, 5.0, 131.0)]
    curve = read_curve(written(tmp_path, rows))
    assert curve == [Point(60.0, 65.0, 100, 0.2, None), Point(120.0, 131.0, 300, 0.5, None)]
    assert read_curve(tmp_path / "none.csv") == []


def test_the_peer_is_there_once_it_is_confirmed_and_ours_at_once(tmp_path):
    rows = [(100, 0.92, 0.85, 5.0, 65.0), (200, 0.8, math.nan, 5.0, 130.0), (300, 0.9, 0.93, 5.0, 195.0)]
    assert arrival(read_curve(written(tmp_path, rows)), TARGET).frames == 300
    names = [name for name in COLUMNS if name != "eval/confirmed"]
    plain = [[cell for column, cell in enumerate(row) if column != 2] for row in rows]
    assert arrival(read_curve(written(tmp_path, plain, names)), TARGET).frames == 100


@pytest.mark.parametrize(
    ("peer", "told"),
    [
        ([Point(600, 660, 50_000, 0.92, 0.91)], "ours/peer = 0.333 (seconds), = 2.000 (frames): holds"),
        ([Point(400, 440, 50_000, 0.92, 0.91)], "ours/peer = 0.500 (seconds), = 2.000 (frames): does not hold"),
        ([Point(800, 880, 50_000, 0.4, None)], "ours/peer < 0.250 (seconds), < 2.000 (frames): holds"),
        ([Point(400, 440, 50_000, 0.4, None)], "ours/peer < 0.500 (seconds), < 2.000 (frames): not shown"),
        ([], "nothing to compare"),
    ],
)
def test_a_peer_that_did_not_get_there_gives_a_bound(peer, told):
    ours = [Point(200, 210, 100_000, 0.95, 0.95)]
    assert ratio_line(pair(ours, peer)) == f"light, seed 0: {told}"
    assert ("not after" in table([pair(ours, peer)], TARGET)) == ("<" in told)


def test_ours_that_did_not_get_there_compares_with_nothing():
    peer, ours = [Point(600, 660, 50_000, 0.92, 0.91)], [Point(200, 210, 100_000, 0.5, 0.5)]
    assert ratio_line(pair(ours, peer)).endswith("nothing to compare")


def test_what_is_typed_takes_the_place_of_what_is_ours():
    words = our_overrides(["task=reach", "total_frames=10_000"], seed=3)
    assert [word for word in words if word.startswith("task=")] == ["task=reach"]
    assert {"robot=panda", "total_frames=10_000", "seed=3"} <= set(words)
