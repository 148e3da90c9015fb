"""The measurements of a run: metrics.csv, and events for TensorBoard and Weights & Biases."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from conf.schema import ConfigError

EVALUATION_NAMES = ("success_at_end", "success_once", "wrong_object", "mean_return", "mean_length")


class MetricsWriter:
    """Writes metrics.csv, one row an iteration under a fixed header, and sends the values to the loggers.

    Columns named time/... are timings: two runs with the same seed agree in all other columns. The cell of a value that
    was not measured is empty.

    Args:
        folder: of the run.
        columns: names of all columns; the first is "frames".
        loggers: "tensorboard", "wandb".
        after: when resuming, the frames of the checkpoint: rows with more frames are dropped, since they are measured
            again. None starts a new file.
    """

    def __init__(
        self, folder: Path, columns: Sequence[str], loggers: Iterable[str] = (), after: int | None = None
    ) -> None:
        self.path, self.columns = folder / "metrics.csv", list(columns)
        earlier = [] if after is None else [row for row in read_metrics(self.path) if row["frames"] <= after]
        self.file = open(self.path, "w", newline="")  # noqa: SIM115
        self.writer = csv.DictWriter(self.file, self.columns)
        self.writer.writeheader()
        for row in earlier:
            self.writer.writerow({name: _cell(row.get(name, math.nan)) for name in self.columns})
        self.loggers = [_make_logger(name, folder) for name in loggers]

    def write(self, row: Mapping[str, float]) -> None:
        """Write the row of one iteration. Raises ValueError for a name that is not a column."""
        self.writer.writerow({name: _cell(value) for name, value in row.items()})
        self.file.flush()
        for name, value in row.items():
            for logger in self.loggers if math.isfinite(value) and name != "frames" else ():
                logger.log_scalar(name, value, step=int(row["frames"]))

    def close(self) -> None:
        """Close the file and the loggers."""
        self.file.close()
        for logger in self.loggers:
            close = getattr(logger.experiment, "close", None) or getattr(logger.experiment, "finish", None)
            if close is not None:
                close()


def read_metrics(path: Path) -> list[dict[str, float]]:
    """The rows of a metrics.csv; an empty cell is NaN. [] if there is no file.

    A last line without an end, as a killed process leaves it, is ignored.

    Raises:
        ConfigError: the file is damaged in another way.
    """
    if not path.is_file():
        return []
    lines = path.read_bytes().decode(errors="replace").splitlines(keepends=True)
    header, *rest = [line.strip().split(",") for line in lines if line.endswith("\n")] or [["frames"]]
    if "frames" not in header:
        raise ConfigError(f"{path} is damaged: its first line has no column frames")
    rows = []
    for number, cells in enumerate(rest, 2):
        try:
            rows.append({name: float(cell or "nan") for name, cell in zip(header, cells, strict=True)})
        except ValueError:
            raise ConfigError(f"{path} is damaged: line {number} does not fit its header") from None
    return rows


def _cell(value: float) -> str:
    return repr(float(value)) if math.isfinite(value) else ""


def _make_logger(name: str, folder: Path) -> Any:
    if name == "tensorboard":
        from torchrl.record.loggers.tensorboard import TensorboardLogger

        return TensorboardLogger(exp_name="tensorboard", log_dir=str(folder))
    from torchrl.record.loggers.wandb import WandbLogger

    return WandbLogger(exp_name=folder.name, project="deixis", save_dir=str(folder))
