"""Where a thing may be put: the positions that a step's conjoined relations mean, each with its height and cost."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from language.commands import costs
from language.commands.meanings import Entity, Measure, Relation
from language.commands.referents import Ref, distance, regions, spot
from language.commands.relating import relation_cost
from language.commands.resolving import Resolver
from language.commands.world import FLAT, World

_SIDEWAYS = {"left": "left", "right": "right", "front": "front", "behind": "back"}
ONTO = ("on", "over", "in", "to", "at", "of", "with", "here")
_ASIDE = ("left", "right", "front", "back")  # for these, a free place may also be a little aside
FARTHEST = 4  # steps to a free place beside an anchor


class Spot(NamedTuple):
    """A position of a thing: its centre, the height of its bottom, the thing below it, and a cost.

    why_not: why nothing can be put there, or "".
    """

    x: float
    y: float
    bottom: float
    on: int | None
    cost: float
    why_not: str = ""


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


def spots(resolver: Resolver, mover: int, relations: tuple[Relation, ...], typed: bool = False) -> list[Spot]:
    """Returns the positions that all relations allow, the best first; those that cannot be used say why.

    typed: whether the moved thing was named with a noun, which "one" then repeats.
    """
    key = (mover, relations, typed)
    if key not in resolver.spots:
        resolver.spots[key] = _spots(resolver, mover, relations, typed)
    return resolver.spots[key]


def _spots(resolver: Resolver, mover: int, relations: tuple[Relation, ...], typed: bool) -> list[Spot]:
    if resolver.world.hand is not None and any(anchor.kind == "person" for anchor in relations[0].anchors):
        return [Spot(*resolver.world.in_hand, 0.0)]
    points = _points(resolver, mover, relations[0], typed)
    for relation in relations[1:]:
        points = _also(resolver, mover, points, relation)
    best: dict[tuple, Spot] = {}
    for point in sorted(points, key=lambda point: point.cost):
        known = best.get((point.group,))
        if known is not None and not known.why_not and not resolver.world.cells:
            continue  # on a table, the cheapest free place of a group is taken
        found = settle(resolver.world, mover, point)
        key = (point.group,) if point.group else (round(found.x, 3), round(found.y, 3))
        if key not in best or (bool(found.why_not), found.cost) < (bool(best[key].why_not), best[key].cost):
            best[key] = found
    return sorted(best.values(), key=lambda found: (bool(found.why_not), found.cost))


def settle(world: World, mover: int, point: Point) -> Spot:
    """Returns the position with its height: on the ground, or on top of what stands there."""
    column = world.column(point.x, point.y, mover)
    top = column[-1] if column else None
    x, y, cost = point.x, point.y, point.cost
    if top is None:
        why = "" if world.inside(x, y) else "that place is outside what the arm reaches"
        if point.on is not None:
            why = "that is what shall be moved"
        return Spot(x, y, world.ground, None, cost, why)
    under = world.things[top]
    if point.on is not None and point.on != top:
        covered = world.things[point.on]
        return Spot(
            x, y, under.top, top, cost, f"the {covered.color} {covered.kind} is under the {under.color} {under.kind}"
        )
    name = f"the {under.color} {under.kind}"
    if point.on is None:
        cost += costs.OCCUPIED if point.free else 0.0
    if under.kind not in FLAT:
        return Spot(x, y, under.top, top, cost, f"nothing can stand on {name}")
    if point.free and not world.cells:
        return Spot(x, y, under.top, top, cost, f"{name} is in the way")
    mine = world.things[mover]
    if under.top + mine.top - mine.bottom > world.ceiling:
        return Spot(x, y, under.top, top, cost, f"the stack under {name} is as high as the arm reaches")
    return Spot(under.x, under.y, under.top, top, cost)


def _points(resolver: Resolver, mover: int, relation: Relation, typed: bool) -> list[Point]:
    world = resolver.world
    if relation.name == "direction":
        return _shifted(world, mover, relation)
    region = relation.anchors[0] if relation.anchors else Entity()
    if relation.measure is not None and region.kind == "side" and len(region.sides) == 1:  # "one square on the left"
        return _shifted(world, mover, replace(relation, value=region.sides[0]))
    if relation.name == "between":
        return _middle(resolver, mover, relation)
    if not relation.anchors:
        return []
    found: list[Point] = []
    for number, anchor in enumerate(_anchors(resolver, relation, mover if typed else None), 1):
        if mover in anchor.things and (relation.name not in _SIDEWAYS or relation.anchors[0].kind != "it"):
            continue
        key = (mover, relation.name, relation.value, relation.measure, anchor[:4])
        if key not in resolver.points:
            resolver.points[key] = _by(world, mover, relation, anchor)
        points = resolver.points[key]
        group = number if len(points) > 1 else 0
        found += [point._replace(cost=point.cost + anchor.cost, group=group) for point in points]
    return found


def _anchors(resolver: Resolver, relation: Relation, mover: int | None) -> list[Ref]:
    """Returns the referents of the anchor and, at a cost, its referents among the things that can bear another one."""
    entity, things = relation.anchors[0], resolver.world.things
    refs = resolver.resolve(entity)
    if entity.kind == "thing" and entity.noun is None and mover is not None:
        kind = things[mover].kind
        refs = [
            ref._replace(cost=ref.cost + costs.ANOTHER_KIND * (things[ref.things[-1]].kind != kind)) for ref in refs
        ]
    if relation.name not in ONTO or entity.kind not in ("thing", "stack"):
        return refs
    known = {ref.things for ref in refs}
    free = [ref for ref in resolver.resolve(entity, resolver.bears) if ref.things not in known]
    return refs + [ref._replace(cost=ref.cost + costs.ONLY_USABLE) for ref in free]


def _by(world: World, mover: int, relation: Relation, anchor: Ref) -> list[Point]:
    """Returns the points in a relation to one anchor."""
    name = relation.name
    if world.cells and relation.measure is not None and name in ("over", "under"):  # "one square above the corner"
        return _beside(world, mover, anchor, "far" if name == "over" else "near", relation.measure)
    if name in _SIDEWAYS and anchor.kind == "board":  # "two squares to the left of the board"
        return _shifted(world, mover, replace(relation, name="direction", value=_SIDEWAYS[name]))
    if name in _SIDEWAYS:
        return _beside(world, mover, anchor, _SIDEWAYS[name], relation.measure)
    if name in ("near", "nearest"):
        return _around(world, mover, anchor)
    if anchor.things:
        if name == "farthest":
            return []
        onto = None if world.things[anchor.things[-1]].target else anchor.things[-1]  # a see-through thing is a place
        return [Point(anchor.x, anchor.y, 0.0, onto)] if name in ONTO else []
    if name == "opposite":
        x, y = world.center
        return [Point(2 * x - anchor.x, 2 * y - anchor.y, 0.0)]
    return _in_region(world, mover, anchor) if name in (*ONTO, "under") else []


def _in_region(world: World, mover: int, area: Ref) -> list[Point]:
    """Returns the points of a region, those near the moved thing first."""
    thing = world.things[mover]
    x0, x1, y0, y1 = area.box
    if area.kind in ("robot", "person"):
        area = spot(min(max(area.x, world.bounds[0]), world.bounds[1]), area.y)
        return [Point(area.x, area.y, 0.0)]
    if (x0, y0) == (x1, y1):
        if world.cells and area.kind == "center":
            return [Point(x, y, 0.0, free=True) for x in (int(x0), int(x0) + 1) for y in (int(y0), int(y0) + 1)]
        return [Point(x0, y0, 0.0, free=not world.cells)]
    count = 8 if world.cells else 15
    spread = [(x0 + (x1 - x0) * i / (count - 1), y0 + (y1 - y0) * i / (count - 1)) for i in range(count)]
    if area.kind == "board":
        steps = range(count)
        spread = [(x0 + (x1 - x0) * i / (count - 1), y0 + (y1 - y0) * j / (count - 1)) for i in steps for j in steps]
        spread.append((thing.x, thing.y))
    else:
        spread.append((min(max(thing.x, x0), x1), min(max(thing.y, y0), y1)))
    reach = world.pitch * 8
    return [Point(x, y, 0.5 * (abs(x - thing.x) + abs(y - thing.y)) / reach, free=True) for x, y in spread]


def _length(world: World, measure: Measure | None, default: float) -> float:
    """Returns a length in the world's unit."""
    if measure is None:
        return default
    if measure.unit == "bit":
        return world.little
    if measure.unit == "cell":
        return measure.number * world.pitch
    metres = measure.number * float(measure.unit)
    return metres if not world.cells else round(metres / 0.05)


