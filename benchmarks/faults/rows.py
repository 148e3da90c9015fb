"""Tables of measurements whose rows are run by name: their rows, their command line and their output."""

from __future__ import annotations

import argparse
import importlib
import json
import os
import pkgutil
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from types import ModuleType
from typing import Any


@dataclass
class Outcome:
    """The result of a row. failures: one line for each failed try. figures: further measured values."""

    tries: int = 0
    failures: list[str] = field(default_factory=list)
    figures: dict[str, Any] = field(default_factory=dict)

    def count(self, failure: str = "") -> None:
        """Count a try; a text that is not empty says how it failed."""
        self.tries += 1
        if failure:
            self.failures.append(failure)


Measure = Callable[[int, Random, Path], Outcome]  # (tries, generator, folder for its files)


@dataclass(frozen=True)
class Row:
    """text: description. tries: how often by default."""

    text: str
    tries: int
    measure: Measure


ROWS: dict[str, Row] = {}


def row(name: str, text: str, tries: int) -> Callable[[Measure], Measure]:
    """Register a function as the row of this name."""

    def register(measure: Measure) -> Measure:
        ROWS[name] = Row(text, tries, measure)
        return measure

    return register


def run_table(
    package: ModuleType, rows: Mapping[str, Row], text: str, run: Callable[[str, int | None, int], int]
) -> None:
    """Parse the command line and run the rows that it names. Exits with 1 if a try failed.

    Args:
        package: its modules register the rows.
        rows: by name, once the modules are imported.
        text: of the help.
        run: given a row's name, --tries and --seed; returns the number of failures.
    """
    for module in pkgutil.iter_modules(package.__path__):
        if module.name != "__main__":
            importlib.import_module(f"{package.__name__}.{module.name}")
    parser = argparse.ArgumentParser(description=text)
    parser.add_argument("rows", nargs="*", help=f"of {', '.join(rows)}; by default all")
    parser.add_argument("--tries", type=int, help="of each row; by default as many as the row wants")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    unknown = [name for name in arguments.rows if name not in rows]
    if unknown:
        parser.error(f"unknown rows: {', '.join(unknown)}; choose from {', '.join(rows)}")
    failed = [run(name, arguments.tries, arguments.seed) for name in arguments.rows or rows]
    sys.exit(int(any(failed)))


def measure(name: str, row: Row, tries: int | None, seed: int) -> int:
    """Run a row and print its result, and the machine's load, as a line of JSON. Returns the number of failures."""
    start = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix=f"deixis-{name}-") as folder:
        outcome = row.measure(row.tries if tries is None else tries, Random(seed), Path(folder))
    values = {"row": name, "what": row.text, "tries": outcome.tries, "failures": len(outcome.failures)}
    values |= {"load": round(os.getloadavg()[0], 1), "seconds": round(time.perf_counter() - start, 1)}
    print(json.dumps(values | outcome.figures), flush=True)
    for line in outcome.failures:
        print(f"  {line}", flush=True)
    return len(outcome.failures)
