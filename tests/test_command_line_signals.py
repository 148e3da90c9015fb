"""train.py as a process: signals, and workers that are killed. Real worlds in two workers."""

from __future__ import annotations

import os
import re
import shlex
import signal
import subprocess
import time
from pathlib import Path

import pytest

from tests.helpers.processes import left_over, start_train, workers_of
from trainers.run.metrics import read_metrics

pytestmark = pytest.mark.slow


@pytest.fixture
def running(tmp_path, request):
    """A training run with two workers, past its first batch."""
    words = ["collector.workers=2", "collector.worlds=8", "eval.worlds=4", "logger=[]", "algo.horizon=32"]
    words += getattr(request, "param", [])
    with open(tmp_path / "out.txt", "w") as out:
        process = start_train(*words, f"hydra.run.dir={tmp_path}", stdout=out.fileno(), stderr=subprocess.PIPE)
    deadline = time.monotonic() + 90
    while len(read_metrics(tmp_path / "metrics.csv")) < 2 and time.monotonic() < deadline:
        time.sleep(0.2)
    yield process, tmp_path
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
    process.communicate()


def stop(process: subprocess.Popen, folder: Path, number: signal.Signals) -> str:
    """Sends the signal, checks that the run saves and leaves no process, and returns what it wrote to stderr."""
    if number == signal.SIGINT:
        os.killpg(process.pid, number)  # as a terminal does: the workers hear it too
    else:
        process.send_signal(number)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 128 + number, errors
    assert (folder / "checkpoints" / "last.pt").is_file()
    assert left_over(process.pid, 10) == []
    assert "Traceback" not in errors
    return errors


def test_ctrl_c_saves_says_how_to_go_on_and_leaves_no_process(running):
    process, folder = running
    stop(process, folder, signal.SIGINT)
    last = (folder / "out.txt").read_text().splitlines()[-1]
    assert re.fullmatch(r"stopped: \d+ frames are saved in .*/last\.pt; go on with: python train\.py .*", last)
    assert shlex.split(last.partition("go on with: ")[2])[2:] == [f"resume={folder}"]


def kill_a_worker(process):
    workers = workers_of(process.pid)
    assert len(workers) == 2
    os.kill(workers[-1], signal.SIGKILL)


def test_a_killed_worker_is_replaced_the_run_continues_and_sigterm_saves_it(running):
    process, folder = running
    kill_a_worker(process)
    rows, deadline = len(read_metrics(folder / "metrics.csv")), time.monotonic() + 90
    while len(read_metrics(folder / "metrics.csv")) < rows + 3 and time.monotonic() < deadline:
        time.sleep(0.2)
    assert process.poll() is None
    errors = stop(process, folder, signal.SIGTERM)
    assert "was killed by signal 9 (SIGKILL); it is replaced" in errors


@pytest.mark.parametrize("running", [["collector.restarts=0"]], indirect=True)
def test_a_killed_worker_ends_a_run_that_allows_no_restarts(running):
    process, folder = running
    kill_a_worker(process)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "was killed by signal 9 (SIGKILL); collector.restarts=0 allows no more restarts" in errors
    assert (folder / "checkpoints" / "last.pt").is_file()
    assert left_over(process.pid, 10) == []
