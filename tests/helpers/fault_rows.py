"""Rows of the table of faults: how often a fault was tried, and which tries failed."""

from __future__ import annotations

import json
import os
import time
from dataclasses import dataclass, field
from random import Random
from typing import Any

from tests.helpers.thorough import cases


@dataclass
class FaultRow:
    """Tries of one fault.

    name: of the row. wanted: the tries that the command line asks for; None: as many as the row has by itself.
    rng: chooses faults. failures: a line for each failed try. figures: further measured values.
    """

    name: str
    wanted: int | None = None
    rng: Random = field(default_factory=lambda: Random(0))
    tries: int = 0
    failures: list[str] = field(default_factory=list)
    figures: dict[str, Any] = field(default_factory=dict)
    began: float = field(default_factory=time.perf_counter)

    def number(self, sample: int, thorough: int) -> int:
        """Return how many tries to make: `sample`, `thorough` with `--thorough`, or those of `--tries`."""
        return cases(sample, thorough) if self.wanted is None else self.wanted

    def count(self, failure: str = "") -> None:
        """Count a try; a text that is not empty says how it failed."""
        self.tries += 1
        if failure:
            self.failures.append(failure)

    def check(self) -> None:
        """Assert that there were tries and that none failed."""
        assert self.tries
        assert not self.failures, "\n".join([f"{len(self.failures)} of {self.tries} failed:", *self.failures])

    def line(self) -> str:
        """Return the row as JSON, with the machine's load."""
        values = {"row": self.name, "tries": self.tries, "failures": len(self.failures)}
        values |= {"load": round(os.getloadavg()[0], 1), "seconds": round(time.perf_counter() - self.began, 1)}
        return json.dumps(values | self.figures)
