"""Pruning of the chart: of the items of the same span only the cheapest are kept."""

from __future__ import annotations

import math
from collections.abc import Callable
from operator import attrgetter
from typing import Any, NamedTuple, TypeVar

from language.lattice import Item


class Joined(NamedTuple):
    """A sequence of clauses and a further one, before they are joined: few of those that are weighed ever are."""

    end: int
    item: Item
    cost: float
    clause: Item


Costed = TypeVar("Costed", Item, Joined)


def cheapest(
    items: list[Costed], kept: int, worse: float = math.inf, span: Callable[[Costed], Any] = attrgetter("end")
) -> list[Costed]:
    """Return the cheapest items of each span, and none that costs so much more than the best of it."""
    spans: dict[Any, list[Costed]] = {}
    for item in sorted(items, key=lambda item: item.cost):
        same = spans.setdefault(span(item), [])
        if len(same) < kept and (not same or item.cost <= same[0].cost + worse):
            same.append(item)
    return [item for same in spans.values() for item in same]
