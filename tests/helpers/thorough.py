"""How many random cases the suite runs: a sample by default, all with `pytest --thorough`."""

from __future__ import annotations

import random
from collections.abc import Iterable, Iterator, Sequence

import pytest

option = {"thorough": False}  # set by tests/conftest.py before it imports test modules


def cases(sample: int, thorough: int) -> int:
    """Return the number of random cases: `sample`, or `thorough` with `--thorough`."""
    return thorough if option["thorough"] else sample


def some(names: Iterable[str], sample: int) -> list[str]:
    """Return `sample` of these names, evenly spread, or all of them with `--thorough`."""
    every = list(names)
    count = cases(min(sample, len(every)), len(every))
    return [every[i * len(every) // count] for i in range(count)]


def left_out(items: Iterable[pytest.Item]) -> list[pytest.Item]:
    """Return the cases that the sample leaves out of tests marked `sampled`.

    The sample of a test has each value of each of its parameters at least once, and each element of those that are
    tuples. It is the same in each run, and for all tests of a file with the same parameters.
    """
    tests: dict[str, list[pytest.Function]] = {}
    for item in items:
        if item.get_closest_marker("sampled") and hasattr(item, "callspec"):
            tests.setdefault(item.nodeid.partition("[")[0], []).append(item)
    kept = {id(item) for each in tests.values() for item in _sample(each)}
    return [item for each in tests.values() for item in each if id(item) not in kept]


def _sample(items: Sequence[pytest.Function]) -> list[pytest.Function]:
    """Return a few cases with all values, each chosen for the most values that no other has."""
    shuffled = random.Random(items[0].nodeid.partition("::")[0]).sample(items, len(items))
    values = [frozenset(_values(item)) for item in shuffled]
    missing, chosen = frozenset().union(*values), []
    while missing:
        best = max(range(len(values)), key=lambda i: len(values[i] & missing))
        missing -= values[best]
        chosen.append(shuffled[best])
    return chosen


def _values(item: pytest.Function) -> Iterator[tuple[str, int, str]]:
    for name, value in item.callspec.params.items():
        for i, element in enumerate(value if isinstance(value, tuple) else (value,)):
            yield name, i, repr(element)
