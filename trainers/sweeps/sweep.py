"""Sweeps: several runs, some at a time, with a table and a report at the end. A resumed sweep runs only missing jobs.

A launcher of Hydra distributes the jobs: joblib's over worker processes, ours over the tasks of a Ray cluster
(`trainers.cluster.ray_sweep`), submitit's over the jobs of SLURM. Each runs `train.py` in a separate process: a job
that crashes or is killed leaves its error message, and the other jobs continue.

    <sweep dir>/sweep.yaml       each start of the sweep: time, overrides, machine
    <sweep dir>/<job>/job.json   the overrides of this job
    <sweep dir>/<job>/error.txt  why the job failed, if it did
    <sweep dir>/.stopped         while the sweep ends early: no further job begins
    <sweep dir>/<job>/.pid       the process of a job that runs
"""

from __future__ import annotations

import _thread
import os
import shlex
import signal
import sys
import threading
import time
import traceback
from collections.abc import Sequence
from contextlib import suppress
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any

from hydra.experimental.callback import Callback

from core.errors import ConfigError
from core.path_keys import from_hydra
from core.schema import read
from trainers.config import SweepConfig
from trainers.run.run_folder import FolderLock
from trainers.sweeps.arguments import register_resolvers
from trainers.sweeps.runs import RunRecord, add_start, distinct_overrides, find_runs, share_cell

HEADER = ("run", "success", "ci95", "wrong object", "disturbed", "frames", "seconds")
SIGNALS = (signal.SIGINT, signal.SIGTERM)
LOCAL = "local"  # the launcher whose jobs run on this machine
STOPPED, PID = ".stopped", ".pid"  # files of a sweep that ends, and of a job that runs
REPEAT_SECONDS = 2.0  # a terminal signals the process and its group: two signals within this time are one request


class SweepCallback(Callback):
    """Hydra's callback for the start and the end of a multirun, in the main process. Copies in workers do nothing.

    received: the latest signal to this process, for launchers; 0 before it. handles: whether this process is that of a
    sweep, whose signals are handled here. folder: of a sweep that stops its jobs itself; None: its launcher does, whose
    jobs may run on other machines.
    """

    received, handles = 0, False

    def __init__(self) -> None:
        self.signal, self.signal_time = 0, 0.0
        self.folder: Path | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {"signal": 0}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Called in a worker process, where the job's folder name needs the resolvers."""
        vars(self).update(state)
        register_resolvers()

    def on_multirun_start(self, config: Any, **_: Any) -> None:
        """Lock the sweep's directory, record the start and handle signals. Exits with a message for bad input."""
        folder = Path(config.hydra.sweep.dir)
        try:
            self._begin(config, folder)
        except ConfigError as error:
            sys.exit(f"error: {error}")
        SweepCallback.handles = True
        for number in SIGNALS:
            signal.signal(number, self._stop)
        if self.folder is not None and config.hydra.launcher.n_jobs != 1:  # else joblib has no workers
            # They inherit this. One that has no job would die of a signal, and joblib would kill the others, and their
            # jobs, for that.
            resource_tracker.ensure_running()  # later, its start would let the signals through again
            signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
            threading.Thread(target=_pass_signals_on, daemon=True).start()
        print(f"sweep in {folder}", flush=True)

    def _begin(self, config: Any, folder: Path) -> None:
        read(SweepConfig, config.sweep, "sweep")
        overrides = [from_hydra(word) for word in config.hydra.overrides.task]
        if any(word.startswith("resume=") for word in overrides):
            raise ConfigError("resume=<run dir> resumes a single run; a sweep is resumed with sweep.resume=<sweep dir>")
        self.lock = FolderLock(folder, "sweep").__enter__()  # held until this process ends
        if config.hydra.runtime.choices["hydra/launcher"] == LOCAL:
            self.folder = folder
        for left in (folder / STOPPED, *folder.glob(f"*/{PID}")):  # of a sweep that was killed
            left.unlink(missing_ok=True)
        add_start(folder, overrides)

    def _stop(self, number: int, _frame: object) -> None:
        """Let no further job begin, and stop those that run, which save a checkpoint.

        A later second signal ends this process at once.
        """
        if self.signal and time.monotonic() - self.signal_time > REPEAT_SECONDS:
            raise KeyboardInterrupt
        self.signal, self.signal_time = number, self.signal_time or time.monotonic()
        SweepCallback.received = number
        if self.folder is None:
            return
        (self.folder / STOPPED).touch()
        for file in self.folder.glob(f"*/{PID}"):
            with suppress(OSError, ValueError):  # it has ended meanwhile
                os.kill(int(file.read_text()), signal.SIGTERM)

    def on_multirun_end(self, config: Any, **_: Any) -> None:
        """Print the table, write the report, and exit with an error unless every run has finished."""
        folder = Path(config.hydra.sweep.dir)
        (folder / STOPPED).unlink(missing_ok=True)
        began = any(folder.glob("*/config.yaml"))
        try:
            finished = summarize(folder) if began or not self.signal else False
        except ConfigError as error:
            sys.exit(f"error: {error}")
        except Exception:  # Hydra would print a warning and exit with status 0
            traceback.print_exc()
            sys.exit(1)
        if self.signal or not finished:
            launcher = config.hydra.runtime.choices["hydra/launcher"]
            words = [] if launcher == "local" else [f"hydra/launcher={launcher}"]
            command = shlex.join(["python", "train.py", "-m", f"sweep.resume={folder}", *words])
            print(f"run the missing jobs with: {command}", flush=True)
            sys.exit(128 + self.signal if self.signal else 1)


def _pass_signals_on() -> None:
    """Have the main thread handle the signals that it does not hear itself."""
    while True:
        _thread.interrupt_main(signal.Signals(signal.sigwait(SIGNALS)))


def summarize(folder: Path) -> bool:
    """Print the table of a sweep and write its report.

    Returns:
        Whether every run has finished.

    Raises:
        ConfigError: a file of a run is damaged.
    """
    from trainers.reports.report import write  # matplotlib is slow to import

    runs = find_runs(folder)
    print("\n" + format_table([HEADER, *table_rows(runs)]), flush=True)
    if any(run.result for run in runs):
        print(f"report: {write(folder)}", flush=True)
    return all(run.result for run in runs)


def table_rows(runs: Sequence[RunRecord]) -> list[tuple[str, ...]]:
    """Return a row for each run, named by the overrides that distinguish it from the other runs."""
    names = distinct_overrides([run.overrides for run in runs])
    return [(name, *_result_cells(run)) for name, run in zip(names, runs, strict=True)]


def _result_cells(run: RunRecord) -> tuple[str, ...]:
    if run.result is None:
        return (run.status, *[""] * (len(HEADER) - 2))
    low, high = run.result["ci95"]
    return (
        f"{run.result['success_at_end']:.3f}",
        f"{low:.3f}-{high:.3f}",
        f"{run.result['wrong_object']:.3f}",
        share_cell(run.result.get("disturbed")),
        f"{run.result['frames']}",
        f"{run.result['wall_s']:.0f}",
    )


def format_table(rows: Sequence[Sequence[str]]) -> str:
    """Return rows of cells as aligned columns with a rule under the header.

    The last cell of a row may exceed its column.
    """
    columns = zip(*(row if any(row[2:]) else (row[0], *[""] * (len(row) - 1)) for row in rows), strict=True)
    widths = [max(map(len, column)) for column in columns]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    return "\n".join([lines[0], "  ".join("-" * width for width in widths), *lines[1:]])