def _shifted(world: World, mover: int, relation: Relation) -> list[Point]:
    thing = world.things[mover]
    if relation.value in ("up", "down") and world.cells and relation.measure is not None:
        relation = replace(relation, value="far" if relation.value == "up" else "near")
    if relation.value in ("up", "top", "down"):
        return [Point(thing.x, thing.y, 0.0)] if relation.value == "down" else []
    dx, dy = world.toward(relation.value or "left")
    length = _length(world, relation.measure, world.pitch)
    return [Point(thing.x + dx * length, thing.y + dy * length, 0.0, free=True)]


def _beside(world: World, mover: int, anchor: Ref, side: str, measure: Measure | None) -> list[Point]:
    dx, dy = world.toward(side)
    width = world.things[mover].width
    if world.cells or measure is not None:
        step = _length(world, measure, world.pitch)
        gap = 0.0
        if measure is not None and not world.cells and measure.unit not in ("cell",) and anchor.things:
            gap = (
                width + world.things[anchor.things[-1]].width
            ) / 2  # a length in centimetres is the gap between the two
        return [Point(anchor.x + dx * (step + gap), anchor.y + dy * (step + gap), 0.0, free=True)]
    steps = [width + 0.02 + world.pitch * i / 2 for i in range(2 * FARTHEST)]
    aside = [0.0, world.pitch, -world.pitch] if side in _ASIDE else [0.0]
    return [
        Point(
            anchor.x + dx * step + dy * off,
            anchor.y + dy * step + dx * off,
            0.2 * i + abs(off) / world.pitch,
            free=True,
        )
        for i, step in enumerate(steps)
        for off in aside
    ]


