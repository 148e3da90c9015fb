"""Sweeps: several runs, some at a time, and a table and report at the end; started again, only what is missing runs.

Hydra's joblib launcher hands the jobs out to worker processes, and a worker runs each job as `python train.py` in a
process of its own: one that crashes or is killed leaves its error, and the others go on.

    <sweep dir>/sweep.yaml       each start of the sweep: when, with which overrides, on what machine
    <sweep dir>/<job>/job.json   the overrides that make this job
    <sweep dir>/<job>/error.txt  why it failed, where it did
"""

from __future__ import annotations

import fcntl
import multiprocessing
import shlex
import signal
import sys
import time
import traceback
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import yaml
from hydra.experimental.callback import Callback
from omegaconf import OmegaConf

from conf.schema import ConfigError, read
from trainers.config import SweepConfig
from trainers.sweeps.runs import Run, differing, find_runs
from trainers.utils.system_info import machine

HEADER = ("run", "success", "ci95", "wrong object", "frames", "seconds")
PATIENCE = 2.0  # seconds in which a signal heard twice is one: sent to the process, and to its group
OURS = ("-", "hydra.", "sweep.")  # words that do not tell one job from another

OmegaConf.register_new_resolver("tag", lambda choice: "" if choice == "none" else f"scenario{choice}-", replace=True)


def arguments(words: Sequence[str]) -> list[str]:
    """What was typed, as Hydra takes it: sweep.resume=<dir> becomes that sweep's directory and, alone, its overrides.

    Raises ConfigError for a directory that no sweep was started in.
    """
    own = [word for word in words if word.startswith("sweep.resume=")]
    folder = own[-1].partition("=")[2].strip("'\"") if own else "null"
    if folder == "null":
        return list(words)
    others = [word for word in words if word not in (*own, "-m", "--multirun")]
    if all(word.startswith(OURS) for word in others):
        others = [*starts(Path(folder))[-1]["overrides"], *others]
    else:
        starts(Path(folder))
    return ["--multirun", *others, f"hydra.sweep.dir={as_value(Path(folder).absolute())}"]


def starts(folder: Path) -> list[dict[str, Any]]:
    """What sweep.yaml tells of each start of a sweep, the last one last. Raises ConfigError."""
    try:
        known = yaml.safe_load((folder / "sweep.yaml").read_text())
        return [start | {"overrides": list(start["overrides"])} for start in known]
    except FileNotFoundError:
        raise ConfigError(f"sweep.resume={folder} is not the directory of a sweep: it has no sweep.yaml") from None
    except (yaml.YAMLError, TypeError, KeyError, UnicodeDecodeError):
        raise ConfigError(f"{folder / 'sweep.yaml'} is damaged") from None


def as_value(path: Path) -> str:
    """A path as the value of a Hydra override, whatever characters it has."""
    return "'" + str(path).replace("\\", "\\\\").replace("'", "\\'") + "'"


class Sweep(Callback):
    """Begins and ends a multirun in Hydra's main process. The workers' copies have nothing to do."""

    def __init__(self) -> None:
        self.signal, self.asked = 0, 0.0  # and when

    def __getstate__(self) -> dict[str, Any]:
        return {"signal": 0}

    def on_multirun_start(self, config: Any, **_: Any) -> None:
        folder = Path(config.hydra.sweep.dir)
        try:
            self._begin(config, folder)
        except ConfigError as error:
            sys.exit(f"error: {error}")
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._stop)
        print(f"sweep in {folder}", flush=True)

    def _begin(self, config: Any, folder: Path) -> None:
        read(SweepConfig, config.sweep, "sweep")
        overrides = list(config.hydra.overrides.task)
        if any(word.startswith("resume=") for word in overrides):
            raise ConfigError("resume=<run dir> goes on with one run; a sweep goes on with sweep.resume=<sweep dir>")
        folder.mkdir(parents=True, exist_ok=True)
        self.lock = open(folder / ".lock", "w")  # noqa: SIM115  held until this process ends
        try:
            fcntl.flock(self.lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise ConfigError(f"a sweep is running in {folder} already") from None
        before = starts(folder) if (folder / "sweep.yaml").exists() else []
        start = {"time": f"{datetime.now():%Y-%m-%d %H:%M:%S}", "overrides": overrides, "machine": machine()}
        (folder / "sweep.yaml").write_text(yaml.safe_dump([*before, start], sort_keys=False))

    def _stop(self, number: int, _frame: object) -> None:
        """Ask the workers to stop: they ask their jobs, which save. Asked again later, give up at once."""
        if self.signal and time.monotonic() - self.asked > PATIENCE:
            raise KeyboardInterrupt
        self.signal, self.asked = number, self.asked or time.monotonic()
        for worker in multiprocessing.active_children():
            worker.terminate()

    def on_multirun_end(self, config: Any, **_: Any) -> None:
        folder = Path(config.hydra.sweep.dir)
        try:
            whole = conclude(folder)
        except ConfigError as error:
            sys.exit(f"error: {error}")
        except Exception:  # Hydra would make a warning of it, and exit as if all were well
            traceback.print_exc()
            sys.exit(1)
        if self.signal or not whole:
            missing = shlex.join(["python", "train.py", "-m", f"sweep.resume={folder}"])
            print(f"what is missing runs with: {missing}", flush=True)
            sys.exit(128 + self.signal if self.signal else 1)


def conclude(folder: Path) -> bool:
    """Print the table and write the report. Whether every run has finished. Raises ConfigError."""
    from trainers.reports.report import write  # matplotlib is slow to import

    runs = find_runs(folder)
    print("\n" + table([HEADER, *rows(runs)]), flush=True)
    if any(run.result for run in runs):
        print(f"report: {write(folder)}", flush=True)
    return all(run.result for run in runs)


def rows(runs: Sequence[Run]) -> list[tuple[str, ...]]:
    """A line of the table for each run, named by what tells it from the others."""
    return [(name, *_row(run)) for name, run in zip(differing([run.overrides for run in runs]), runs, strict=True)]


def _row(run: Run) -> tuple[str, ...]:
    if run.result is None:
        return (run.ending, "", "", "", "")
    low, high = run.result["ci95"]
    return (
        f"{run.result['success_at_end']:.3f}",
        f"{low:.3f}-{high:.3f}",
        f"{run.result['wrong_object']:.3f}",
        f"{run.result['frames']}",
        f"{run.result['wall_s']:.0f}",
    )


def table(rows: Sequence[Sequence[str]]) -> str:
    """Rows of words as aligned columns, a line under the first. A last word may be longer than its column."""
    columns = zip(*(row if any(row[2:]) else (row[0], *[""] * (len(row) - 1)) for row in rows), strict=True)
    widths = [max(map(len, column)) for column in columns]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    return "\n".join([lines[0], "  ".join("-" * width for width in widths), *lines[1:]])
