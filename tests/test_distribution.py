"""Which process runs which tests."""

from pathlib import Path
from types import SimpleNamespace

from tests.helpers.distribution import GROUPS, LONGEST, group_of, sort_longest_first

ROOT = Path(__file__).resolve().parent.parent


def test_groups_and_the_longest_files_exist():
    assert [file for file in GROUPS if not (ROOT / file).is_file()] == []
    assert [name for name in LONGEST if not (ROOT / name).is_file() and name not in GROUPS.values()] == []


def test_a_group_of_files_and_a_file_without_a_group_are_run_as_a_whole():
    first, *_ = GROUPS
    assert group_of(f"{first}::test_it[a::b]") == GROUPS[first]
    assert group_of("tests/test_play.py::test_it[a::b]") == "tests/test_play.py"


def test_the_longest_files_come_first_and_the_order_within_a_file_stays(monkeypatch):
    monkeypatch.setattr("tests.helpers.distribution.LONGEST", ["long.py"])
    names = ["short.py::1", "long.py::1", "short.py::2", "long.py::2"]
    items = [SimpleNamespace(nodeid=name) for name in names]
    sort_longest_first(items)
    assert [item.nodeid for item in items] == ["long.py::1", "long.py::2", "short.py::1", "short.py::2"]
