"""Which verb is said next: each as often as the others, or those that have failed lately more often."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

RATE = 0.03  # weight of the last outcome in the running mean
LEAST = 0.1  # weight of a verb that always succeeds, as a share of that of one that always fails


class VerbSampler:
    """Draws verbs.

    failures: (V,) running mean of the failures of each verb, over all worlds of the process.

    Args:
        verbs: all of them.
        worlds: N, whose outcomes are noted.
        automatic: draw each verb in proportion to its failures.
    """

    def __init__(self, verbs: Sequence[str], worlds: int, automatic: bool) -> None:
        self._verbs, self._automatic = tuple(verbs), automatic
        self.failures = np.ones(len(verbs))
        self._said = np.full(worlds, -1)  # the verb of each world's instruction; -1 before the first

    def draw(self, feasible: Sequence[str], rng: Generator) -> str:
        """One of these verbs."""
        if not self._automatic:
            return feasible[rng.integers(len(feasible))]
        weights = LEAST + self.failures[[self._verbs.index(verb) for verb in feasible]]
        return feasible[rng.choice(len(feasible), p=weights / weights.sum())]

    def begin(self, worlds: NDArray[np.int64], verbs: NDArray[np.int64], succeeded: NDArray[np.bool_]) -> None:
        """Notes that instructions with these verbs (n,) begin in these worlds (n,).

        succeeded: (n,) whether the instruction before it did.
        """
        for verb, success in zip(self._said[worlds].tolist(), succeeded.tolist(), strict=True):
            if verb >= 0:
                self.failures[verb] += RATE * ((not success) - self.failures[verb])
        self._said[worlds] = verbs
