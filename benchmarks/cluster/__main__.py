"""Runs rows of the table of the cluster and prints it: python -m benchmarks.cluster equal faults --tries 4."""

from __future__ import annotations

import os
import subprocess
import sys

import benchmarks.cluster
from benchmarks.cluster.network import PORT, SETTINGS, Network, address
from benchmarks.cluster.rows import ROWS
from benchmarks.faults.rows import measure, run_table

NODES = 4  # namespaces beside the head's
INSIDE = "DEIXIS_BENCHMARK_INSIDE"  # set in the process that runs in the head's namespace


def main() -> None:
    """Run the rows that the command line names. Exits with 1 if a try failed."""
    run_table(benchmarks.cluster, ROWS, str(__doc__), run)


def run(name: str, tries: int | None, seed: int) -> int:
    """Run a row, in the head's network namespace if it needs one. Returns the number of failures."""
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
