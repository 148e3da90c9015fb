"""Progress of a run: a bar on a terminal; otherwise a line at each evaluation and every ten seconds.

This file imports no torch, so that a program can show that it starts before its slow imports.
"""

from __future__ import annotations

import math
import sys
from collections import deque
from collections.abc import Mapping
from typing import Any

from tqdm import tqdm

LABELS = {  # column of metrics.csv -> label
    "eval/success_at_end": "success",
    "eval/wrong_object": "wrong object",
    "train/success": "in training",
    "grounding/accuracy": "grounding",
}
LINE_SECONDS = 10.0
WINDOW = 100  # training episodes over which success is averaged: a single row may hold one or two, and the shortest


class Progress:
    """Shows at once that a run starts, then the rows of metrics.csv as they are measured. A context manager.

    Args:
        total: frames of the run.
        shown: False to show nothing.
    """

    def __init__(self, total: int, shown: bool = True) -> None:
        self.total = total
        self.values: dict[str, str] = {}
        self.recent: deque[tuple[float, float]] = deque()  # number of episodes and their success, of the last rows
        self.line_at = -math.inf  # seconds of the run at the last line
        self.prints_lines = shown and not sys.stderr.isatty()
        self.bar = tqdm(total=total, unit="frames", disable=not shown or self.prints_lines)
        self.bar.set_postfix_str("starting")
        if self.prints_lines:
            print(f"starting a run of {total} frames", flush=True)

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *error: Any) -> None:
        self.bar.close()

    def say(self, text: str) -> None:
        """Say what the run does before its first row."""
        self.bar.set_postfix_str(text)
        if self.prints_lines:
            print(text, flush=True)

    def resume(self, done: int) -> None:
        """Begin at the frames of the run that is resumed."""
        self.bar.initial = self.bar.n = done
        self.bar.refresh()

    def show(self, row: Mapping[str, float], status: Mapping[str, str] | None = None) -> None:
        """Show a row of metrics.csv. Values that it lacks keep their last value: evaluations are rarer than rows.

        status: further values by their labels, for the bar alone.
        """
        shown = {label: row.get(name, math.nan) for name, label in LABELS.items()}
        shown[LABELS["train/success"]] = self._training_success(row)
        measured = {label: f"{value:.2f}" for label, value in shown.items() if math.isfinite(value)}
        self.values |= measured
        due = row["time/total"] - self.line_at >= LINE_SECONDS
        if self.prints_lines and (due or "success" in measured):
            self.line_at = row["time/total"]
            text = ", ".join(f"{label} {self.values[label]}" for label in shown if label in self.values)
            print(f"{row['frames']:.0f} of {self.total} frames, {row['time/total']:.0f} s: {text}", flush=True)
        self.bar.set_postfix({**self.values, **(status or {})}, refresh=False)
        self.bar.update(int(row["frames"]) - self.bar.n)

    def _training_success(self, row: Mapping[str, float]) -> float:
        """Mean success of the last `WINDOW` training episodes, rounded up to whole rows; NaN before the first one."""
        count = row.get("train/episodes", 0.0)
        if count:
            self.recent.append((count, row["train/success"]))
        total = sum(count for count, _ in self.recent)
        while self.recent and total - self.recent[0][0] >= WINDOW:
            total -= self.recent.popleft()[0]
        return sum(count * success for count, success in self.recent) / total if total else math.nan
