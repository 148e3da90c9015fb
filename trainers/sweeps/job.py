"""One job of a sweep: `train.py` in a separate process, started, resumed or skipped.

This code runs in a worker process of Hydra's launcher. Its main thread waits for the job and forwards its output.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from omegaconf import DictConfig

from core.errors import ConfigError
from core.path_keys import from_hydra
from core.stored_config import place_overrides
from core.system import cores, signal_at_parent_death
from trainers.config import most_workers, read_collector
from trainers.sweeps.arguments import NON_JOB_PREFIXES
from trainers.sweeps.runs import read_overrides, read_result
from trainers.sweeps.sweep import LOCAL, PID, SIGNALS, STOPPED, SweepCallback
from trainers.utils.files import write_checked_json, write_text

ENVIRONMENT = {"PYTHONUNBUFFERED": "1", "HYDRA_FULL_ERROR": "1"}


class JobWorker:
    """The state of this worker process: the job that it waits for, and the signal that it received."""

    def __init__(self) -> None:
        self.signal = 0
        self.parent = os.getppid()
        self.busy = False
        self.job: subprocess.Popen[str] | None = None

    def handle_signals(self) -> None:
        """Stop this worker and its job on SIGINT, on SIGTERM, and (on Linux) when the sweep's main process dies.

        With sweep.jobs=1 that process runs the jobs itself, and stops them itself.
        """
        if SweepCallback.handles:
            return
        for number in SIGNALS:
            signal.signal(number, self._stop)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)  # the sweep blocks them
        signal_at_parent_death(signal.SIGTERM)

    def _stop(self, number: int, _frame: object) -> None:
        self.signal = number
        if self.job is not None:
            self.job.terminate()
        self.exit_if_orphaned()

    def exit_if_orphaned(self) -> None:
        """End this process if the sweep's main process is gone: no other process reads results or sends jobs."""
        if not self.busy and os.getppid() != self.parent:
            os._exit(128 + self.signal)

    def run(self, command: Sequence[str], errors: Path, name: str) -> int:
        """Run a command and print its stdout line by line.

        Args:
            command: program and arguments.
            errors: file for its stderr.
            name: prefix of each printed line.

        Returns:
            The exit status; negative for a signal.
        """
        self.busy = True
        with open(errors, "x") as file:
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
        place = errors.parent
        (place / PID).write_text(str(job.pid))
        if self.signal or is_stopped(place):  # received before the job existed
            job.terminate()
        for line in job.stdout or ():
            print(f"[{name}] {line}", end="", flush=True)
        code = job.wait()
        (place / PID).unlink(missing_ok=True)
        self.job, self.busy = None, False
        return code


WORKER = JobWorker()


def run_job(program: Path, config: DictConfig, overrides: Sequence[str], folder: Path, launcher: str = LOCAL) -> None:
    """Run the job with these overrides, unless it has finished or the sweep was stopped.

    Args:
        program: path of train.py.
        config: the composed config.
        overrides: of the job, as Hydra has them.
        folder: made for the job by Hydra; removed if an earlier start of the sweep made another one for this job.
        launcher: Hydra's option. Each job of submitit has cores of its own; those of others share this machine's.
    """
    share = cores() if launcher.startswith("submitit") else None
    WORKER.handle_signals()
    own = job_overrides(overrides)
    place = find_job_folder(folder, own)
    if place != folder and not any(folder.iterdir()):
        folder.rmdir()
    if has_finished(place):
        return
    if WORKER.signal or is_stopped(place):
        return WORKER.exit_if_orphaned()
    begin_job(place, own)
    errors = place / ".stderr"
    errors.unlink(missing_ok=True)  # created new below
    code = WORKER.run(job_command(program, config, own, place, share), errors, place.name)
    if code and not WORKER.signal and not is_stopped(place):
        record_failure(place, with_advice(failure_message(code, errors.read_text(errors="replace")), place))
    errors.unlink()
    WORKER.exit_if_orphaned()


def is_stopped(place: Path) -> bool:
    """Return whether the sweep of a job ends early. place: the job's folder."""
    return (place.parent / STOPPED).exists()


def job_overrides(overrides: Sequence[str]) -> list[str]:
    """Return those overrides that identify a job of the sweep. overrides: as Hydra has them."""
    return [from_hydra(word) for word in overrides if not word.startswith(NON_JOB_PREFIXES)]


