"""Draws the first verb of an episode: uniformly, or in proportion to recent failures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

RATE = 0.03  # weight of the last outcome in the running mean
LEAST = 0.1  # weight of a verb that always succeeds, as a share of that of one that always fails


class VerbSampler:
    """Draws verbs.

    failures: (V,) running mean of the failures of each verb, over all worlds of the process; 1 before any has ended.

    Args:
        verbs: all of them.
        automatic: draw each verb in proportion to its failures.
    """

    def __init__(self, verbs: Sequence[str], automatic: bool) -> None:
        self._verbs, self._automatic = tuple(verbs), automatic
        self.failures = np.ones(len(verbs))

    def draw(self, feasible: Sequence[str], rng: Generator) -> str:
        """One of these verbs."""
        if not self._automatic:
            return feasible[int(rng.integers(len(feasible)))]
        weights = LEAST + self.failures[[self._verbs.index(verb) for verb in feasible]]
        return feasible[int(rng.choice(len(feasible), p=weights / weights.sum()))]

    def note(self, verbs: NDArray[np.int64], succeeded: NDArray[np.bool_]) -> None:
        """Takes the outcomes (n,) of instructions with these verbs (n,)."""
        for verb, success in zip(verbs.tolist(), succeeded.tolist(), strict=True):
            self.failures[verb] += RATE * ((not success) - self.failures[verb])
