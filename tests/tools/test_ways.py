"""Ways of saying one thing: the program that compares other wordings with the plain sentence."""

import json

import pytest

import language.dialogue  # noqa: F401  # for the forks
from tests.helpers.programs import run_module
from tools.forked import ProcessResult

GROUPS = """\
#A
= put the red cube in the drawer
the red cube goes in the drawer
the red cube goes in the fridge
which cube is red?

#A
> touch the blue cube
= pick it up
= pick up the gray cube
pick up the blue cube
lift the gray cube
pick up the cyan cube
"""


def run(*arguments: str) -> ProcessResult:
    return run_module("benchmarks.ways", *arguments)


def test_ways_are_counted_by_what_comes_of_them(tmp_path):
    path = tmp_path / "groups.txt"
    path.write_text(GROUPS)
    done = run("--data", str(path), "--errors", "--json")
    total = json.loads(done.out.splitlines()[-1])["total"]
    assert total == {"ways": 6, "same": 3, "other plan": 2, "answer": 1}
    listed = [line for line in done.out.splitlines() if line.startswith("#A")]
    assert len(listed) == 3
    assert all(" got: " in line for line in listed)


@pytest.mark.parametrize("text", ["put it down\n", "#A\nput it down\n", "= put it down\n"])
def test_a_group_without_a_state_or_a_plain_sentence_is_named(tmp_path, text):
    path = tmp_path / "groups.txt"
    path.write_text(text)
    done = run("--data", str(path))
    assert done.code == 2
    assert not done.out
    assert "a group needs one line '#STATE' and a line '= plain sentence'" in done.err


def test_a_folder_without_files_is_named(tmp_path):
    done = run("--data", str(tmp_path))
    assert done.code == 2
    assert "no folder with *.txt" in done.err
