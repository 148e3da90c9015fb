"""Runs rows of the table of faults and prints it: python -m benchmarks.faults resume workers --tries 10."""

from __future__ import annotations

import argparse
import importlib
import json
import pkgutil
import sys
import tempfile
import time
from pathlib import Path
from random import Random

import benchmarks.faults
from benchmarks.faults.rows import ROWS


def main() -> None:
    """Parse the command line and run the rows. Exits with 1 if a try failed."""
    for module in pkgutil.iter_modules(benchmarks.faults.__path__):
        if module.name != "__main__":
            importlib.import_module(f"benchmarks.faults.{module.name}")
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", nargs="*", help=f"of {', '.join(ROWS)}; by default all")
    parser.add_argument("--tries", type=int, help="of each row; by default as many as the row wants")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    unknown = [name for name in arguments.rows if name not in ROWS]
    if unknown:
        parser.error(f"unknown rows: {', '.join(unknown)}; choose from {', '.join(ROWS)}")
    failed = [measure(name, arguments.tries, arguments.seed) for name in arguments.rows or ROWS]
    sys.exit(int(any(failed)))


def measure(name: str, tries: int | None, seed: int) -> int:
    """Run a row and print what it found as a line of JSON. Returns the number of failures."""
    row = ROWS[name]
    start = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix=f"faults-{name}-") as folder:
        outcome = row.measure(row.tries if tries is None else tries, Random(seed), Path(folder))
    values = {"row": name, "what": row.text, "tries": outcome.tries, "failures": len(outcome.failures)}
    print(json.dumps(values | {"seconds": round(time.perf_counter() - start, 1)} | outcome.figures), flush=True)
    for line in outcome.failures:
        print(f"  {line}", flush=True)
    return len(outcome.failures)


if __name__ == "__main__":
    main()
