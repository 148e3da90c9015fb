"""How far a run is: a bar on a terminal, a line at each evaluation anywhere else."""

from __future__ import annotations

import math
import sys
from collections import deque
from collections.abc import Mapping
from typing import Any

from tqdm import tqdm

SHOWN = {  # name in a row of metrics.csv -> word
    "eval/success_at_end": "success",
    "eval/wrong_object": "wrong object",
    "train/success": "in training",
    "grounding/accuracy": "grounding",
}
RECENT = 100  # training episodes whose mean success is shown: in a row there may be one or two, and the quickest


class Progress:
    """A context manager. total, done: frames of the run, and those that it goes on from. shown: False for silence."""

    def __init__(self, total: int, done: int, shown: bool) -> None:
        self.total = total
        self.known: dict[str, str] = {}
        self.recent: deque[tuple[float, float]] = deque()  # how many episodes, and their success, of the last rows
        self.lines = shown and not sys.stderr.isatty()
        self.bar = tqdm(total=total, initial=done, unit="frames", disable=not shown or self.lines)

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *error: Any) -> None:
        self.bar.close()

    def show(self, row: Mapping[str, float]) -> None:
        """row: one of metrics.csv."""
        shown = {word: row.get(name, math.nan) for name, word in SHOWN.items()}
        shown[SHOWN["train/success"]] = self._trained(row)
        known = {word: f"{value:.2f}" for word, value in shown.items() if math.isfinite(value)}
        self.known |= known  # evaluations are rarer than rows
        if self.lines and "success" in known:
            measured = ", ".join(f"{word} {self.known[word]}" for word in shown if word in self.known)
            print(f"{row['frames']:.0f} of {self.total} frames, {row['time/total']:.0f} s: {measured}", flush=True)
        self.bar.set_postfix(self.known, refresh=False)
        self.bar.update(int(row["frames"]) - self.bar.n)

    def _trained(self, row: Mapping[str, float]) -> float:
        """The mean success of the last `RECENT` training episodes, or a few more; NaN before there are any."""
        count = row.get("train/episodes", 0.0)
        if count:
            self.recent.append((count, row["train/success"]))
        total = sum(count for count, _ in self.recent)
        while self.recent and total - self.recent[0][0] >= RECENT:
            total -= self.recent.popleft()[0]
        return sum(count * success for count, success in self.recent) / total if total else math.nan
