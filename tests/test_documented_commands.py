"""Every fenced command of README and docs is run by benchmarks/commands.py, or it says why not; overrides compose."""

import os
import re
import shlex
import sys

import pytest

from benchmarks.commands import Command, commands, copied, environment_of, pages, preparations, run, shortened
from conf.overrides import check, compose, groups
from conf.schema import ConfigError

EVERY = [command for page in pages() for command in commands(page)]
TRAINED = sorted({command.line for command in EVERY if "train.py" in command.line and "--help" not in command.line})
ADDED = {"twins", "hover", "ur5", "a2c"}  # options that a page has its reader add


def test_every_fenced_command_is_run_or_listed_with_its_reason():
    assert len(EVERY) > 60
    for command in EVERY:
        program = shortened(command.line).rpartition("&& ")[2]
        assert command.reason or re.match(r"python (\w+\.py|-m [\w.]+)( |$)|cat ", program), command
        assert command.reason or not re.search(r"<\w", program), command


def test_every_fence_is_of_a_known_kind():
    for page in pages():
        kinds = re.findall(r"^```(\w*)$", page.read_text("utf-8"), re.MULTILINE)[::2]
        assert set(kinds) <= {"", "console", "python", "yaml", "diff"}, page


def test_a_line_that_is_no_command_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("benchmarks.commands.ROOT", tmp_path)
    (tmp_path / "page.md").write_text("```\npython train.py\nrm -r /\n```\n")
    with pytest.raises(ValueError, match=r"page\.md: 'rm -r /' is not a command"):
        list(commands(tmp_path / "page.md"))


@pytest.mark.parametrize("line", TRAINED)
def test_its_overrides_compose(line):
    words = shlex.split(re.sub(r"<[\w ]+>", "somewhere", line.rpartition("train.py")[2]))
    words = [word for word in words if not word.startswith(("-", "sweep.resume="))]
    known = [word for word in words if word.partition("=")[2] not in ADDED]
    compose([re.sub(r"=([^\[,]+),.*", r"=\1", word) for word in known])  # of a sweep the first
    added = {word.partition("=")[2]: word.partition("=")[0] for word in words if word not in known}
    assert set(added.values()) <= set(groups())


def test_what_is_shortened_still_composes():
    for line in ("python train.py algo=sac", "python train.py scenario=5", "python train.py -m seed=0,1 sweep.jobs=8"):
        short = shortened(line)
        words = [word for word in shlex.split(short)[2:] if word != "-m"]
        check(words)
        config = compose(words)
        assert config.total_frames == 512
        assert config.sweep.jobs == 2
    assert "seed=0 " in short


def test_only_what_is_asked_for_is_made_before():
    sweep = preparations([Command("here", "python -m trainers.reports.report <sweep dir>")])
    assert [command.line.rpartition("=")[2] for command in sweep] == ["prepared/sweep"]
    replay = preparations([Command("here", "python -m trainers.record replay=<dataset dir>")])
    assert [command.line.rpartition("=")[2] for command in replay] == ["prepared/nl_reach", "prepared/dataset"]
    assert preparations([Command("here", "python -m language count")]) == []


def test_commands_run_in_a_copy_and_failures_are_told(tmp_path):
    folder = copied(tmp_path / "copy")
    assert (folder / "scene.yaml").is_file()
    environment = environment_of(folder, fresh=False)
    shown = next(command for command in EVERY if "bleu" in command.line)
    for command in (shown, Command("here", "python -m language sample --n 2 --steps 2")):
        good, line = run(command, folder, environment, timeout=60)
        assert good, line
    good, line = run(Command("here", "python -m language pars"), folder, environment, timeout=60)
    assert not good
    assert "FAILED" in line
    assert "pars" in line.splitlines()[-1]
    good, line = run(Command("here", 'python -c "while True: pass"'), folder, environment, timeout=1)
    assert not good
    assert "took more than 1 s" in line
    assert sys.executable in (folder / ".bin" / "python").read_text()
    assert os.environ.get("PYTHONPATH") != str(folder)


def test_an_option_that_is_wrong_would_be_noticed():
    with pytest.raises(ConfigError):
        check(["task=hoover"])
