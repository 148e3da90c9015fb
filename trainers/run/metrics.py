"""What a run measures on its way: metrics.csv, events for TensorBoard and W&B, eval.json."""

from __future__ import annotations

import csv
import json
import math
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from conf.schema import ConfigError

EVALUATED = ("success_at_end", "success_once", "wrong_object", "mean_return", "mean_length")


class Metrics:
    """metrics.csv, one row an iteration, with a header that never changes, and the loggers beside it.

    Columns named time/... are timings: two runs of one seed agree in all others. A cell is empty where there was
    nothing to measure. after: on resuming, rows of more frames than this are dropped, since they come again.
    """

    def __init__(
        self, folder: Path, columns: Sequence[str], loggers: Iterable[str] = (), after: int | None = None
    ) -> None:
        self.path, self.columns = folder / "metrics.csv", list(columns)
        kept = [] if after is None else [row for row in read_metrics(self.path) if row["frames"] <= after]
        self.file = open(self.path, "w", newline="")  # noqa: SIM115
        self.writer = csv.DictWriter(self.file, self.columns)
        self.writer.writeheader()
        for row in kept:
            self.writer.writerow({name: _cell(row.get(name, math.nan)) for name in self.columns})
        self.loggers = [_logger(name, folder) for name in loggers]

    def write(self, row: Mapping[str, float]) -> None:
        """One iteration. Raises ValueError for a column that was not announced."""
        self.writer.writerow({name: _cell(value) for name, value in row.items()})
        self.file.flush()
        for name, value in row.items():
            for logger in self.loggers if math.isfinite(value) and name != "frames" else ():
                logger.log_scalar(name, value, step=int(row["frames"]))

    def close(self) -> None:
        self.file.close()
        for logger in self.loggers:
            close = getattr(logger.experiment, "close", None) or getattr(logger.experiment, "finish", None)
            if close is not None:
                close()


def read_metrics(path: Path) -> list[dict[str, float]]:
    """The rows of a metrics.csv; an empty cell is NaN. No rows where there is no file.

    A last line that a kill has cut short is left out. Raises ConfigError for any other damage.
    """
    if not path.is_file():
        return []
    lines = path.read_bytes().decode(errors="replace").splitlines(keepends=True)
    header, *rest = [line.strip().split(",") for line in lines if line.endswith("\n")] or [["frames"]]
    if "frames" not in header:
        raise ConfigError(f"{path} is damaged: its first line names no column frames")
    rows = []
    for number, cells in enumerate(rest, 2):
        try:
            rows.append({name: float(cell or "nan") for name, cell in zip(header, cells, strict=True)})
        except ValueError:
            raise ConfigError(f"{path} is damaged: line {number} does not fit its header") from None
    return rows


def write_json(path: Path, values: Mapping[str, Any]) -> None:
    """Plain values, written whole or not at all."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    beside.write_text(json.dumps(values, indent=2) + "\n")
    os.replace(beside, path)


def _cell(value: float) -> str:
    return repr(float(value)) if math.isfinite(value) else ""


def _logger(name: str, folder: Path) -> Any:
    if name == "tensorboard":
        from torchrl.record.loggers.tensorboard import TensorboardLogger

        return TensorboardLogger(exp_name="tensorboard", log_dir=str(folder))
    from torchrl.record.loggers.wandb import WandbLogger

    return WandbLogger(exp_name=folder.name, project="deixis", save_dir=str(folder))
