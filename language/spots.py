"""Spots: where a thing would stand, and what is said of a thing."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, NamedTuple

from language import costs
from language.meanings import Entity, Gesture, Measure, RelationPhrase
from language.world import AT_END, FLAT, Thing, WorldModel

NEAR = 0.15  # metres from the middle of a thing up to which a thing or a spot is next to it
NOTED = 0.007  # metres by which a move differs from the length that was said, from which on that is told
MIDDLE = 0.125  # of a table's width or depth, from its middle, within which a thing is in neither half
BRUSHED = 0.3  # of the distance between neighbours: a thing that moved less was only brushed
Rest = tuple[float, float, int | None]  # x and y where a thing stood, and what it stood on or was in


@dataclass(eq=False, slots=True)
class MiddleDistance(Measure):
    """A length that is the distance between the middles of two things, not the gap between them."""


class Spot(NamedTuple):
    """A position of a thing: its centre, the height of its bottom, the thing below it, and a cost.

    why_not: why nothing can be put there, or "". note: what the person should know about it, or "".
    anchor: the thing that it is next to, by the words.
    """

    x: float
    y: float
    bottom: float
    on: int | None
    cost: float
    why_not: str = ""
    note: str = ""
    anchor: int | None = None


class Point(NamedTuple):
    """A place before it is checked: x, y, a cost, and the thing that it must stand on directly, if any.

    free: whether it should be empty. group: number of a group of equivalent places, such as those at an edge, of which
    the cheapest is taken; 0: none.
    """

    x: float
    y: float
    cost: float
    on: int | None = None
    free: bool = False
    group: int = 0


def on_ground(world: WorldModel) -> list[int]:
    """Return the things that can be carried and stand on the table or board."""
    return [i for i in range(len(world.things)) if world.is_loose(i) and world.is_on_ground(i)]


def is_operated(world: WorldModel, device: int) -> bool:
    """Whether a button, lever or wheel has been moved from its start."""
    return abs(world.moved.get(device, 0.0)) > AT_END


def pinned(index: int) -> Entity:
    """Return a phrase for one thing."""
    return Entity(pointed=Gesture((index,)))


def place_at(index: int, name: str) -> RelationPhrase:
    """Return the place that has a relation to one thing. name: of the relation."""
    return RelationPhrase(name, (pinned(index),))


def point_at(x: float, y: float) -> RelationPhrase:
    """Return the place at a point, as if a gesture showed it."""
    return RelationPhrase("here", (Entity("spot", pointed=Gesture((), (x, y))),))


def says_top(place: RelationPhrase) -> bool:
    """Whether a place is "on top" of what is not said."""
    side = [a.sides for a in place.anchors if a.kind in ("side", "thing") and not (a.noun or a.colors)]
    return place.value == "top" or (place.name == "on" and side == [("far",)])


def settle(world: WorldModel, mover: int, point: Point) -> Spot:
    """Return the position with its height: on the ground, or on top of what stands there."""
    column = world.column(point.x, point.y, mover)
    top = column[-1] if column else None
    x, y, cost = point.x, point.y, point.cost
    if top is None:
        why = "" if world.covers(x, y) else "that place is outside the board"
        if point.on is not None:
            why = "that is what shall be moved"
        return Spot(x, y, world.ground, None, cost, why)
    under = world.things[top]
    name = f"the {under.color} {under.kind}"
    if point.on is not None and point.on != top:
        covered = world.things[point.on]
        return Spot(x, y, under.top, top, cost, f"the {covered.color} {covered.kind} is under {name}")
    if point.on is None:
        cost += costs.OCCUPIED if point.free else 0.0
    if under.kind not in FLAT:
        return Spot(x, y, under.top, top, cost, f"nothing can stand on {name}")
    if world.flat_only and world.below[top] is not None:
        return Spot(x, y, under.top, top, cost, f"{name} stands on another one already, and nothing goes on top of two")
    mine = world.things[mover]
    if under.top + mine.top - mine.bottom > world.ceiling:
        return Spot(x, y, under.top, top, cost, f"the stack under {name} is as high as the arm reaches")
    return Spot(under.x, under.y, under.top, top, cost)


def elsewhere(world: WorldModel, blocking: int | None, moved: float, said: float) -> str:
    """Return what a person should know of a spot that is not the very place that was meant.

    Args:
        world: of the spot.
        blocking: what stands in the way, or None.
        moved, said: metres that the thing moves, and shall move; 0: no length was said.
    """
    why = "the rest is out of my reach" if blocking is None else f"{a_name(world, blocking)} is in the way"
    if abs(moved - said) > NOTED:
        return f"that is {100 * moved:.0f} cm, not {100 * said:.0f}: {why}"
    return "" if blocking is None else f"{why}, so I take the nearest free spot"


def facing(world: WorldModel, relation: RelationPhrase, alone: bool) -> RelationPhrase:
    """Return "closer to you" and the like as a direction, other relations as they are. alone: it is the only one.

    The person is opposite the robot; "forward" is away from whose left is meant.
    """
    kind = relation.anchors[0].kind if relation.anchors else ""
    measured = relation.measure is not None
    leaves = relation.name in ("away", "farthest", "from") and kind == "robot" and (alone or measured)
    comes = relation.name == "toward" or (relation.name == "to" and (kind == "robot" or measured))
    if not leaves and not (comes and (kind == "robot" or (kind == "person" and (world.hand is None or measured)))):
        return relation
    forward = (leaves or kind == "person") != (world.viewpoint == "human")
    value = "forward" if forward else "backward"
    return RelationPhrase("direction", (), relation.measure, value, relation.span)


def a_name(world: WorldModel, index: int) -> str:
    """Return a thing's colour and kind: "the red cube"; "your hand"."""
    thing = world.things[index]
    if index == world.hand:
        return "your hand"
    return f"the {'transparent ' * thing.target}{thing.color} {thing.kind}"


