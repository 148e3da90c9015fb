"""Where a thing may be put: the positions that a clause's conjoined relations mean, each with its height and cost.

On a board they are cells. On a table they are the free spots of a fine grid nearest to where the words point
(`language.wishes`).
"""

from __future__ import annotations

from dataclasses import replace

from language.meanings import Entity, Measure, RelationPhrase
from language.referents import SIDEWAYS, Ref, Resolver, distance, regions, relation_cost, spot
from language.spots import Point, Spot, enclosed, is_one_side, length_of, settle
from language.wishes import ONTO, anchors_of, on_table, pairs_of
from language.world import WorldModel

_APART = ("toward", "away", "farthest", *SIDEWAYS)


def spots(resolver: Resolver, mover: int, relations: tuple[RelationPhrase, ...], typed: bool = False) -> list[Spot]:
    """Return the positions that all relations allow, the best first; those that cannot be used say why.

    typed: whether the moved thing was named with a noun, which "one" then repeats.
    """
    key = (mover, relations, typed)
    if key not in resolver.spots:
        resolver.spots[key] = _spots(resolver, mover, relations, typed)
    return resolver.spots[key]


def _spots(resolver: Resolver, mover: int, relations: tuple[RelationPhrase, ...], typed: bool) -> list[Spot]:
    world = resolver.world
    reached = [each for each in relations if each.name not in _APART and each.measure is None]
    given = any(anchor.kind == "person" for each in reached for anchor in each.anchors)
    if world.hand is not None and given:
        return [enclosed(world, world.hand, 0.0)]
    if not world.cells:
        return on_table(resolver, mover, relations, typed)
    points = _points(resolver, mover, relations[0], typed)
    for relation in relations[1:]:
        points = _also(resolver, points, relation)
    best: dict[tuple, Spot] = {}
    for point in sorted(points, key=lambda point: point.cost):
        found = settle(world, mover, point)
        key = (point.group,) if point.group else (round(found.x, 3), round(found.y, 3))
        if key not in best or (bool(found.why_not), found.cost) < (bool(best[key].why_not), best[key].cost):
            best[key] = found
    return sorted(best.values(), key=lambda found: (bool(found.why_not), found.cost))


def _points(resolver: Resolver, mover: int, relation: RelationPhrase, typed: bool) -> list[Point]:
    world = resolver.world
    if relation.name == "direction":
        return _shifted(world, mover, relation)
    region = relation.anchors[0] if relation.anchors else Entity()
    if relation.measure is not None and is_one_side(region):  # "one square on the left"
        return _shifted(world, mover, replace(relation, value=region.sides[0]))
    if relation.name == "between":
        return _middle(resolver, mover, relation)
    if not relation.anchors:
        return []
    found: list[Point] = []
    for number, anchor in enumerate(anchors_of(resolver, relation, mover if typed else None), 1):
        if mover in anchor.things and (relation.name not in SIDEWAYS or relation.anchors[0].kind != "it"):
            continue
        key = (mover, relation.name, relation.value, relation.measure, anchor[:4])
        if key not in resolver.points:
            resolver.points[key] = _by(world, mover, relation, anchor)
        points = resolver.points[key]
        group = number if len(points) > 1 else 0
        found += [point._replace(cost=point.cost + anchor.cost, group=group) for point in points]
    return found


def _by(world: WorldModel, mover: int, relation: RelationPhrase, anchor: Ref) -> list[Point]:
    """Return the points in a relation to one anchor."""
    name = relation.name
    if world.cells and relation.measure is not None and name in ("over", "under"):  # "one square above the corner"
        return _beside(world, anchor, "far" if name == "over" else "near", relation.measure)
    if name in SIDEWAYS and anchor.kind == "board":  # "two squares to the left of the board"
        return _shifted(world, mover, replace(relation, name="direction", value=SIDEWAYS[name]))
    if name in SIDEWAYS:
        return _beside(world, anchor, SIDEWAYS[name], relation.measure)
    if name in ("near", "nearest"):
        return _around(world, mover, anchor)
    if anchor.things:
        if name == "farthest" or relation.measure is not None:  # nothing is two cells on a thing
            return []
        onto = None if world.things[anchor.things[-1]].target else anchor.things[-1]  # a see-through thing is a place
        return [Point(anchor.x, anchor.y, 0.0, onto)] if name in ONTO else []
    if name == "opposite":
        x, y = world.center
        return [Point(2 * x - anchor.x, 2 * y - anchor.y, 0.0)]
    return _in_region(world, mover, anchor) if name in (*ONTO, "under") else []


