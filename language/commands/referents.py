"""Referents of phrases in a world: things, stacks and regions, each with a cost for an imperfect fit."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

from language.commands import costs
from language.commands.meanings import Entity, Gesture, Relation
from language.commands.world import FLAT, World

TIE = 0.1  # pitches: distances and coordinates this close are equal


class Ref(NamedTuple):
    """A referent. kind: "thing", "stack", or a kind of region. box: x from and to, y from and to. top: its height.

    things: indices, the lowest first. cost: how badly it fits.
    """

    kind: str
    box: tuple[float, float, float, float]
    top: float
    things: tuple[int, ...] = ()
    cost: float = 0.0

    @property
    def x(self) -> float:
        """The x of its middle."""
        return (self.box[0] + self.box[1]) / 2

    @property
    def y(self) -> float:
        """The y of its middle."""
        return (self.box[2] + self.box[3]) / 2


def distance(x: float, y: float, ref: Ref) -> float:
    """Returns the distance of a point to a referent's box."""
    x0, x1, y0, y1 = ref.box
    dx = x0 - x if x < x0 else x - x1 if x > x1 else 0.0
    dy = y0 - y if y < y0 else y - y1 if y > y1 else 0.0
    return math.hypot(dx, dy)


def spot(
    x: float, y: float, top: float = 0.0, kind: str = "cell", things: tuple[int, ...] = (), cost: float = 0.0
) -> Ref:
    """Returns the referent of a point."""
    return Ref(kind, (x, x, y, y), top, things, cost)


def thing_ref(world: World, index: int, cost: float = 0.0) -> Ref:
    """Returns the referent of a thing."""
    thing = world.things[index]
    return spot(thing.x, thing.y, thing.top, "thing", (index,), cost)


def color_fits(world: World, index: int, meant: tuple[str, ...]) -> bool:
    """Returns whether a thing has the colour: the likeliest meaning of the word that the world holds."""
    return world.things[index].color == next((color for color in meant if color in world.colors), None)


def heads(world: World, entity: Entity) -> list[Ref]:
    """Returns the referents of a phrase without its relations, superlatives and ranks."""
    found = _unshown(world, entity)
    if isinstance(entity.pointed, Gesture) and entity.kind in ("thing", "stack"):
        shown = set(entity.pointed.things)
        return [ref for ref in found if shown & set(ref.things)]
    return found


def _unshown(world: World, entity: Entity) -> list[Ref]:
    """Returns the referents of a phrase, whatever a gesture shows."""
    if entity.kind == "spot":
        return _shown(world, entity)
    if entity.kind == "thing" and entity.plural and not entity.every and not entity.number and entity.colors:
        return [*stacks(world, entity), *(ref._replace(cost=1.0) for ref in _things(world, entity))]
    if entity.kind == "thing":
        return _things(world, entity)
    if entity.kind == "stack":
        return stacks(world, entity)
    return regions(world, entity)


def _shown(world: World, entity: Entity) -> list[Ref]:
    """Returns the referents of a gesture: things or a place; before the gesture is known, all things."""
    if not isinstance(entity.pointed, Gesture):
        return [thing_ref(world, index) for index in range(len(world.things))]
    things = [thing_ref(world, index) for index in entity.pointed.things]
    return things if entity.pointed.place is None else [*things, spot(*entity.pointed.place)]


def _things(world: World, entity: Entity) -> list[Ref]:
    found = []
    for index, thing in enumerate(world.things):
        if index == world.hand:  # it is no thing that could be taken
            continue
        if entity.noun is not None and thing.kind != entity.noun:
            continue
        if not all(color_fits(world, index, color) for color in entity.colors):
            continue
        if entity.role is not None and thing.target != (entity.role == "target"):
            continue
        unsaid = costs.SEE_THROUGH * (thing.target and entity.role is None)
        cost = 0.0
        if entity.single:
            alone = (world.below[index] is None) + (world.above[index] is None)
            cost = (3.0, 1.5, 0.0)[alone]
        if entity.exposed and world.above[index] is not None:
            continue
        if entity.size is not None and not _sized(world, thing.width, entity.size):
            continue
        found.append(thing_ref(world, index, cost + unsaid))
    return found


