"""One job of a sweep: `python train.py` in a process of its own, begun, gone on with, or not needed any more.

Runs in a worker process of Hydra's launcher, whose main thread waits for the job and passes on what it prints.
"""

from __future__ import annotations

import ctypes
import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from omegaconf import DictConfig

from conf.schema import ConfigError, read
from trainers.config import CollectorConfig, cores, workers
from trainers.run.metrics import write_json
from trainers.sweeps.sweep import OURS, as_value

PR_SET_PDEATHSIG = 1
ENVIRONMENT = {"PYTHONUNBUFFERED": "1", "HYDRA_FULL_ERROR": "1"}


class Worker:
    """This worker process: the job that it waits for, and whether it was asked to stop."""

    def __init__(self) -> None:
        self.signal = 0
        self.parent = os.getppid()
        self.busy = False
        self.job: subprocess.Popen[str] | None = None

    def listen(self) -> None:
        """Stop, with the job, on SIGINT and SIGTERM, and when the process that began the sweep is gone."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._stop)
        if sys.platform == "linux":
            ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)

    def _stop(self, number: int, _frame: object) -> None:
        self.signal = number
        if self.job is not None:
            self.job.terminate()
        self.leave_if_alone()

    def leave_if_alone(self) -> None:
        """End where the process that began the sweep is gone: nobody waits for a result or sends other jobs."""
        if not self.busy and os.getppid() != self.parent:
            os._exit(128 + self.signal)

    def run(self, command: Sequence[str], errors: Path, name: str) -> int:
        """The exit status of `command`, whose stdout is passed on line by line, and its stderr kept in a file."""
        self.busy = True
        with open(errors, "w") as file:
            job = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=file,
                text=True,
                errors="replace",
                env={**os.environ, **ENVIRONMENT},
            )
        self.job = job
        if self.signal:  # it came before there was a job to ask
            job.terminate()
        for line in job.stdout or ():
            print(f"[{name}] {line}", end="", flush=True)
        code = job.wait()
        self.job, self.busy = None, False
        return code


WORKER = Worker()


def work(program: Path, config: DictConfig, overrides: Sequence[str], folder: Path) -> None:
    """Run the job of these overrides, unless it is done or the sweep was stopped.

    program: train.py. config: as composed. folder: made for the job by Hydra; not used where the sweep has another one
    for the same overrides from before.
    """
    WORKER.listen()
    own = [word for word in overrides if not word.startswith(OURS)]
    place = find_place(folder, own)
    if place != folder and not any(folder.iterdir()):
        folder.rmdir()
    if (place / "eval.json").exists():
        print(f"[{place.name}] finished before", flush=True)
        return
    if WORKER.signal:
        return WORKER.leave_if_alone()
    place.mkdir(exist_ok=True)
    write_json(place / "job.json", {"overrides": own})
    (place / "error.txt").unlink(missing_ok=True)
    errors = place / ".stderr"
    code = WORKER.run(command(program, config, own, place), errors, place.name)
    if code and not WORKER.signal:
        text = told(code, errors.read_text(errors="replace"))
        (place / "error.txt").write_text(text + "\n")
        print(f"[{place.name}] failed: {text.splitlines()[-1]}", flush=True)
    errors.unlink()
    WORKER.leave_if_alone()


def find_place(folder: Path, overrides: Sequence[str]) -> Path:
    """The folder in which the sweep has begun this job before, or else `folder`, or one beside it if that is taken."""
    for place in (folder, *sorted(folder.parent.iterdir())):
        file = place / "job.json"
        if file.is_file() and sorted(json.loads(file.read_text())["overrides"]) == sorted(overrides):
            return place
    names = (folder, *(folder.with_name(f"{folder.name}-{i}") for i in range(2, 10_000)))
    return next(name for name in names if not (name / "job.json").exists())


def command(program: Path, config: DictConfig, overrides: Sequence[str], place: Path) -> list[str]:
    """What runs the job on its share of the cores: from its checkpoint, where it has one."""
    words = [f"hydra.run.dir={as_value(place)}"]
    if any((place / "checkpoints").glob("*.pt")):
        words.append(f"resume={as_value(place)}")
    else:
        words += overrides
    return [sys.executable, str(program), *words, *shared(config)]


def shared(config: DictConfig) -> list[str]:
    """Overrides that keep a job to its share of the cores, where nothing else was asked for."""
    try:
        collector = read(CollectorConfig, config.collector, "collector")
    except ConfigError:
        return []  # the job itself says so
    jobs = config.sweep.jobs
    threads = [] if config.update_threads else [f"update_threads={max(1, cores() // jobs)}"]
    return threads if collector.workers else [f"collector.workers={workers(collector, jobs)}", *threads]


def told(code: int, errors: str) -> str:
    """Why a job failed, by its exit status and stderr: one line if it knows, the traceback or all it said if not."""
    lines = errors.splitlines()
    said = [line.removeprefix("error: ") for line in lines if line.startswith("error: ")]
    if said:
        return said[-1]
    began = next((i for i, line in enumerate(lines) if line.startswith("Traceback ")), 0)
    ended = [f"the process was ended by {signal.Signals(-code).name}"] if code < 0 else []
    return "\n".join([*lines[began:], *ended]).strip() or f"the process ended with exit status {code}"
