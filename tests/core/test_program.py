"""Standard streams that are closed or full, and what a machine refuses: a program ends with one line."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from core.errors import ConfigError
from core.program import help_text, program, refusal

ROOT = Path(__file__).parents[2]
DEIXIS = "-c 'from deixis.cli import main; main()' --help"
HELP = ("evaluate.py --help", "record.py -h", "play.py --help", DEIXIS, "-m language --help")
CLOSED = ("<&-", ">&-", "2>&-", "<&- >&- 2>&-", ">/dev/full", "2>/dev/full")


def shell(command: str, options: str = "") -> subprocess.CompletedProcess:
    """Run `python <command>` in a shell, whose redirections close streams."""
    line = f'exec "{sys.executable}" {options} {command}'
    env = {**os.environ, "PYTHONUNBUFFERED": ""}
    return subprocess.run(["bash", "-c", line], capture_output=True, text=True, cwd=ROOT, timeout=120, env=env)


def programs(sample: int, thorough: bool) -> list[tuple[str, str]]:
    every = [(words, closed) for words in (*HELP, "-m language parse -") for closed in CLOSED]
    return every if thorough else every[:: len(every) // sample]


@pytest.mark.slow
def test_a_program_with_closed_or_full_streams_ends_without_a_traceback(request):
    for words, closed in programs(7, request.config.getoption("--thorough")):
        done = shell(f"{words} {closed}")
        full = closed == ">/dev/full" and "parse" not in words
        assert done.returncode == (2 if "language" in words else 1) * full, (words, closed, done)
        assert "Traceback" not in done.stdout + done.stderr, (words, closed)
        if full:
            assert done.stderr == "error: stdout: No space left on device; free some space, or choose another place\n"


@pytest.mark.slow
def test_help_is_printed_without_docstrings(request):
    for words in HELP if request.config.getoption("--thorough") else HELP[:1]:
        assert "None" not in (text := shell(words, "-OO").stdout)
        assert len(text) > 300
    done = shell("evaluate.py checkpoint=nl_reach_kuka", "-OO")
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert "error: python -OO leaves out docstrings" in done.stderr


def test_the_help_of_a_program_is_the_docstring_of_its_file():
    assert help_text(str(ROOT / "evaluate.py")).startswith("Evaluate a policy on fresh episodes")


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (OSError(errno.ENOSPC, "No space left on device", "/a/b"), "/a/b: No space left on device; free some space"),
        (OSError(errno.EMFILE, "Too many open files"), "Too many open files; raise the limit of open files"),
        (BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable"), "raise the limit of processes"),
        (RuntimeError("can't start new thread"), "can't start new thread; raise the limit of processes"),
        (RuntimeError("unable to write </torch_1>: No space left on device (28)"), "No space left on device"),
        (MemoryError(), "the memory is used up"),
        (ConfigError("seed=x"), "seed=x"),
        (ConfigError("name=\x1b[2J\x07\u009b"), "name=?[2J??"),  # nothing that a terminal would obey
    ],
)
def test_what_the_machine_refuses_is_one_line(error, message, capsys):
    with pytest.raises(SystemExit) as caught, program():
        raise error
    assert caught.value.code.startswith("error: ")
    assert message in caught.value.code
    assert "\n" not in caught.value.code
    with pytest.raises(SystemExit, match="2"), program(failed=2):
        raise error
    assert message in capsys.readouterr().err


def test_other_errors_keep_their_traceback():
    with pytest.raises(RuntimeError, match="a bug"), program():
        raise RuntimeError("a bug")
    with pytest.raises(FileNotFoundError), program():
        raise FileNotFoundError(errno.ENOENT, "No such file", "x")
    assert refusal(KeyError("x")) is None
