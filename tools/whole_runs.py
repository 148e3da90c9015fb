"""Whole runs of train.py in processes of their own: start, stop by a signal, finish, and compare bit for bit."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch

from trainers.run import checkpoint
from trainers.run.metrics import read_metrics

ROOT = Path(__file__).resolve().parents[1]
SMALL = ["collector.worlds=4", "eval.episodes=4", "eval.interval_episodes=4", "eval.worlds=4", "eval.video_episodes=0"]
SMALL += ["logger=[]", "algo.grounding_scenes=8", "algo.grounding_batch=16"]
ALGORITHMS = {  # overrides of runs of ten iterations
    "ppo": ["algo.horizon=16", "algo.minibatch=32", "total_frames=640", "eval.interval=192"],
    "sac": ["algo.horizon=16", "algo.batch=16", "algo.learning_starts=64", "total_frames=640", "eval.interval=192"],
}
START_SECONDS = 600.0  # a run that takes longer counts as one that hangs


def command(folder: Path, *words: str) -> list[str]:
    """Return the command line of a run in `folder`."""
    return [sys.executable, str(ROOT / "train.py"), f"hydra.run.dir={folder}", *words]


def start(words: Sequence[str]) -> subprocess.Popen:
    """Start a run in a process group of its own."""
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    return subprocess.Popen(
        words, cwd=ROOT, env=environment, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )


def finish(words: Sequence[str]) -> str:
    """Run to the end; return the error, or ""."""
    process = start(words)
    try:
        _, errors = process.communicate(timeout=START_SECONDS)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return "it hangs"
    return f"exit code {process.returncode}: {errors.decode()[-300:]}" if process.returncode else ""


def stop_at(process: subprocess.Popen, folder: Path, rows: int, number: int) -> str:
    """Send a signal to the run's group once metrics.csv has `rows` rows and there is a checkpoint; return the error."""
    deadline = time.monotonic() + START_SECONDS
    last = folder / "checkpoints" / "last.pt"
    while not (last.exists() and len(rows_of(folder)) >= rows) and process.poll() is None:
        if time.monotonic() > deadline:
            break
        time.sleep(0.02)
    if process.poll() is None:
        os.killpg(process.pid, number)
    try:
        process.communicate(timeout=60)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return "it does not end after a signal"
    return ""


def rows_of(folder: Path) -> list[dict[str, float]]:
    """Return the rows of metrics.csv without the timings."""
    try:
        rows = read_metrics(folder / "metrics.csv")
    except ValueError:  # read while it is written
        return []
    return [{name: value for name, value in row.items() if not name.startswith("time/")} for row in rows]


def differences(one: Path, other: Path) -> str:
    """Return the differences of two finished runs; "" if there are none."""
    if repr(rows_of(one)) != repr(rows_of(other)):
        return "metrics.csv differs"
    a, b = (checkpoint.load(folder / "checkpoints" / "last.pt")["algorithm"] for folder in (one, other))
    return "" if same(a, b) else "the weights differ"


def same(a: Any, b: Any) -> bool:
    """Return whether two nested values are equal, bit for bit."""
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(map(same, a, b))
    return torch.equal(a, b) if torch.is_tensor(a) else a == b