def _around(world: World, mover: int, anchor: Ref) -> list[Point]:
    """Returns the four neighbours of an anchor, the nearest to the moved thing first."""
    thing = world.things[mover]
    found = []
    for side in ("left", "right", "far", "near"):
        for point in _beside(world, mover, anchor, side, None):
            away = abs(point.x - thing.x) + abs(point.y - thing.y)
            found.append(point._replace(cost=point.cost + 0.02 * away / world.pitch))
    return found


def _middle(resolver: Resolver, mover: int, relation: Relation) -> list[Point]:
    refs = [resolver.resolve(anchor) for anchor in relation.anchors]
    pairs = [(a, b) for i, a in enumerate(refs[0]) for j, b in enumerate(refs[-1]) if len(refs) > 1 or i < j]
    found = []
    for one, other in pairs:
        if mover in one.things + other.things or one.things == other.things:
            continue
        x, y = (one.x + other.x) / 2, (one.y + other.y) / 2
        if resolver.world.cells and (x != int(x) or y != int(y)):
            x, y = float(round(x)), float(round(y))
        found.append(Point(x, y, one.cost + other.cost, free=True))
    return found


def _also(resolver: Resolver, mover: int, points: list[Point], relation: Relation) -> list[Point]:
    """Returns the points that are in a further relation, too."""
    world = resolver.world
    if relation.name == "direction" and relation.value in ("up", "top", "down"):
        return points
    if relation.name == "direction":
        sides = Entity("side", sides=(relation.value or "left",))
        relation = Relation("at", (sides,))
    if not relation.anchors:
        return points
    if relation.name in ("nearest", "near", "farthest") or (relation.anchors[0].kind in ("side", "center")):
        anchors = resolver.resolve(relation.anchors[0]) or regions(world, relation.anchors[0])
        sign = -1.0 if relation.name == "farthest" else 1.0
        away = [min((sign * distance(p.x, p.y, anchor) for anchor in anchors), default=0.0) for p in points]
        least = min(away, default=0.0)
        return [point for point, far in zip(points, away, strict=True) if far <= least + 0.25 * world.pitch]
    refs = [resolver.anchors(anchor) for anchor in relation.anchors]
    found = []
    resolver.weighed += len(points)
    for point in points:
        if relation.name in ONTO and any(point.on in ref.things for ref in refs[0].refs if point.on is not None):
            found.append(point)
            continue
        at = spot(point.x, point.y)
        if point.on is not None:
            at = at._replace(things=(point.on,))
        cost = relation_cost(world, at, relation, refs)
        if cost is not None:
            found.append(point._replace(cost=point.cost + cost))
    return found