def enclosed(world: WorldModel, box: int, cost: float) -> Spot:
    """Return the place in a container or on the open hand."""
    thing = world.things[box]
    why = next((f"{a_name(world, box)} is full: {a_name(world, i)} is in it" for i in world.contents(box)), "")
    return Spot(thing.x, thing.y, thing.top if box == world.hand else thing.bottom, box, cost, why)


def is_elsewhere(now: WorldModel, then: WorldModel, index: int, least: float = BRUSHED) -> bool:
    """Return whether a thing is at another place than then. least: share of the distance between neighbours."""
    old, new, box = then.things[index], now.things[index], now.inside.get(index)
    if box is not None or index in then.inside:
        return box != then.inside.get(index)
    return math.dist((old.x, old.y, old.bottom), (new.x, new.y, new.bottom)) > least * now.pitch


def left_place(then: WorldModel, now: WorldModel, index: int) -> Rest | None:
    """Return where a thing stood then, if it was not held and is elsewhere or held now."""
    if then.held == index or not (now.held == index or is_elsewhere(now, then, index)):
        return None
    return then.things[index].x, then.things[index].y, then.inside.get(index, then.below[index])


def old_place(then: WorldModel, now: WorldModel, index: int, rests: Mapping[int, Rest]) -> Rest:
    """Return where a thing was before: then, if it has moved since; else before it was moved last; else its home."""
    if then.held != index and is_elsewhere(now, then, index) and (left := left_place(then, now, index)) is not None:
        return left
    thing = now.things[index]
    return rests.get(index) or (*now.home.get(index, (thing.x, thing.y)), None)


def pair_of(things: Sequence[Any], sign: float = 1.0) -> list[Any]:
    """Return the two of some things, each with x and y, that are closest together; with sign -1, farthest apart."""
    apart = lambda pair: sign * math.dist((pair[0].x, pair[0].y), (pair[1].x, pair[1].y))  # noqa: E731
    return list(min(combinations(things, 2), key=apart, default=()))


def half_of(world: WorldModel, things: Sequence[Any], sides: tuple[str, ...]) -> list[Any]:
    """Return which things, each with x and y, are in one half of a table; none for other sides, or on a board."""
    if len(sides) != 1 or sides[0] in ("center", "up", "top", "down") or world.cells:
        return []
    (x0, x1, y0, y1), (dx, dy), (x, y) = world.bounds, world.toward(world.side(sides[0])), world.center
    least = MIDDLE * ((x1 - x0) * abs(dx) + (y1 - y0) * abs(dy))
    return [each for each in things if dx * (each.x - x) + dy * (each.y - y) > least]


def along(world: WorldModel, side: str) -> Callable[[Any], float]:
    """Return a function of how far something with x and y is toward a side."""
    dx, dy = world.toward(side)
    return lambda each: dx * each.x + dy * each.y


def middle_of(world: WorldModel, things: Sequence[Any]) -> Any:
    """Return the one of some things, each with x and y, that is in the middle from left to right."""
    return sorted(things, key=along(world, "left"))[len(things) // 2]


def extent(world: WorldModel, index: int) -> float:
    """Return how large a thing is, in metres: its width; containers are larger than what fits in them."""
    return 1.0 if index in world.containers else round(world.things[index].width, 3)


def length_of(world: WorldModel, measure: Measure | None, default: float) -> float:
    """Return a length in the world's unit."""
    if measure is None:
        return default
    if measure.unit == "bit":
        return world.little
    if measure.unit == "cell":
        return measure.number * world.pitch
    metres = measure.number * float(measure.unit)
    return metres if not world.cells else float(round(metres / 0.05))


def end_of_reach(world: WorldModel, thing: Thing, dx: float, dy: float) -> str:
    """Return how far a thing can move in a direction, as the reason why it moves no further."""
    (x0, x1, y0, y1) = world.bounds
    rooms = [x1 - thing.x if dx > 0 else thing.x - x0] * bool(dx)
    rooms += [y1 - thing.y if dy > 0 else thing.y - y0] * bool(dy)
    return f"my reach ends after {100 * max(min(rooms), 0.0):.0f} cm that way"


def is_one_side(region: Entity) -> bool:
    """Whether a region says in which direction a thing moves: "2 cm on the left"."""
    return region.kind == "side" and len(region.sides) == 1 and region.sides[0] != "center"
