"""How many random cases the suite runs: a sample by default, all with `pytest --thorough`."""

from __future__ import annotations

import random
from collections.abc import Iterable, Sequence

import pytest

option = {"thorough": False}  # set by tests/conftest.py before it imports test modules


def cases(sample: int, thorough: int) -> int:
    """Return the number of random cases: `sample`, or `thorough` with `--thorough`."""
    return thorough if option["thorough"] else sample


def left_out(items: Iterable[pytest.Item]) -> list[pytest.Item]:
    """Return the cases that the sample leaves out of tests marked `sampled`.

    The sample of a test has each value of each of its parameters at least once, and is the same in each run.
    """
    tests: dict[str, list[pytest.Function]] = {}
    for item in items:
        if isinstance(item, pytest.Function) and item.get_closest_marker("sampled"):
            tests.setdefault(item.nodeid.partition("[")[0], []).append(item)
    kept = {id(item) for name, each in tests.items() for item in _sample(each, name)}
    return [item for each in tests.values() for item in each if id(item) not in kept]


def _sample(items: Sequence[pytest.Function], seed: str) -> list[pytest.Function]:
    """Return a few cases with all values, each chosen for the most values that no other has."""
    shuffled = random.Random(seed).sample(items, len(items))
    values = [frozenset((name, repr(value)) for name, value in item.callspec.params.items()) for item in shuffled]
    missing, chosen = frozenset().union(*values), []
    while missing:
        best = max(range(len(values)), key=lambda i: len(values[i] & missing))
        missing -= values[best]
        chosen.append(shuffled[best])
    return chosen
