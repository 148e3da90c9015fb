"""Runs with collector=ray of which a process of Ray is killed."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

from tests.helpers.processes import parent_of, start_train

SMALL = (
    *("total_frames=2048", "collector.worlds=8", "collector.workers=2", "algo.horizon=16", "algo.minibatch=64"),
    *("eval.interval=100000", "eval.episodes=2", "eval.worlds=2", "eval.video_episodes=0", "logger=[]"),
)
SECONDS = 300.0  # for the whole run


def killed_run(folder: Path, pattern: str, rows: int) -> subprocess.CompletedProcess[str]:
    """Return a run that has ended, of which the processes whose command has `pattern` were killed once.

    rows: of metrics.csv at that moment; -1: as soon as there is such a process.
    """
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    process = start_train("collector=ray", *SMALL, f"hydra.run.dir={folder}", **pipes)
    deadline = time.monotonic() + SECONDS
    while process.poll() is None and time.monotonic() < deadline:
        if (found := _descendants(process.pid, pattern)) and _rows(folder) >= rows:
            for each in found:
                os.kill(each, signal.SIGKILL)
            break
        time.sleep(0.1)
    try:
        out, err = process.communicate(timeout=max(1.0, deadline - time.monotonic()))
    except subprocess.TimeoutExpired:
        process.terminate()
        out, err = process.communicate()
        return subprocess.CompletedProcess([], -1, out, err)
    return subprocess.CompletedProcess([], process.returncode, out, err)


def killed_program(words: list[str], folder: Path, pattern: str, seconds: float) -> subprocess.CompletedProcess[str]:
    """Return how a program ended, of which the processes whose command has `pattern` were killed.

    Args:
        words: of the command, after python.
        folder: in which it runs.
        pattern: of the processes of Ray.
        seconds: after the start of the first of them.
    """
    process = subprocess.Popen(
        [sys.executable, *words], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    deadline = time.monotonic() + SECONDS
    while process.poll() is None and time.monotonic() < deadline and not _descendants(process.pid, pattern):
        time.sleep(0.1)
    time.sleep(seconds)
    for each in _descendants(process.pid, pattern):
        os.kill(each, signal.SIGKILL)
    try:
        out, err = process.communicate(timeout=max(1.0, deadline - time.monotonic()))
    except subprocess.TimeoutExpired:
        process.terminate()
        out, err = process.communicate()
    return subprocess.CompletedProcess([], process.returncode, out, err)


def _rows(folder: Path) -> int:
    path = folder / "metrics.csv"
    return len(path.read_text().splitlines()) - 1 if path.is_file() else -1


def _descendants(process: int, pattern: str) -> list[int]:
    """Return the descendants of a process whose command line has the pattern."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                command = (entry / "cmdline").read_text().replace("\0", " ")
                if re.search(pattern, command) and _descends(int(entry.name), process):
                    found.append(int(entry.name))
            except (OSError, ValueError):
                continue
    return found


def _descends(process: int, ancestor: int) -> bool:
    while process > 1 and process != ancestor:
        process = parent_of(process)
    return process == ancestor
