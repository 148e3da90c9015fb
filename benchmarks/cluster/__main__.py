"""Runs rows of the table of the cluster and prints it: python -m benchmarks.cluster equal faults --tries 4."""

from __future__ import annotations

import argparse
import importlib
import json
import os
import pkgutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from random import Random

import benchmarks.cluster
from benchmarks.cluster.network import PORT, SETTINGS, Network, address
from benchmarks.cluster.rows import ROWS

NODES = 4  # namespaces beside the head's
INSIDE = "DEIXIS_BENCHMARK_INSIDE"  # set in the process that runs in the head's namespace


def main() -> None:
    """Parse the command line and run the rows. Exits with 1 if a try failed."""
    for module in pkgutil.iter_modules(benchmarks.cluster.__path__):
        if module.name != "__main__":
            importlib.import_module(f"benchmarks.cluster.{module.name}")
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", nargs="*", help=f"of {', '.join(ROWS)}; by default all")
    parser.add_argument("--tries", type=int, help="of each row; by default as many as the row wants")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    unknown = [name for name in arguments.rows if name not in ROWS]
    if unknown:
        parser.error(f"unknown rows: {', '.join(unknown)}; choose from {', '.join(ROWS)}")
    failures = sum(run(name, arguments.tries, arguments.seed) for name in arguments.rows or ROWS)
    sys.exit(int(failures > 0))


def run(name: str, tries: int | None, seed: int) -> int:
    """Run a row, in the head's network namespace if it needs one. Returns the number of failures."""
    if INSIDE in os.environ:
        return measure(name, tries, seed)
    if not ROWS[name].isolated:
        os.environ["RAY_ADDRESS"] = "local"
        return measure(name, tries, seed)
    words = [sys.executable, "-m", "benchmarks.cluster", name, f"--seed={seed}"]
    words += [] if tries is None else [f"--tries={tries}"]
    own = {INSIDE: "1", "RAY_ADDRESS": f"{address(0)}:{PORT}", "OMP_NUM_THREADS": "1"}
    environment = os.environ | SETTINGS | own
    with Network(NODES):
        return subprocess.run(["ip", "netns", "exec", "deixis-0", *words], env=environment).returncode


def measure(name: str, tries: int | None, seed: int) -> int:
    """Run a row and print what it found as a line of JSON. Returns the number of failures."""
    row = ROWS[name]
    start = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix=f"cluster-{name}-") as folder:
        outcome = row.measure(row.tries if tries is None else tries, Random(seed), Path(folder))
    values = {"row": name, "what": row.text, "tries": outcome.tries, "failures": len(outcome.failures)}
    values |= {"load": round(os.getloadavg()[0], 1), "seconds": round(time.perf_counter() - start, 1)}
    print(json.dumps(values | outcome.figures), flush=True)
    for line in outcome.failures:
        print(f"  {line}", flush=True)
    return len(outcome.failures)


if __name__ == "__main__":
    main()
