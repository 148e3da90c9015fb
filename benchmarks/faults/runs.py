"""Whole runs that are stopped or killed, in processes of their own, and resumed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from random import Random
from typing import Any

import torch

from benchmarks.faults.rows import Outcome, row
from trainers.run import checkpoint
from trainers.run.metrics import read_metrics
from trainers.run.run_folder import SEMAPHORE_NAME, SEMAPHORES

ROOT = Path(__file__).parents[2]
SMALL = ["collector.worlds=4", "eval.episodes=4", "eval.interval_episodes=4", "eval.worlds=4", "eval.video_episodes=0"]
SMALL += ["logger=[]", "algo.grounding_scenes=8", "algo.grounding_batch=16"]
ALGORITHMS = {  # overrides of runs of ten iterations
    "ppo": ["algo.horizon=16", "algo.minibatch=32", "total_frames=640", "eval.interval=192"],
    "sac": ["algo.horizon=16", "algo.batch=16", "algo.learning_starts=64", "total_frames=640", "eval.interval=192"],
}
FRAMES, BATCH, ROWS = 640, 64, 10
START_SECONDS = 600.0  # a run that takes longer counts as one that hangs


def command(folder: Path, *words: str) -> list[str]:
    """Return the command line of a run in `folder`."""
    return [sys.executable, str(ROOT / "train.py"), f"hydra.run.dir={folder}", *words]


def start(words: Sequence[str]) -> subprocess.Popen:
    """A run in a process group of its own."""
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    return subprocess.Popen(
        words, cwd=ROOT, env=environment, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )


def finish(words: Sequence[str]) -> str:
    """Run to the end. Returns the error, or ""."""
    process = start(words)
    try:
        _, errors = process.communicate(timeout=START_SECONDS)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return "it hangs"
    return f"exit code {process.returncode}: {errors.decode()[-300:]}" if process.returncode else ""


def stop_at(process: subprocess.Popen, folder: Path, rows: int, number: int) -> str:
    """Send a signal to the run's group once metrics.csv has `rows` rows and there is a checkpoint."""
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


def orphaned_semaphores() -> list[Path]:
    """Return semaphores of runs whose process is gone; other runs may go on beside this one."""
    found = ((path, SEMAPHORE_NAME.fullmatch(path.name)) for path in SEMAPHORES.glob("sem.mp-deixis-*"))
    return [path for path, match in found if match and not Path(f"/proc/{match[1]}").exists()]


@row("resume", "stop at a random iteration by SIGTERM, SIGKILL or the end of frames, and resume: bit-equal", 40)
def resume(tries: int, random: Random, folder: Path) -> Outcome:
    """PPO and SAC, 1 and 2 workers, three ways to stop, in turn."""
    outcome = Outcome()
    whole: dict[tuple[str, int], Path] = {}
    for index in range(tries):
        algo, workers = ("ppo", "sac")[index % 2], 1 + index // 2 % 2
        how = ("SIGTERM", "SIGKILL", "end")[index % 3]
        words = [f"algo={algo}", f"collector.workers={workers}", *SMALL, *ALGORITHMS[algo]]
        if (algo, workers) not in whole:
            whole[algo, workers] = folder / f"whole-{algo}-{workers}"
            wrong = finish(command(whole[algo, workers], *words))
            if wrong:
                outcome.failures.append(f"undisturbed {algo} with {workers} workers: {wrong}")
        at = random.randint(1, ROWS - 1)
        place = folder / f"try-{index}"
        wrong = stopped_and_resumed(place, words, how, at) or differences(whole[algo, workers], place)
        outcome.tries += 1
        if wrong:
            outcome.failures.append(f"{algo}, {workers} workers, {how} at row {at}: {wrong}")
    return outcome


def stopped_and_resumed(place: Path, words: list[str], how: str, at: int) -> str:
    """Return one try. Returns the error, or ""."""
    if how == "end":
        wrong = finish(command(place, *words, f"total_frames={BATCH * at}", f"schedule_frames={FRAMES}"))
    else:
        wrong = stop_at(start(command(place, *words)), place, at, getattr(signal, how))
    return wrong or finish(command(place, f"resume={place}", f"total_frames={FRAMES}"))


@row("group", "SIGKILL of the whole group at a random moment, again and again, and resume to the end", 100)
def group(tries: int, random: Random, folder: Path) -> Outcome:
    """A run is killed some seconds after it goes on; when it ends, it is compared and another one begins."""
    outcome = Outcome(figures={"runs": 0, "left over": 0})
    words = ["algo=sac", "collector.workers=2", *SMALL, *ALGORITHMS["sac"]]
    began = time.monotonic()
    wrong = finish(command(folder / "whole", *words))
    if wrong:
        outcome.failures.append(f"the undisturbed run: {wrong}")
    seconds, place, run = time.monotonic() - began, folder / "run-0", 0
    while outcome.tries < tries:
        again = [f"resume={place}"] if (place / "checkpoints" / "last.pt").exists() else words
        process = start(command(place, *again))
        try:
            _, errors = process.communicate(timeout=random.uniform(0.2, 1.0) * seconds)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            outcome.tries += 1
            continue
        if process.returncode:
            outcome.failures.append(f"it cannot go on: {errors.decode()[-300:]}")
        wrong = differences(folder / "whole", place)
        if wrong:
            outcome.failures.append(wrong)
        outcome.figures["runs"] += 1
        outcome.figures["left over"] += len(list(place.rglob(".*.tmp*"))) + len(orphaned_semaphores())
        run += 1
        place = folder / f"run-{run}"
    return outcome
