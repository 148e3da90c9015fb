"""Pruning of the chart: of the items of the same span only the cheapest are kept."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

from language.lattice import Item


class Joined(NamedTuple):
    """A sequence of clauses and a further one, before they are joined: few of those that are weighed ever are."""

    end: int
    item: Item
    cost: float
    clause: Item


Costed = TypeVar("Costed", Item, Joined)


def cheapest(items: list[Costed], kept: int) -> list[Costed]:
    """Return the cheapest items of each span."""
    spans: dict[int, list[Costed]] = {}
    for item in sorted(items, key=lambda item: item.cost):
        same = spans.setdefault(item.end, [])
        if len(same) < kept:
            same.append(item)
    return [item for same in spans.values() for item in same]
