"""Whether a referent stands in a relation to its anchors, as a cost.

The cost is 0 if the relation clearly holds, and None if it does not hold.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from language.commands import costs
from language.commands.meanings import Relation
from language.commands.referents import Ref, distance
from language.commands.world import World

_SIDEWAYS = {"left": "left", "right": "right", "front": "front", "behind": "back"}


def relation_cost(world: World, ref: Ref, relation: Relation, anchors: Sequence[Anchors]) -> float | None:
    """Returns the cost of a relation of a referent to the cheapest of its anchors' referents, or None."""
    if relation.name == "held":
        return 0.0 if world.held in ref.things else None
    if relation.name == "bare":
        return 0.0 if ref.things and world.above[ref.things[-1]] is None else None
    if relation.name == "between":
        return _between(world, ref, anchors)
    if not anchors:
        return None
    if relation.name == "here":
        away = min((distance(ref.x, ref.y, shown) for shown in anchors[0].refs), default=math.inf)
        return 0.0 if away < 0.5 * world.pitch else None
    near = anchors[0].candidates(world, ref, relation.name)
    found = (_cost(world, ref, relation, anchor) for anchor in near)
    pairs = [cost + anchor.cost for anchor, cost in zip(near, found, strict=True) if cost is not None]
    return min(pairs, default=None)


class Anchors:
    """The referents of an anchor, found by the things that they consist of."""

    def __init__(self, refs: list[Ref]) -> None:
        self.refs = refs
        self._areas = [ref for ref in refs if not ref.things]
        self._by_thing: dict[int, list[Ref]] = {}
        for ref in refs:
            for index in ref.things:
                self._by_thing.setdefault(index, []).append(ref)

    def candidates(self, world: World, ref: Ref, name: str) -> list[Ref]:
        """Returns the referents to which the relation may hold: for "on" and the like, those of the same column."""
        if not ref.things or name in _SIDEWAYS or name in ("beside", "opposite"):
            return self.refs
        chain, at = [], ref.things[0]
        neighbours = world.above if name in ("under", "with") else world.below
        while at is not None:
            chain.append(at)
            at = neighbours[at]  # type: ignore[assignment]
        found = {id(anchor): anchor for index in chain for anchor in self._by_thing.get(index, ())}
        return [*self._areas, *found.values()]


def _cost(world: World, ref: Ref, relation: Relation, anchor: Ref) -> float | None:
    if anchor is ref or (anchor.things and anchor.things == ref.things):
        return None
    name = relation.name
    if name in _SIDEWAYS:
        return _beside(world, ref, anchor, _SIDEWAYS[name], relation)
    if name == "beside":
        gap = distance(ref.x, ref.y, anchor)
        return 0.0 if 0.5 * world.pitch < gap <= 1.3 * world.pitch else None
    if name == "under":
        return _on(world, anchor, ref)
    if name == "with":
        return _on(world, anchor, ref)
    if name == "opposite":
        return _opposite(world, ref, anchor)
    if anchor.kind in ("thing", "stack"):
        cost = _on(world, ref, anchor, inside=name in ("from", "of", "in", "at"))
        raised = anchor.kind == "thing" and world.below[anchor.things[0]] is not None
        return cost if cost is None else cost + costs.ELEVATED * raised
    return _within(world, ref, anchor)


def _on(world: World, ref: Ref, anchor: Ref, inside: bool = False) -> float | None:
    """The cost of standing on the anchor: directly, or farther up. inside: also being the anchor stack's top."""
    if not ref.things or not anchor.things:
        return None
    lowest, highest = ref.things[0], anchor.things[-1]
    if lowest in anchor.things:
        topmost = lowest == highest and anchor.kind == "stack" and len(anchor.things) > 1
        return (0.2 if inside else costs.TOP_OF_STACK) if topmost else (1.5 if inside else None)
    below = world.below[lowest]
    if below == highest:
        return 0.0
    while below is not None:
        if below == highest:
            return costs.NOT_DIRECTLY
        below = world.below[below]
    return None


def _within(world: World, ref: Ref, area: Ref) -> float | None:
    """The cost of being in a region."""
    if area.kind == "board":
        standing = not ref.things or world.below[ref.things[0]] is None
        return 0.0 if standing else 0.5
    return 0.0 if distance(ref.x, ref.y, area) < 0.6 * world.pitch else None


def _beside(world: World, ref: Ref, anchor: Ref, side: str, relation: Relation) -> float | None:
    """The cost of being left of the anchor or the like: none for the neighbour in the same row."""
    dx, dy = world.toward(side)
    along = (dx * (ref.x - anchor.x) + dy * (ref.y - anchor.y)) / world.pitch
    aside = abs(dy * (ref.x - anchor.x) + dx * (ref.y - anchor.y)) / world.pitch
    if along < 0.5:
        return None
    if relation.measure is not None and relation.measure.unit == "cell":
        return 0.0 if abs(along - relation.measure.number) < 0.5 and aside < 0.5 else None
    return min(0.3 * max(aside - 0.5, 0.0) + 0.15 * (along - 1.0), 1.5) if along > 1 else 0.3 * max(aside - 0.5, 0.0)


def _opposite(world: World, ref: Ref, anchor: Ref) -> float | None:
    x, y = world.center
    mirrored = abs(ref.x + anchor.x - 2 * x) + abs(ref.y + anchor.y - 2 * y)
    return 0.0 if mirrored < 0.6 * world.pitch else None


def _between(world: World, ref: Ref, anchors: Sequence[Anchors]) -> float | None:
    pairs = [(a, b) for a in anchors[0].refs for b in anchors[-1].refs if a.things != b.things]
    costs_found = []
    for one, other in pairs:
        away = abs(ref.x - (one.x + other.x) / 2) + abs(ref.y - (one.y + other.y) / 2)
        span = abs(one.x - other.x) + abs(one.y - other.y)
        if set(ref.things).isdisjoint(one.things + other.things) and away < 0.5 * span:
            costs_found.append(one.cost + other.cost + away / max(span, 1e-9) + 0.1 * span / world.pitch)
    least = min(costs_found, default=None)
    return least
