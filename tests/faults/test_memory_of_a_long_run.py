"""The resources that a very long run holds: memory, file descriptors and threads."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from tools.whole_runs import command, start
from trainers.run.metrics import read_metrics

FRAMES = 1_500_000
# Cheap physics and networks: only the number of frames matters.
WORDS = ["task=reach", "policy=mlp", "policy.hidden=[32,32]", "policy.critic_hidden=[32,32]", "physics.substeps=1"]
WORDS += ["collector.worlds=64", "algo.epochs=1", "algo.horizon=64", "algo.minibatch=4096", "eval.episodes=10"]
WORDS += ["eval.interval=200_000", "eval.interval_episodes=10", "eval.worlds=10", "eval.video_episodes=0", "logger=[]"]
WARM_UP = 0.05  # of the frames, before which nothing counts
GROWTH = 1.05  # allowed
SECONDS = 5.0  # between two looks


def _processes(leader: int) -> list[int]:
    """Return the processes of a session."""
    ids = (int(path.name) for path in Path("/proc").iterdir() if path.name.isdecimal())
    return [pid for pid in ids if _session(pid) == leader]


def _session(pid: int) -> int:
    try:
        return os.getsid(pid)
    except ProcessLookupError:
        return -1


def _usage(leader: int) -> tuple[float, int, int]:
    """Return MB (a shared page counts once), file descriptors and threads of a session's processes."""
    kilobytes = descriptors = threads = 0
    for pid in _processes(leader):
        folder = Path(f"/proc/{pid}")
        try:
            lines = (folder / "smaps_rollup").read_text().splitlines()
            kilobytes += next(int(line.split()[1]) for line in lines if line.startswith("Pss:"))
            descriptors += len(list((folder / "fd").iterdir()))
            threads += len(list((folder / "task").iterdir()))
        except (FileNotFoundError, ProcessLookupError, StopIteration):
            continue  # it has ended
    return kilobytes / 1024, descriptors, threads


def _frames_of(folder: Path) -> float:
    """Return how many frames the run has taken."""
    try:
        return read_metrics(folder / "metrics.csv")[-1]["frames"]
    except (ValueError, IndexError):
        return 0.0


@pytest.mark.slow
def test_memory_grows_by_less_than_5_percent_and_descriptors_and_threads_do_not(row, tmp_path):
    """`--tries` gives the frames."""
    frames = row.number(sample=0, thorough=FRAMES)
    if frames == 0:
        pytest.skip("memory shows its growth in a run of many minutes: --thorough or --tries=<frames>")
    seen: list[tuple[float, ...]] = []
    began = time.monotonic()
    process = start(command(tmp_path / "run", *WORDS, f"total_frames={frames}"))
    try:
        while process.poll() is None:
            time.sleep(SECONDS)
            if WARM_UP * frames <= _frames_of(tmp_path / "run") < 0.99 * frames:
                seen.append(_usage(process.pid))
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        _, errors = process.communicate()
    assert process.returncode == 0, errors.decode()[-300:]
    assert seen
    tenth = max(len(seen) // 10, 1)
    first, last = (np.median(part, axis=0) for part in (seen[:tenth], seen[-tenth:]))
    row.figures |= {"frames": int(_frames_of(tmp_path / "run")), "frames/s": round(frames / (time.monotonic() - began))}
    for name, before, after in zip(("MB", "descriptors", "threads"), first.tolist(), last.tolist(), strict=True):
        row.figures[name] = [round(before, 1), round(after, 1)]
        grown = after > before * (GROWTH if name == "MB" else 1.0)
        row.count(f"{name} grow from {before:.1f} to {after:.1f}" if grown else "")
    row.check()
