"""Rows of the table of the cluster: python -m benchmarks.cluster equal faults --tries 4."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys

from benchmarks.cluster import ROWS, ceiling, measure, runs  # noqa: F401  the modules register the rows
from benchmarks.cluster.network import PORT, SETTINGS, Network, address

NODES = 4  # namespaces beside the head's
INSIDE = "DEIXIS_BENCHMARK_INSIDE"  # set in the process that runs in the head's namespace


def main() -> None:
    """Run the rows that the command line names. Exits with 1 if a try failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", nargs="*", help=f"of {', '.join(ROWS)}; by default all")
    parser.add_argument("--tries", type=int, help="of each row; by default as many as the row wants")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    unknown = [name for name in arguments.rows if name not in ROWS]
    if unknown:
        parser.error(f"unknown rows: {', '.join(unknown)}; choose from {', '.join(ROWS)}")
    failed = [run(name, arguments.tries, arguments.seed) for name in arguments.rows or ROWS]
    sys.exit(int(any(failed)))


def run(name: str, tries: int | None, seed: int) -> int:
    """Run a row, in the head's network namespace if it needs one; return the number of failures."""
    if INSIDE in os.environ:
        return measure(name, ROWS[name], tries, seed)
    if not ROWS[name].isolated:
        os.environ["RAY_ADDRESS"] = "local"
        return measure(name, ROWS[name], tries, seed)
    words = [sys.executable, "-m", "benchmarks.cluster", name, f"--seed={seed}"]
    words += [] if tries is None else [f"--tries={tries}"]
    own = {INSIDE: "1", "RAY_ADDRESS": f"{address(0)}:{PORT}", "OMP_NUM_THREADS": "1"}
    environment = os.environ | SETTINGS | own
    with Network(NODES):
        return subprocess.run(["ip", "netns", "exec", "deixis-0", *words], env=environment).returncode


if __name__ == "__main__":
    main()
