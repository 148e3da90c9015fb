"""The fenced commands of README and docs/: each is run or has a reason not to be; overrides compose."""

import os
import re
import shlex
import sys

import pytest

from core.errors import ConfigError
from core.overrides import check, compose, groups
from tools.documented_commands import (
    Command,
    apply_diff,
    commands_of,
    copy_project,
    make_environment,
    pages,
    preparation_commands,
    run_command,
    shorten,
)

COMMANDS = [command for page in pages() for command in commands_of(page)]
TRAINING = sorted({each.line for each in COMMANDS if "train.py" in each.line and "--help" not in each.line})
ADDED_OPTIONS = {"twins", "hover", "ur10", "ddpg", "awr", "joint_step"}  # options that a page tells its reader to add


def test_every_command_is_run_or_has_a_skip_reason():
    assert len(COMMANDS) > 60
    for command in COMMANDS:
        program = shorten(command.line).rpartition("&& ")[2]
        assert command.skip_reason or re.match(r"python (\w+\.py|-m [\w.]+)( |$)|cat ", program), command
        assert command.skip_reason or not re.search(r"<\w", program), command


def test_every_fence_has_a_known_language():
    for page in pages():
        languages = re.findall(r"^```(\w*)$", page.read_text("utf-8"), re.MULTILINE)[::2]
        assert set(languages) <= {"", "console", "python", "yaml", "toml", "diff"}, page


def test_a_line_that_is_not_a_command_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("tools.documented_commands.ROOT", tmp_path)
    (tmp_path / "page.md").write_text("```\npython train.py\nrm -r /\n```\n")
    with pytest.raises(ValueError, match=r"page\.md: 'rm -r /' is not a known command"):
        list(commands_of(tmp_path / "page.md"))


@pytest.mark.slow
@pytest.mark.parametrize("line", TRAINING)
def test_overrides_of_a_training_command_compose(line):
    words = shlex.split(re.sub(r"<[\w ]+>", "somewhere", line.rpartition("train.py")[2]))
    words = [word for word in words if not word.startswith(("-", "sweep.resume="))]
    known = [word for word in words if word.partition("=")[2] not in ADDED_OPTIONS]
    compose([re.sub(r"=([^\[,]+),.*", r"=\1", word) for word in known])  # the first value of a sweep
    added = {word.partition("=")[2]: word.partition("=")[0] for word in words if word not in known}
    assert set(added.values()) <= set(groups())


@pytest.mark.slow
def test_shortened_commands_compose():
    for line in ("python train.py algo=sac", "python train.py scenario=5", "python train.py -m seed=0,1 sweep.jobs=8"):
        short = shorten(line)
        words = [word for word in shlex.split(short)[2:] if word != "-m"]
        check(words)
        config = compose(words)
        assert config.total_frames == 512
        assert config.sweep.jobs == 2
    assert "seed=0 " in short


def test_only_required_preparations_are_made():
    sweep = preparation_commands([Command("here", "python -m trainers.reports.report <sweep dir>")])
    assert [command.line.rpartition("=")[2] for command in sweep] == ["prepared/sweep"]
    replay = preparation_commands([Command("here", "python record.py replay=<dataset dir>")])
    assert [command.line.rpartition("=")[2] for command in replay] == ["prepared/nl_reach", "prepared/dataset"]
    assert preparation_commands([Command("here", "python -m language count")]) == []


@pytest.mark.slow
def test_commands_run_in_a_copy_and_failures_are_reported(tmp_path):
    folder = copy_project(tmp_path / "copy")
    assert (folder / "scene.yaml").is_file()
    environment = make_environment(folder, fresh=False)
    shown = next(command for command in COMMANDS if "bleu" in command.line)
    for command in (shown, Command("here", "python -m language sample --n 2 --steps 2")):
        ok, line = run_command(command, folder, environment, timeout=60)
        assert ok, line
    ok, line = run_command(Command("here", "python -m language pars"), folder, environment, timeout=60)
    assert not ok
    assert "FAILED" in line
    assert "pars" in line.splitlines()[-1]
    ok, line = run_command(Command("here", 'python -c "while True: pass"'), folder, environment, timeout=1)
    assert not ok
    assert "took more than 1 s" in line
    assert sys.executable in (folder / ".bin" / "python").read_text()
    assert os.environ.get("PYTHONPATH") != str(folder)


def test_an_unknown_option_is_refused():
    with pytest.raises(ConfigError):
        check(["task=hoover"])


def test_a_diff_is_applied_only_where_its_old_lines_occur_once():
    assert apply_diff("a\nb\n", " a\n+c\n") == "a\nc\nb\n"
    with pytest.raises(ValueError, match="found 0 times"):
        apply_diff("a\nb\n", "-c\n+d\n")
    with pytest.raises(ValueError, match="found 2 times"):
        apply_diff("a\na\n", " a\n+d\n")
