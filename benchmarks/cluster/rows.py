"""The rows of the table of the cluster, by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from benchmarks.faults.rows import Measure, Row


@dataclass(frozen=True)
class ClusterRow(Row):
    """isolated: it runs in a network namespace of its own, where it starts nodes with addresses of their own."""

    isolated: bool = False


ROWS: dict[str, ClusterRow] = {}


def row(name: str, text: str, tries: int, isolated: bool = False) -> Callable[[Measure], Measure]:
    """Register a function as the row of this name."""

    def register(measure: Measure) -> Measure:
        ROWS[name] = ClusterRow(text, tries, measure, isolated)
        return measure

    return register