def begin_job(place: Path, overrides: list[str]) -> None:
    """Write the job's job.json, and remove the error of an earlier start."""
    place.mkdir(exist_ok=True, parents=True)
    write_checked_json(place / "job.json", {"overrides": overrides})
    (place / "error.txt").unlink(missing_ok=True)


def record_failure(place: Path, message: str) -> None:
    """Write why the job failed, and print it."""
    write_text(place / "error.txt", message + "\n")
    print(f"[{place.name}] failed: {message.splitlines()[-1]}", flush=True)


def find_job_folder(folder: Path, overrides: Sequence[str]) -> Path:
    """Return the folder of a job in its sweep.

    Args:
        folder: where Hydra would put the job.
        overrides: they identify the job, in any order.

    Returns:
        The folder in which the sweep started this job before; otherwise `folder`, or a numbered one beside it if
        another job has that.
    """
    for place in (folder, *sorted(folder.parent.iterdir())):
        if (place / "job.json").exists() and sorted(_known_overrides(place) or ()) == sorted(overrides):
            return place
    names = (folder, *(folder.with_name(f"{folder.name}-{i}") for i in range(2, 10_000)))
    return next(name for name in names if not (name / "job.json").exists())


def _known_overrides(place: Path) -> list[str] | None:
    """Return the overrides in a job.json; None for a damaged one, whose job is run again in another folder."""
    try:
        return read_overrides(place)
    except ConfigError as error:
        print(f"[{place.name}] {error}", flush=True)
        return None


def has_finished(place: Path) -> bool:
    """Return whether the job has a result.

    Prints that it has. A damaged result is removed, and the job is finished again.
    """
    if not (place / "eval.json").exists():
        return False
    try:
        read_result(place)
    except ConfigError as error:
        print(f"[{place.name}] {error}; the run is finished again", flush=True)
        (place / "eval.json").unlink()
        return False
    print(f"[{place.name}] has finished already", flush=True)
    return True


def job_command(
    program: Path, config: DictConfig, overrides: Sequence[str], place: Path, share: int | None = None
) -> list[str]:
    """Return the command that runs the job on its share of the cores. It resumes from a checkpoint in `place`, if any.

    share: number of cores; None: those of this machine, shared by the concurrent jobs of a sweep that runs here.
    """
    words = [f"hydra.run.dir={place}"]
    if any((place / "checkpoints").glob("*.pt")):
        words += [f"resume={place}", *place_overrides(overrides)]
    else:
        words += overrides
    return [sys.executable, str(program), *words, *core_share(config, share)]


def core_share(config: DictConfig, share: int | None = None) -> list[str]:
    """Return overrides that limit a job to its share of the cores, for the keys that the user left at their defaults.

    share: as of `job_command`.
    """
    try:
        collector = read_collector(config.collector)
    except ConfigError:
        return []  # the job reports the error itself
    share = max(1, cores() // config.sweep.jobs) if share is None else share
    threads = [] if config.update_threads else [f"update_threads={share}"]
    if collector.workers or collector.name != "local":
        return threads
    return [f"collector.workers={most_workers(collector, share)}", *threads]


def with_advice(message: str, place: Path) -> str:
    """Return why a job failed, with what helps where the same would happen each time that it is resumed."""
    folder = place / "checkpoints"
    damaged = any(f"{file} is damaged" in message for file in folder.glob("*.pt"))
    return f"{message}; remove {folder}, and the job begins anew" if damaged else message


def failure_message(code: int, errors: str) -> str:
    """Return why a job failed.

    Args:
        code: its exit status; negative for a signal.
        errors: its stderr.

    Returns:
        The last "error: ..." line; without one, the traceback or the whole stderr, and the signal.
    """
    lines = errors.splitlines()
    messages = [line.removeprefix("error: ") for line in lines if line.startswith("error: ")]
    if messages:
        return messages[-1]
    start = next((i for i, line in enumerate(lines) if line.startswith("Traceback ")), 0)
    ending = [f"the process was ended by {signal.Signals(-code).name}"] if code < 0 else []
    return "\n".join([*lines[start:], *ending]).strip() or f"the process ended with exit status {code}"
