"""Progress of a run: a bar on a terminal; otherwise a line at each evaluation and every ten seconds.

This file imports no torch, so that a program can show that it starts before its slow imports.
"""

from __future__ import annotations

import math
import sys
from collections import deque
from collections.abc import Mapping
from threading import RLock
from typing import Any

from tqdm import tqdm

LABELS = {  # column of metrics.csv -> label
    "eval/success_at_end": "success",
    "eval/wrong_object": "wrong object",
    "train/success": "in training",
    "grounding/accuracy": "grounding",
}
EVALUATED = tuple(name for name in LABELS if name.startswith("eval/"))
LINE_SECONDS = 10.0
WINDOW = 100  # training episodes over which success is averaged: a single row may hold one or two, and the shortest


class RecentSuccess:
    """The mean success of the last `WINDOW` training episodes, in whole rows of metrics.csv."""

    def __init__(self) -> None:
        self._rows: deque[tuple[float, float]] = deque()  # number of episodes and their success, of the last rows

    def add(self, row: Mapping[str, float]) -> float:
        """Add a row, and return the mean; NaN before the first episode."""
        count = row.get("train/episodes", 0.0)
        if count:
            self._rows.append((count, row["train/success"]))
        total = sum(count for count, _ in self._rows)
        while self._rows and total - self._rows[0][0] >= WINDOW:
            total -= self._rows.popleft()[0]
        return sum(count * success for count, success in self._rows) / total if total else math.nan


class Progress:
    """Shows at once that a run starts, then the rows of metrics.csv as they are measured. A context manager.

    Args:
        total: frames of the run.
        shown: False to show nothing.
    """

    def __init__(self, total: int, shown: bool = True) -> None:
        self.total = total
        self.values: dict[str, str] = {}
        self.recent = RecentSuccess()
        self.line_at = -math.inf  # seconds of the run at the last line
        self.prints_lines = shown and not sys.stderr.isatty()
        tqdm.set_lock(RLock())  # its own is a semaphore of all processes, which a killed run would leave in /dev/shm
        self.bar = tqdm(total=total, unit="frames", disable=not shown or self.prints_lines)
        self.bar.set_postfix_str("starting")
        if self.prints_lines:
            print(f"starting a run of {total} frames", flush=True)

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *error: Any) -> None:
        self.bar.close()

    def say(self, text: str) -> None:
        """Show a text about the run's work before its first row."""
        self.bar.set_postfix_str(text)
        if self.prints_lines:
            print(text, flush=True)

    def resume(self, done: int) -> None:
        """Begin at the frames of the run that is resumed."""
        self.bar.initial = self.bar.n = done
        self.bar.refresh()

    def show(self, row: Mapping[str, float], status: Mapping[str, str] | None = None) -> None:
        """Show a row of metrics.csv without its evaluation. Values that it lacks keep their last value.

        status: further values by their labels, for the bar alone.
        """
        shown = {label: row.get(name, math.nan) for name, label in LABELS.items() if name not in EVALUATED}
        shown[LABELS["train/success"]] = self.recent.add(row)
        self.values |= {label: f"{value:.2f}" for label, value in shown.items() if math.isfinite(value)}
        if self.prints_lines and row["time/total"] - self.line_at >= LINE_SECONDS:
            self.line_at = row["time/total"]
            self._print(row["frames"], row["time/total"], self.values)
        self.bar.set_postfix({**self.values, **(status or {})}, refresh=False)
        self.bar.update(int(row["frames"]) - self.bar.n)

    def show_evaluation(self, row: Mapping[str, float]) -> None:
        """Show the evaluation of a row that was shown before: training may have gone on meanwhile."""
        shown = {LABELS[name]: f"{value:.2f}" for name, value in row.items() if name in EVALUATED and value == value}
        self.values |= shown
        if self.prints_lines:
            self._print(row["frames"], row["time/evaluated"], shown)
        self.bar.set_postfix(self.values)

    def _print(self, frames: float, seconds: float, values: Mapping[str, str]) -> None:
        text = ", ".join(f"{label} {values[label]}" for label in LABELS.values() if label in values)
        print(f"{frames:.0f} of {self.total} frames, {seconds:.0f} s{': ' * bool(text)}{text}", flush=True)
