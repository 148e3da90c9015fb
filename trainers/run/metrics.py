"""The measurements of a run: metrics.csv, and events for TensorBoard and Weights & Biases."""

from __future__ import annotations

import errno
import math
import os
import sys
import zlib
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from core.errors import ConfigError
from core.safe_files import FileError, read_bytes
from trainers.utils.files import NO_FOLLOW, WriteError, write_text

EVALUATION_NAMES = ("success_at_end", "success_once", "wrong_object", "disturbed", "mean_return", "mean_length")
CHECKSUM = "checksum"  # the last column
LINE_END = "\r\n"
MAX_BYTES = 256 * 2**20


class MetricsWriter:
    """Writes metrics.csv, one row an iteration under a fixed header, and sends the values to the loggers.

    Columns named time/... are timings: two runs with the same seed agree in all other columns. The cell of a value that
    was not measured is empty. The last column is a checksum of all lines up to its own.

    Args:
        folder: of the run.
        columns: names of all columns; the first is "frames".
        loggers: "tensorboard", "wandb".
        after: when resuming, the frames of the checkpoint: rows with more frames are dropped, since they are measured
            again. None starts a new file. A damaged file is set aside with a warning, and a new one is started.
        iterations: when resuming, how many rows there should be up to `after`. A warning tells how many are missing.

    Raises:
        WriteError: the file cannot be written.
    """

    def __init__(
        self,
        folder: Path,
        columns: Sequence[str],
        loggers: Iterable[str] = (),
        after: int | None = None,
        iterations: int = 0,
    ) -> None:
        self.path, self.columns = folder / "metrics.csv", list(columns)
        earlier = [] if after is None else _earlier(self.path, after, iterations)
        header = ",".join([*self.columns, CHECKSUM])
        self._checksum = zlib.crc32(header.encode())
        # Replaced as a whole: a process that is killed here leaves the old file.
        write_text(self.path, "".join([header + LINE_END, *map(self._line, earlier)]))
        self._descriptor = os.open(self.path, os.O_WRONLY | os.O_APPEND | NO_FOLLOW)
        self.loggers = [_make_logger(name, folder) for name in loggers]

    def write(self, row: Mapping[str, float]) -> None:
        """Write the row of one iteration. Raises ValueError for a name that is not a column, and WriteError."""
        unknown = [name for name in row if name not in self.columns]
        if unknown:
            raise ValueError(f"not columns of {self.path.name}: {', '.join(unknown)}")
        line = self._line(row).encode()
        try:
            if os.write(self._descriptor, line) != len(line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError as error:
            raise WriteError(f"{self.path} cannot be written: {error.strerror}") from error
        for logger in list(self.loggers):
            self._log(logger, row)

    def _line(self, row: Mapping[str, float]) -> str:
        text = ",".join(_cell(row.get(name, math.nan)) for name in self.columns)
        self._checksum = zlib.crc32(text.encode(), self._checksum)
        return f"{text},{_checksum_cell(self._checksum)}{LINE_END}"

    def _log(self, logger: Any, row: Mapping[str, float]) -> None:
        """Send a row to a logger, and drop a logger that can no longer write: metrics.csv has all values."""
        try:
            for name, value in row.items():
                if math.isfinite(value) and name != "frames":
                    logger.log_scalar(name, value, step=int(row["frames"]))
        except OSError as error:
            print(f"warning: {type(logger).__name__} is switched off: {error}", file=sys.stderr, flush=True)
            self.loggers.remove(logger)

    def close(self) -> None:
        """Close the file and the loggers."""
        os.close(self._descriptor)
        for logger in self.loggers:
            close = getattr(logger.experiment, "close", None) or getattr(logger.experiment, "finish", None)
            with suppress(OSError):  # a full disk
                if close is not None:
                    close()


def _earlier(path: Path, after: int, iterations: int) -> list[dict[str, float]]:
    """Return the rows of a metrics.csv up to `after`, with a warning if there are fewer than `iterations`.

    A damaged file is renamed, with a warning: it costs the curve, not the run.
    """
    try:
        rows = [row for row in read_metrics(path) if row["frames"] <= after]
    except ConfigError as error:
        aside = path.with_name(f"{path.name}.damaged")
        os.replace(path, aside)
        print(f"warning: {error}; it is kept as {aside.name}, and a new one is begun", file=sys.stderr, flush=True)
        return []
    if (missing := iterations - len(rows)) > 0:
        lost = f"{path} lacks {missing if rows else 'all'} of the {iterations} rows up to frame {after}"
        print(f"warning: {lost}; training goes on without them", file=sys.stderr, flush=True)
    return rows


def read_metrics(path: Path) -> list[dict[str, float]]:
    """Return the rows of a metrics.csv without checksums; an empty cell is NaN. [] if there is no file.

    A last line without an end, as a killed process leaves it, is ignored.

    Raises:
        ConfigError: the file is damaged in another way.
    """
    if not path.exists():
        return []
    try:
        lines = read_bytes(path, MAX_BYTES).decode(errors="replace").splitlines(keepends=True)
    except FileError as error:
        raise ConfigError(f"{path} {error}") from None
    header, *rest = [line.strip() for line in lines if line.endswith("\n")] or ["frames"]
    names = header.split(",")
    if names[0] != "frames" or len(set(names)) != len(names):
        raise ConfigError(f"{path} is damaged: its first line has no column frames, or two columns of one name")
    checked, checksum, rows = names[-1] == CHECKSUM, zlib.crc32(header.encode()), []
    measured = names[:-1] if checked else names
    for number, line in enumerate(rest, 2):
        text, _, cell = line.rpartition(",") if checked else (line, "", "")
        checksum = zlib.crc32(text.encode(), checksum)
        try:
            row = dict(zip(measured, map(_number, text.split(",")), strict=True))
        except ValueError:
            raise ConfigError(f"{path} is damaged: line {number} does not fit its header") from None
        if checked and cell != _checksum_cell(checksum):
            raise ConfigError(f"{path} is damaged: the checksum of line {number} does not fit")
        rows.append(row)
    return rows


def _number(cell: str) -> float:
    return float(cell or "nan")


def _checksum_cell(value: int) -> str:
    return f"x{value:08x}"  # no number, whatever is damaged


def _cell(value: float) -> str:
    return repr(float(value)) if math.isfinite(value) else ""


def _make_logger(name: str, folder: Path) -> Any:
    if name == "tensorboard":
        from torchrl.record.loggers.tensorboard import TensorboardLogger

        return TensorboardLogger(exp_name="tensorboard", log_dir=str(folder))
    from torchrl.record.loggers.wandb import WandbLogger

    return WandbLogger(exp_name=folder.name, project="deixis", save_dir=str(folder))
