"""The project's own instruction sets: how many expectations are met, through the function that the page calls."""

import json
from pathlib import Path

import pytest

import language.dialogue  # noqa: F401  # for the forks
from tests.helpers.programs import run_module
from tests.helpers.thorough import option

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_the_own_sets_are_understood_as_well_as_when_they_were_measured():
    every, number = (1, 6433) if option["thorough"] else (12, 556)  # a conversation is one line, and stays whole
    words = ["--data", "benchmarks/sets", "--json", "--every", str(every)]
    done = run_module("benchmarks.instructions", *words, timeout=1200)
    assert done.code == 0, done.err
    total = json.loads(done.out.splitlines()[-1])["total"]
    assert total["n"] == number
    assert total["met"] >= 0.92 * total["n"]
    assert total["wrong"] <= 0.01 * total["n"]
    assert total["refused unhelpfully"] <= 0.02 * total["n"]


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ('{"id": 1', "line 1 is not JSON"),
        ('{"id": "a", "state": "A"}', "line 1 lacks say, expect"),
        ('{"id": "a", "state": "Q", "say": "stop", "expect": []}', "state=Q is not in"),
        ('{"id": "a", "scene": "none.yaml", "say": "stop", "expect": []}', "none.yaml cannot be read"),
    ],
)
def test_a_set_that_cannot_be_said_is_refused_in_one_line(tmp_path, line, told):
    (tmp_path / "room.yaml").write_bytes((ROOT / "benchmarks" / "sets" / "room.yaml").read_bytes())
    (tmp_path / "own.jsonl").write_text(line)
    done = run_module("benchmarks.instructions", "--data", str(tmp_path / "own.jsonl"))
    assert done.code == 2
    assert told in done.err
    assert len(done.err.splitlines()) == 1