def _in_region(world: WorldModel, mover: int, area: Ref) -> list[Point]:
    """Return the cells of a region, those near the moved thing first."""
    thing = world.things[mover]
    x0, x1, y0, y1 = area.box
    if area.kind in ("robot", "person"):
        return [Point(min(max(area.x, world.bounds[0]), world.bounds[1]), area.y, 0.0)]
    if (x0, y0) == (x1, y1):
        if area.kind == "center":
            return [Point(x, y, 0.0, free=True) for x in (int(x0), int(x0) + 1) for y in (int(y0), int(y0) + 1)]
        return [Point(x0, y0, 0.0)]
    spread = [(x0 + (x1 - x0) * i / 7, y0 + (y1 - y0) * i / 7) for i in range(8)]
    if area.kind == "board":
        spread = [(x0 + (x1 - x0) * i / 7, y0 + (y1 - y0) * j / 7) for i in range(8) for j in range(8)]
        spread.append((thing.x, thing.y))
    else:
        spread.append((min(max(thing.x, x0), x1), min(max(thing.y, y0), y1)))
    return [Point(x, y, 0.5 * (abs(x - thing.x) + abs(y - thing.y)) / 8, free=True) for x, y in spread]


def _shifted(world: WorldModel, mover: int, relation: RelationPhrase) -> list[Point]:
    thing = world.things[mover]
    if relation.value in ("up", "down") and world.cells and relation.measure is not None:
        relation = replace(relation, value="far" if relation.value == "up" else "near")
    if relation.value in ("up", "top", "down"):
        return [Point(thing.x, thing.y, 0.0)] if relation.value == "down" else []
    dx, dy = world.toward(relation.value or "left")
    length = length_of(world, relation.measure, world.pitch)
    return [Point(thing.x + dx * length, thing.y + dy * length, 0.0, free=True)]


def _beside(world: WorldModel, anchor: Ref, side: str, measure: Measure | None) -> list[Point]:
    dx, dy = world.toward(side)
    step = length_of(world, measure, world.pitch)
    return [Point(anchor.x + dx * step, anchor.y + dy * step, 0.0, free=True)]


def _around(world: WorldModel, mover: int, anchor: Ref) -> list[Point]:
    """Return the four neighbours of an anchor, the nearest to the moved thing first."""
    thing = world.things[mover]
    found = []
    for side in ("left", "right", "far", "near"):
        for point in _beside(world, anchor, side, None):
            away = abs(point.x - thing.x) + abs(point.y - thing.y)
            found.append(point._replace(cost=point.cost + 0.02 * away / world.pitch))
    return found


def _middle(resolver: Resolver, mover: int, relation: RelationPhrase) -> list[Point]:
    refs = [resolver.resolve(anchor) for anchor in relation.anchors]
    found = []
    for one, other in pairs_of(refs, mover):
        x, y = (one.x + other.x) / 2, (one.y + other.y) / 2
        if resolver.world.cells and (x != int(x) or y != int(y)):
            x, y = float(round(x)), float(round(y))
        found.append(Point(x, y, one.cost + other.cost, free=True))
    return found


def _also(resolver: Resolver, points: list[Point], relation: RelationPhrase) -> list[Point]:
    """Return the points that are in a further relation, too."""
    world = resolver.world
    if relation.name == "direction" and relation.value in ("up", "top", "down"):
        return points
    if relation.name == "direction":
        sides = Entity("side", sides=(relation.value or "left",))
        relation = RelationPhrase("at", (sides,))
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
