"""Runs rows of the table of faults and prints it: python -m benchmarks.faults resume workers --tries 10."""

from __future__ import annotations

import benchmarks.faults
from benchmarks.faults.rows import ROWS, measure, run_table


def main() -> None:
    """Run the rows that the command line names. Exits with 1 if a try failed."""
    run_table(benchmarks.faults, ROWS, str(__doc__), lambda name, *options: measure(name, ROWS[name], *options))


if __name__ == "__main__":
    main()
