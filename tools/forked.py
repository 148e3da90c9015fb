"""Calls of a function in a forked child, with its output, exit status, seconds and memory.

A fork of a process that has imported everything starts within milliseconds, where a new process takes seconds.
"""

from __future__ import annotations

import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

TIMED_OUT = -signal.SIGKILL


@dataclass(frozen=True)
class ProcessResult:
    """How a call ended.

    code: its exit status; negative for a signal. cpu_seconds, memory: used by the call, bytes; 0 if it was killed.
    """

    code: int
    out: str
    err: str
    seconds: float
    cpu_seconds: float
    memory: int

    @property
    def has_traceback(self) -> bool:
        """Whether the call printed a traceback, or died of a signal."""
        return "Traceback (most recent call last)" in self.out + self.err or self.code < 0

    @property
    def message(self) -> str:
        """The line that begins with "error: ", without that; "" if there is no such line, or more than one."""
        lines = [line for line in self.err.splitlines() if "error: " in line[:40]]
        return lines[0].partition("error: ")[2] if len(lines) == 1 else ""


def call(function: Callable[[], object], folder: Path | None = None, timeout: float = 60.0) -> ProcessResult:
    """Call a function in a forked child.

    Args:
        function: its SystemExit and its exceptions become an exit status and text, as those of a program do.
        folder: working directory of the child.
        timeout: seconds after which the child is killed.
    """
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err, tempfile.TemporaryFile() as used:
        start = time.monotonic()
        child = os.fork()
        if not child:
            _run(function, folder, out.fileno(), err.fileno(), used.fileno())
        code = _wait(child, start + timeout)
        seconds = time.monotonic() - start
        for file in (out, err, used):
            file.seek(0)
        texts = [file.read().decode(errors="replace") for file in (out, err, used)]
    cpu_seconds, memory = map(float, (texts[2] or "0 0").split())
    return ProcessResult(code, texts[0], texts[1], seconds, cpu_seconds, int(memory))


def _run(function: Callable[[], object], folder: Path | None, out: int, err: int, used: int) -> None:
    """Call the function in the child and end it. Never returns."""
    code = 1
    try:
        os.setsid()
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        os.dup2(out, 1)
        os.dup2(err, 2)
        sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)  # noqa: SIM115
        if folder is not None:
            os.chdir(folder)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        code = _code(function)
        memory = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
        os.write(used, f"{time.process_time()} {memory}".encode())
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(code)


def _code(function: Callable[[], object]) -> int:
    """Return the exit status that Python gives a program that calls the function."""
    try:
        function()
    except SystemExit as end:
        if isinstance(end.code, int) or end.code is None:
            return end.code or 0
        print(end.code, file=sys.stderr)
        return 1
    except BaseException:
        traceback.print_exc()
        return 1
    return 0


def _wait(child: int, deadline: float) -> int:
    """Return the exit status of the child, which is killed with its process group at the deadline."""
    while time.monotonic() < deadline:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.005)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return TIMED_OUT
