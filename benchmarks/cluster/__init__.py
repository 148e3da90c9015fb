"""Collection, sweeps and evaluation on a Ray cluster: python -m benchmarks.cluster ROW --tries N.

The rows of the table, by name: each is registered by the module that measures it.
"""

from __future__ import annotations

import json
import os
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any


@dataclass
class RowResult:
    """The result of a row. failures: one line for each failed try. figures: further measured values."""

    tries: int = 0
    failures: list[str] = field(default_factory=list)
    figures: dict[str, Any] = field(default_factory=dict)

    def count(self, failure: str = "") -> None:
        """Count a try; a text that is not empty says how it failed."""
        self.tries += 1
        if failure:
            self.failures.append(failure)


Measure = Callable[[int, Random, Path], RowResult]  # (tries, generator, folder for its files)


@dataclass(frozen=True)
class Row:
    """A measurement.

    text: description. tries: how often by default. isolated: whether it runs in a network namespace of its own, where
    it starts nodes with addresses of their own.
    """

    text: str
    tries: int
    measure: Measure
    isolated: bool = False


ROWS: dict[str, Row] = {}


def row(name: str, text: str, tries: int, isolated: bool = False) -> Callable[[Measure], Measure]:
    """Register a function as the row of this name."""

    def register(measure: Measure) -> Measure:
        ROWS[name] = Row(text, tries, measure, isolated)
        return measure

    return register


def measure(name: str, row: Row, tries: int | None, seed: int) -> int:
    """Run a row and print its result, and the machine's load, as a line of JSON; return the number of failures."""
    start = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix=f"deixis-{name}-") as folder:
        outcome = row.measure(row.tries if tries is None else tries, Random(seed), Path(folder))
    values = {"row": name, "what": row.text, "tries": outcome.tries, "failures": len(outcome.failures)}
    values |= {"load": round(os.getloadavg()[0], 1), "seconds": round(time.perf_counter() - start, 1)}
    print(json.dumps(values | outcome.figures), flush=True)
    for line in outcome.failures:
        print(f"  {line}", flush=True)
    return len(outcome.failures)
