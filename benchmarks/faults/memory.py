"""The resources that a very long run holds: memory, file descriptors and threads."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from random import Random

import numpy as np

from benchmarks.faults.rows import Outcome, row
from benchmarks.faults.runs import command, start
from trainers.run.metrics import read_metrics

FRAMES = 10_000_000
# Cheap physics and networks: only the number of frames matters.
WORDS = ["task=reach", "policy=mlp", "policy.hidden=[32,32]", "policy.critic_hidden=[32,32]", "physics.substeps=1"]
WORDS += ["collector.worlds=64", "algo.epochs=1", "algo.horizon=64", "algo.minibatch=4096", "eval.episodes=10"]
WORDS += ["eval.interval=200_000", "eval.interval_episodes=10", "eval.worlds=10", "eval.video_episodes=0", "logger=[]"]
WARM_UP = 0.05  # of the frames, before which nothing counts
GROWTH = 1.05  # allowed
SECONDS = 5.0  # between two looks


def processes(leader: int) -> list[int]:
    """Return the processes of a session."""
    ids = (int(path.name) for path in Path("/proc").iterdir() if path.name.isdecimal())
    return [pid for pid in ids if _session(pid) == leader]


def _session(pid: int) -> int:
    try:
        return os.getsid(pid)
    except ProcessLookupError:
        return -1


def usage(leader: int) -> tuple[float, int, int]:
    """Return MB (a shared page counts once), file descriptors and threads of a session's processes."""
    kilobytes = descriptors = threads = 0
    for pid in processes(leader):
        folder = Path(f"/proc/{pid}")
        try:
            lines = (folder / "smaps_rollup").read_text().splitlines()
            kilobytes += next(int(line.split()[1]) for line in lines if line.startswith("Pss:"))
            descriptors += len(list((folder / "fd").iterdir()))
            threads += len(list((folder / "task").iterdir()))
        except (FileNotFoundError, ProcessLookupError, StopIteration):
            continue  # it has ended
    return kilobytes / 1024, descriptors, threads


def frames_of(folder: Path) -> float:
    """Return how many frames the run has taken."""
    try:
        return read_metrics(folder / "metrics.csv")[-1]["frames"]
    except (ValueError, IndexError):
        return 0.0


@row("memory", "a run of millions of frames: memory grows by less than 5 %, descriptors and threads do not", FRAMES)
def memory(tries: int, random: Random, folder: Path) -> Outcome:
    """tries: the frames."""
    outcome, seen = Outcome(tries=1), list[tuple[float, ...]]()
    began = time.monotonic()
    process = start(command(folder / "run", *WORDS, f"total_frames={tries}"))
    try:
        while process.poll() is None:
            time.sleep(SECONDS)
            if WARM_UP * tries <= frames_of(folder / "run") < 0.99 * tries:
                seen.append(usage(process.pid))
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        _, errors = process.communicate()
    if process.returncode or not seen:
        outcome.failures.append(f"exit code {process.returncode}: {errors.decode()[-300:]}")
        return outcome
    tenth = max(len(seen) // 10, 1)
    first, last = (np.median(part, axis=0) for part in (seen[:tenth], seen[-tenth:]))
    outcome.figures = {"frames": int(frames_of(folder / "run")), "frames/s": round(tries / (time.monotonic() - began))}
    for name, before, after in zip(("MB", "descriptors", "threads"), first.tolist(), last.tolist(), strict=True):
        outcome.figures[name] = [round(before, 1), round(after, 1)]
        if after > before * (GROWTH if name == "MB" else 1.0):
            outcome.failures.append(f"{name} grow from {before:.1f} to {after:.1f}")
    return outcome
