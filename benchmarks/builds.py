"""Speed of two builds of PyBullet: `python -m benchmarks.builds PYTHON PYTHON [--rounds 5]`.

Each argument is the interpreter of an environment with Deixis, such as one of Python 3.11 (pybullet 3.2.7) and one of
3.13 (pybullet-arm64 3.2.8). Rounds are interleaved. Prints rates and the median ratio of the second to the first.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
from collections.abc import Sequence

WORKLOADS = {"env_kuka": 6_400, "env_place": 3_200, "env_panda_matched": 3_200, "pictures": 30}  # and their steps


def measure(python: str, workload: str, steps: int) -> float:
    """Return the rate of a workload of `benchmarks.ours` with this interpreter, one core."""
    words = [python, "-m", "benchmarks.ours", workload, "--steps", str(steps)]
    environment = os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": os.getcwd()}
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True)
    return float(json.loads(done.stdout.splitlines()[-1])["rate"])


def cli(words: Sequence[str] | None = None) -> int:
    """Print a row for each workload. Returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pythons", nargs=2, metavar="PYTHON")
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args(words)
    first, second = options.pythons
    print("| workload | first, a second | second, a second | second / first | least and most |\n|---|---|---|---|---|")
    for workload, steps in WORKLOADS.items():
        pairs = []
        for index in range(options.rounds):
            order = (first, second) if index % 2 == 0 else (second, first)
            rates = {python: measure(python, workload, steps) for python in order}
            pairs.append((rates[first], rates[second]))
        ratios = [b / a for a, b in pairs]
        medians = [f"{statistics.median(column):,.4g}" for column in zip(*pairs, strict=True)]
        found = f"{statistics.median(ratios):.2f} | {min(ratios):.2f} to {max(ratios):.2f}"
        print(f"| {workload} | {medians[0]} | {medians[1]} | {found} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(cli())
