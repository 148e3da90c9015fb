"""Messages of commits: what is refused, and which commits are checked."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tools.commit_message import SMALL, changed_lines, check_commits, main, problems, written

GOOD = "trainers: registry of algorithms\n\nEach algorithm was named in three places."


@pytest.mark.parametrize(
    ("message", "lines"),
    [
        (GOOD, 500),
        ("docs: a comma", SMALL),
        ("envs, human: a ray has two ends\n\nThey differ.", 40),
        ("train.py: a flag\n\nIt was missing.\n", 40),
        ('Revert "docs: a comma"\n\nThis reverts commit 123.', 40),
    ],
)
def test_a_good_message_has_no_problems(message, lines):
    assert problems(message, lines) == []


@pytest.mark.parametrize(
    ("message", "lines", "said"),
    [
        ("Registry of algorithms\n\nWhy.", 50, "area: what"),
        ("wip", 1, "area: what"),
        ("docs:\n\nWhy.", 1, "area: what"),
        ("", 1, "area: what"),
        ("fixup! docs: a comma", 1, "area: what"),
        (f"docs: {'x' * 67}\n\nWhy.", 50, "73 characters"),
        ("docs: a page\nWhy.", 50, "empty line"),
        ("docs: a page", SMALL + 1, "11 lines"),
        ("docs: a page\n\n   \n", SMALL + 1, "say why"),
    ],
)
def test_a_bad_message_is_refused_with_its_mistake(message, lines, said):
    found = problems(message, lines)
    assert len(found) == 1
    assert said in found[0]


def test_comments_and_the_diff_are_no_part_of_a_message():
    text = GOOD + "\n# Please enter the message\n# ------------------------ >8 ------------------------\ndiff --git"
    assert written(text) == GOOD


def test_lines_of_binary_files_count_as_none():
    assert changed_lines("3\t4\ta.py\n-\t-\tdemo.gif\n1\t0\tb c.md\n") == 8


@pytest.fixture
def repository(tmp_path):
    """A repository whose second commit adds the program, after a message that breaks the rule."""
    git(tmp_path, "init", "-q")
    commit(tmp_path, "a.txt", "Whatever I did before the rule")
    commit(tmp_path, "tools/commit_message.py", "tools: messages are checked\n\nThey were too long.")
    return tmp_path


def git(folder: Path, *words: str) -> str:
    identity = ["-c", "user.name=A", "-c", "user.email=a@example.org", "-c", "commit.gpgsign=false"]
    return subprocess.run(["git", *identity, *words], cwd=folder, check=True, capture_output=True, text=True).stdout


def commit(folder: Path, name: str, message: str, lines: int = 20) -> None:
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    path.write_text("line\n" * lines, encoding="utf-8")
    git(folder, "add", name)
    git(folder, "commit", "-q", "-m", message)


def test_commits_since_the_rule_are_checked_and_earlier_ones_are_not(repository):
    assert check_commits(repository) == ([], "1 commit messages are checked")
    commit(repository, "b.txt", "docs: a page\n\nIt was missing.")
    commit(repository, "c.txt", "docs: another page")
    commit(repository, "d.txt", "wip", lines=1)
    found, about = check_commits(repository)
    assert about == "4 commit messages are checked"
    assert len(found) == 2
    assert "'wip'" in found[0]
    assert "'docs: another page' changes 20 lines" in found[1]


def test_a_shallow_clone_and_a_folder_without_git_pass_and_say_so(repository, tmp_path_factory):
    commit(repository, "b.txt", "wip")
    clone = tmp_path_factory.mktemp("shallow")
    git(clone, "clone", "-q", "--depth=1", repository.as_uri(), "clone")
    found, about = check_commits(clone / "clone")
    assert (found, "shallow" in about) == ([], True)
    found, about = check_commits(tmp_path_factory.mktemp("none"))
    assert (found, "no git repository" in about) == ([], True)


def test_a_folder_inside_of_another_repository_passes_and_says_so(repository):
    found, about = check_commits(repository / "tools")
    assert (found, "of its own" in about) == ([], True)


def test_the_hook_refuses_a_message_of_what_is_staged(repository, monkeypatch, capsys):
    monkeypatch.chdir(repository)
    (repository / "e.txt").write_text("line\n" * 20)
    git(repository, "add", "e.txt")
    message = repository / "message"
    message.write_text("docs: a page\n# a comment\n")
    assert main([str(message)]) == 1
    assert "changes 20 lines" in capsys.readouterr().err
    message.write_text("fixup! docs: a page\n")
    assert main([str(message)]) == 0
