"""The rows of the table of faults, by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any


@dataclass
class Outcome:
    """What a row found. failures: one line for each failed try. figures: what was measured beside them."""

    tries: int = 0
    failures: list[str] = field(default_factory=list)
    figures: dict[str, Any] = field(default_factory=dict)

    def count(self, failure: str = "") -> None:
        """Counts a try; a text that is not empty says how it failed."""
        self.tries += 1
        if failure:
            self.failures.append(failure)


Measure = Callable[[int, Random, Path], Outcome]  # (tries, generator, folder for its files)


@dataclass(frozen=True)
class Row:
    """text: what is done. tries: how often by default."""

    text: str
    tries: int
    measure: Measure


ROWS: dict[str, Row] = {}


def row(name: str, text: str, tries: int) -> Callable[[Measure], Measure]:
    """Registers a function as the row of this name."""

    def register(measure: Measure) -> Measure:
        ROWS[name] = Row(text, tries, measure)
        return measure

    return register