def _sized(world: World, width: float, size: str) -> bool:
    widths = [thing.width for thing in world.things]
    middle = (min(widths) + max(widths)) / 2
    return width > middle if size == "large" else width < middle


def stacks(world: World, entity: Entity) -> list[Ref]:
    """Returns the runs of blocks, one upon the other, that have the phrase's colours."""
    found = []
    for base, below in enumerate(world.below):
        if world.held == base or world.things[base].kind not in FLAT:
            continue
        run: list[int] = []
        at: int | None = base
        while at is not None and world.things[at].kind in FLAT:
            run.append(at)
            cost = _stack_cost(world, entity, run)
            upper = world.above[at]
            if cost is not None and (len(run) > 1 or below is None):
                part = 0.5 * (below is not None) + 0.5 * (upper is not None and world.things[upper].kind in FLAT)
                single = 1.5 * (len(run) == 1)
                thing = world.things[at]
                found.append(spot(thing.x, thing.y, thing.top, "stack", tuple(run), cost + part + single))
            at = upper
    return found


def _stack_cost(world: World, entity: Entity, run: list[int]) -> float | None:
    """Returns how badly a run's colours fit, or None."""
    if not entity.colors:
        return 0.0
    for meant in entity.colors:
        if not any(color_fits(world, i, meant) for i in run):
            return None
    strange = sum(not any(color_fits(world, i, meant) for meant in entity.colors) for i in run)
    return 1.5 * min(strange, 2) if strange else 0.0


def regions(world: World, entity: Entity) -> list[Ref]:
    """Returns the parts of the board that a phrase may mean."""
    x0, x1, y0, y1 = world.bounds
    sides = [world.side(side) for side in entity.sides]
    names = {side for side in sides if side != "center"}
    if entity.kind == "corner":
        corners = [(x, y) for x in ("near", "far") for y in ("left", "right")]
        return [spot(*_corner(world, c), kind="corner") for c in corners if names <= set(c)]
    if entity.kind in ("edge", "side"):
        if len(names) > 1:
            return [spot(*_corner(world, tuple(names)), kind="corner")]
        if "center" in sides:
            return [spot(*world.center, kind="center")]
        wanted = names or {"left", "right", "far", "near"}
        return [Ref(entity.kind, edge_box(world, side), world.ground) for side in sorted(wanted)]
    if entity.kind == "center":
        return [spot(*world.center, kind="center")]
    if entity.kind in ("robot", "person"):
        x = x0 - world.pitch if entity.kind == "robot" else x1 + world.pitch
        return [Ref(entity.kind, (x, x, y0, y1), world.ground)]
    if entity.kind == "board":
        return [Ref("board", world.bounds, world.ground)]
    return []


def _corner(world: World, sides: Iterable[str]) -> tuple[float, float]:
    """Returns the point of a corner, of which one or two sides are named."""
    x, y = world.center
    x0, x1, y0, y1 = world.bounds
    for side in sides:
        dx, dy = world.toward(side)
        x = x if not dx else x1 if dx > 0 else x0
        y = y if not dy else y1 if dy > 0 else y0
    return x, y


def edge_box(world: World, side: str) -> tuple[float, float, float, float]:
    """Returns the box of an edge: the outermost row or column."""
    x0, x1, y0, y1 = world.bounds
    dx, dy = world.toward(side)
    if dx:
        return (x1, x1, y0, y1) if dx > 0 else (x0, x0, y0, y1)
    return (x0, x1, y1, y1) if dy > 0 else (x0, x1, y0, y0)


def best(refs: list[Ref], score: Callable[[Ref], float], tie: float) -> list[Ref]:
    """Returns the referents of the least score, and those within `tie` of it."""
    if not refs:
        return []
    scores = [score(ref) for ref in refs]
    least = min(scores)
    return [ref for ref, value in zip(refs, scores, strict=True) if value <= least + tie]


def without(relation: Relation, entity: Entity) -> tuple[Relation, ...]:
    """Returns the other relations of an entity."""
    return tuple(other for other in entity.relations if other is not relation)
