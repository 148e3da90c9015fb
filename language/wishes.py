"""Where a thing may be put on a table: what a relation asks for, and the free spot that is nearest to it."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from language import costs
from language.free_spots import GRID, SHARES, clear_of, free_grid, grid
from language.meanings import Entity, Measure, RelationPhrase
from language.referents import SIDEWAYS, Ref, Resolver, thing_ref
from language.spots import (
    NEAR,
    MiddleDistance,
    Point,
    Spot,
    a_name,
    elsewhere,
    enclosed,
    end_of_reach,
    facing,
    is_one_side,
    left_place,
    length_of,
    settle,
)
from language.world import FIXED, WorldModel

Mask = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.bool_]]  # x, y -> which of them fit

SPOT = 8  # points that are compared for the effort of looking for one free spot
ONTO = ("on", "over", "in", "to", "at", "of", "with", "here")


class SpotWish(NamedTuple):
    """Where something should go: nominal x and y, None where the words leave it open; which spots will do; a cost.

    spot: the only spot that is meant, such as on a thing or in a container. what: in words. length: how far it shall
    move, if that is said. why_not: why nothing fits, where that is known.
    """

    x: float | None
    y: float | None
    fits: Mask
    cost: float = 0.0
    spot: Spot | None = None
    what: str = ""
    anchor: int | None = None
    length: float = 0.0
    why_not: str = ""


def on_table(resolver: Resolver, mover: int, relations: tuple[RelationPhrase, ...], typed: bool) -> list[Spot]:
    world = resolver.world
    moves = sum(each.name != "direction" for each in relations) < 2  # "away from you and to the left"
    relations = tuple(facing(world, each, moves) for each in relations)
    back = any(each.name == "home" for each in relations)  # "back where it was" has one direction
    directions = tuple(each for each in relations if each.name == "direction" and not back)
    others = [each for each in relations if each.name != "direction"]
    wishes = [_wishes(resolver, mover, each, typed, len(relations) < 2) for each in others]
    if directions:
        wishes.append(_shifts(world, mover, directions, bool(wishes), resolver.aloft))
    found = []
    for chosen in product(*wishes):
        resolver.weighed += SPOT
        single = [wish.spot for wish in chosen if wish.spot is not None]
        cost = sum(wish.cost for wish in chosen)
        spot = single[0]._replace(cost=cost) if single else free_spot(world, mover, list(chosen), cost)
        found.append(spot._replace(anchor=next((wish.anchor for wish in chosen if wish.anchor is not None), None)))
    best: dict[tuple, Spot] = {}
    for each in sorted(found, key=lambda each: (bool(each.why_not), each.cost)):
        best.setdefault((round(each.x, 3), round(each.y, 3), each.on, each.anchor), each)
    return list(best.values())


def free_spot(world: WorldModel, mover: int, wishes: list[SpotWish], cost: float = 0.0) -> Spot:
    """Return the free spot that fits all wishes and is nearest to where they point."""
    thing, under, (x0, x1, y0, y1) = world.things[mover], world.below[mover], world.bounds
    xs = [wish.x for wish in wishes if wish.x is not None] or [thing.x]
    ys = [wish.y for wish in wishes if wish.y is not None] or [thing.y]
    nx, ny = sum(xs) / len(xs), sum(ys) / len(ys)
    gx, gy = grid(world.bounds, world.cells)
    if not world.cells:  # the very place
        gx, gy = np.append(gx, min(max(nx, x0), x1)), np.append(gy, min(max(ny, y0), y1))
    fits = np.ones(len(gx), bool)
    for wish in wishes:
        fits &= wish.fits(gx, gy)
    what = next((wish.what for wish in wishes if wish.what), "there")
    if not fits.any():
        why = next((wish.why_not for wish in wishes if wish.why_not), f"my arm does not reach {what}")
        return Spot(nx, ny, world.ground, None, cost, why)
    others = [i for each in world._standing.values() for i in each if i != mover]
    taken = [i for i in others if world.is_loose(i) or world.covers(*world.things[i][2:4])]
    boxes = tuple((*world.things[i][2:4], max(thing.width, world.things[i].width)) for i in taken)
    masks = free_grid(world.bounds, world.cells, boxes)
    if not world.cells:
        masks = tuple(np.append(a, b) for a, b in zip(masks, clear_of(gx[-1:], gy[-1:], False, boxes), strict=True))
    for share, mask in zip(SHARES[world.cells], masks, strict=True):
        free = fits & mask
        if free.any():
            away = np.where(free, np.hypot(gx - nx, gy - ny), np.inf)
            at = int(away.argmin())
            near = min(taken, key=lambda i: math.dist((nx, ny), world.things[i][2:4]), default=None)
            blocked = near not in (None, under) and math.dist((nx, ny), world.things[near][2:4]) < share * thing.width
            x, y, said = float(gx[at]), float(gy[at]), max((wish.length for wish in wishes), default=0.0)
            moved = math.dist((x, y), (thing.x, thing.y)) if said and not world.cells else said
            note = elsewhere(world, near if blocked else None, moved, said) if away[at] > GRID else ""
            return Spot(x, y, world.ground, None, cost, "", note)
    near = min(taken, key=lambda i: math.dist((nx, ny), world.things[i][2:4]))
    why = f"{a_name(world, near)} stands there: there is no free spot near enough"
    return Spot(nx, ny, world.ground, None, cost, why)


def anywhere(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.bool_]:
    return np.ones(len(x), bool)


def _shifts(
    world: WorldModel, mover: int, directions: tuple[RelationPhrase, ...], further: bool, aloft: bool = False
) -> list[SpotWish]:
    """Return where a thing goes that moves in some directions. further: whether other relations say where, too.

    aloft: whether it is not on the table, so that "down" is straight down.
    """
    thing = world.things[mover]
    dx = dy = 0.0
    bit, vectors = False, []
    for each in directions:
        value = each.value or "left"
        if value in ("up", "top"):
            value = "far"
        if value == "down":
            if aloft or further:
                x, y = (None, None) if further else (thing.x, thing.y)
                return [SpotWish(x, y, anywhere, what="the table")]
            value = "near"
        bit = bit or (each.measure is not None and each.measure.unit == "bit")
        vectors.append((world.toward(value), each.measure))
    last = next((measure for _, measure in reversed(vectors) if measure is not None), None)
    for (ux, uy), measure in vectors:  # a length serves for directions without one
        length = length_of(world, measure or last, world.pitch)
        dx, dy = dx + ux * length, dy + uy * length
    if further:  # "on the left, near the front"
        return [_side_wish(world, [each.value or "left" for each in directions], False)]
    if (dx, dy) == (0.0, 0.0):
        return []
    said = any(each.measure is not None and each.measure.unit != "bit" for each in directions)
    wide, deep = abs(dx), abs(dy)

    def fits(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.bool_]:
        along_x, along_y = (x - thing.x) * np.sign(dx), (y - thing.y) * np.sign(dy)
        ok = np.hypot(x - thing.x, y - thing.y) <= (1.4 * max(wide, deep) if said else 0.12 if bit else 1.0)
        ok &= along_x >= (0.5 * wide if said else 0.008 * bool(dx))
        ok &= along_y >= (0.5 * deep if said else 0.008 * bool(dy))
        aside = np.abs(y - thing.y) if not dy else np.abs(x - thing.x) if not dx else 0.0 * x
        return ok & (aside <= np.maximum(0.03, 0.8 * (along_x + along_y)))

    length, why = math.hypot(dx, dy) * said, end_of_reach(world, thing, dx, dy) if said else ""
    return [SpotWish(thing.x + dx, thing.y + dy, fits, what="that place", length=length, why_not=why)]


def _wishes(resolver: Resolver, mover: int, relation: RelationPhrase, typed: bool, alone: bool) -> list[SpotWish]:
    """Return where one relation says that a thing goes, for each referent of its anchor."""
    world = resolver.world
    if relation.name == "home":
        x, y, under = resolver.rest or (world.things[mover].x, world.things[mover].y, None)
        if under is not None and under in (*world.containers, world.hand):
            return [SpotWish(None, None, anywhere, spot=enclosed(world, under, 0.0))]
        if under is not None:
            x, y = world.things[under].x, world.things[under].y
        if world.column(x, y, mover):  # it stood on something
            return [SpotWish(None, None, anywhere, spot=settle(world, mover, Point(x, y, 0.0)))]
        return [_near_point(x, y, 0.05, "its old place")]
    if relation.name == "elsewhere":
        return [_aside(world, mover)]
    if relation.name == "into":
        return [SpotWish(None, None, anywhere, spot=enclosed(world, box, 0.0)) for box in resolver.boxes()]
    if relation.name == "between":
        return _between(resolver, mover, relation)
    if not relation.anchors:
        return []
    found: list[SpotWish] = []
    region = relation.anchors[0]
    if relation.name == "in" and region.kind == "it" and not resolver.it:  # what stands open is meant
        return [SpotWish(None, None, anywhere, spot=enclosed(world, box, 0.0)) for box in resolver.boxes()]
    if relation.measure is not None and is_one_side(region):
        return _shifts(world, mover, (replace(relation, name="direction", value=region.sides[0]),), False)
    if relation.name in ("toward", "away", "farthest") and region.kind == "person" and world.hand is not None:
        return [_along(world, mover, world.hand, relation, "the place near your hand")]
    if relation.name in ("away", "farthest") and region.kind == "robot":
        return [_side_wish(world, ["far"], False, absolute=True)]
    if relation.name in ("away", "farthest") and (region.plural or region.every or region.other):
        others = {i for ref in resolver.anchors(region).refs for i in ref.things if world.is_loose(i)} - {mover}
        if len(others) > 1:  # "away from the others"
            return [_apart_from(world, mover, others)]
    for ref in anchors_of(resolver, relation, mover if typed or world.containers or world.devices else None):
        if ref.kind == "person" and world.hand is not None:
            ref = thing_ref(world, world.hand)
        if mover not in ref.things:
            anchor = ref.things[-1] if ref.things else None
            asked = relation.name == "spot_of" and ref.things
            left = left_place(resolver.first, world, ref.things[-1]) if asked else None
            if left is not None and left[2] is None:  # that a step before has moved
                made = [_near_point(*left[:2], 0.03, f"the place of {a_name(world, ref.things[-1])}")]
            else:
                made = _by_anchor(world, mover, relation, ref, alone)
            found += [wish._replace(cost=wish.cost + ref.cost, anchor=anchor) for wish in made]
    return found


def _by_anchor(world: WorldModel, mover: int, relation: RelationPhrase, ref: Ref, alone: bool = True) -> list[SpotWish]:
    name = relation.name
    if not ref.things:
        return _in_area(world, mover, relation, ref)
    anchor = ref.things[-1]
    other = world.things[anchor]
    what = f"the place {_WORDS.get(name, name)} {a_name(world, anchor)}"
    if name in SIDEWAYS:
        return [_at_side(world, mover, anchor, relation, what, alone)]
    if name in ("near", "nearest") or (name == "from" and relation.measure is not None):
        return [_ring(world, mover, anchor, what, relation)]
    if name in ("toward", "away", "farthest"):
        return [_along(world, mover, anchor, relation, what)]
    if anchor in (*world.containers, world.hand):
        if name in ("on", "over") and anchor != world.hand:
            at = Spot(other.x, other.y, other.top, anchor, 0.0, f"nothing can stand on {a_name(world, anchor)}")
            return [SpotWish(None, None, anywhere, spot=at)]
        return [SpotWish(None, None, anywhere, spot=enclosed(world, anchor, 0.0))] if name in (*ONTO, "near") else []
    if other.target:
        return [_near_point(other.x, other.y, 0.16, "the marked place")] if name in (*ONTO, "spot_of") else []
    if name == "spot_of":
        return [_near_point(other.x, other.y, 0.03, f"the place of {a_name(world, anchor)}")]
    if name in ("to", "at") and not (name == "at" and relation.value):
        return [_ring(world, mover, anchor, what, relation)]
    if name in ONTO:
        found = settle(world, mover, Point(other.x, other.y, 0.0, anchor))
        if anchor in world.inside:
            found = found._replace(why_not=f"{a_name(world, anchor)} is in {a_name(world, world.inside[anchor])}")
        if other.kind in FIXED:
            found = found._replace(why_not=f"nothing can stand on {a_name(world, anchor)}")
        return [SpotWish(None, None, anywhere, spot=found._replace(on=anchor))]
    return []


_WORDS = {"left": "left of", "right": "right of", "front": "in front of", "near": "next to", "away": "away from"}


def _at_side(
    world: WorldModel, mover: int, anchor: int, relation: RelationPhrase, what: str, alone: bool = True
) -> SpotWish:
    """Return the place left of a thing, or the like. A length is the gap between the two.

    alone: straight on that side; otherwise a further relation says where along it.
    """
    thing, other = world.things[mover], world.things[anchor]
    dx, dy = world.toward(SIDEWAYS[relation.name])
    width = (thing.width + other.width) / 2
    gap = _apart(world, width, relation.measure) if _is_gap(relation) else 1.3 * width + 0.01

    def fits(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.bool_]:
        along = (x - other.x) * dx + (y - other.y) * dy
        aside = np.abs((x - other.x) * dy + (y - other.y) * dx)
        close = np.hypot(x - other.x, y - other.y) <= max(NEAR + 0.01, gap + 0.05)
        return (along >= 0.025) & ((aside <= np.maximum(along, 0.02)) if alone else True) & close

    def relaxed(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.bool_]:
        along = (x - other.x) * dx + (y - other.y) * dy
        near = np.hypot(x - other.x, y - other.y) <= 0.165
        return fits(x, y) if fits(x, y).any() else (along >= 0.013 + 0.012 * bool(dy)) & near

    x, y = other.x + dx * gap, other.y + dy * gap
    return SpotWish(x if dx or alone else None, y if dy or alone else None, relaxed, what=what)


def _is_gap(relation: RelationPhrase) -> bool:
    """Whether a length is said that is the gap between two things."""
    return relation.measure is not None and relation.measure.unit not in ("bit", "cell")


def _ring(world: WorldModel, mover: int, anchor: int, what: str, relation: RelationPhrase) -> SpotWish:
    """Return the places next to a thing, or that far from it: the one nearest to where the moved thing is."""
    thing, other = world.things[mover], world.things[anchor]
    width, said = (thing.width + other.width) / 2, _is_gap(relation)
    gap = _apart(world, width, relation.measure) if said else 1.3 * width + 0.005
    x, y = min(max(thing.x, world.bounds[0]), world.bounds[1]), min(max(thing.y, world.bounds[2]), world.bounds[3])
    now = max(math.dist((x, y), (other.x, other.y)), 1e-6)
    nx, ny = other.x + (x - other.x) * gap / now, other.y + (y - other.y) * gap / now

    def fits(gx: NDArray[np.float64], gy: NDArray[np.float64]) -> NDArray[np.bool_]:
        away = np.hypot(gx - other.x, gy - other.y)
        if said:
            return np.abs(away - gap) <= GRID
        return away <= (NEAR if (away <= NEAR).any() else 0.166)

    return SpotWish(nx, ny, fits, what=what)


def _along(world: WorldModel, mover: int, anchor: int, relation: RelationPhrase, what: str) -> SpotWish:
    """Return the places nearer to a thing, or farther from it."""
    thing, other = world.things[mover], world.things[anchor]
    before = max(math.dist((thing.x, thing.y), (other.x, other.y)), 1e-6)
    ux, uy = (other.x - thing.x) / before, (other.y - thing.y) / before
    bit = relation.measure is not None
    step = length_of(world, relation.measure, world.pitch + 0.02)
    if relation.name == "toward":
        step = min(step, before) if bit else max(before - 0.65 * (thing.width + other.width) - 0.005, 0.0)
    else:
        step = -step

    def fits(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.bool_]:
        now = np.hypot(x - other.x, y - other.y)
        moved = np.hypot(x - thing.x, y - thing.y) > 0.004
        return moved & ((now < before - 0.022) if relation.name == "toward" else (now > before + 0.012))

    if relation.name == "farthest" and not bit:
        corners = [(x, y) for x in world.bounds[:2] for y in world.bounds[2:]]
        return SpotWish(*max(corners, key=lambda corner: math.dist(corner, (other.x, other.y))), fits, what=what)
    said = abs(step) * (relation.measure is not None and relation.measure.unit != "bit")
    return SpotWish(thing.x + ux * step, thing.y + uy * step, fits, what=what, length=said)


def _apart_from(world: WorldModel, mover: int, things: Collection[int]) -> SpotWish:
    """Return where a thing is farther from the nearest of some things, as far as it can be."""
    at = np.array([world.things[i][2:4] for i in things])

    def nearest(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.hypot(x[:, None] - at[:, 0], y[:, None] - at[:, 1]).min(axis=1)

    gx, gy = grid(world.bounds, world.cells)
    best = int(nearest(gx, gy).argmax())
    here = nearest(*np.array([[world.things[mover].x], [world.things[mover].y]]))[0]
    return SpotWish(gx[best], gy[best], lambda x, y: nearest(x, y) > here, what="a place farther from them")


def _near_point(x: float, y: float, most: float, what: str) -> SpotWish:
    return SpotWish(x, y, lambda gx, gy: np.hypot(gx - x, gy - y) <= most, what=what)


def _aside(world: WorldModel, mover: int) -> SpotWish:
    """Return where a thing is out of the way: not where it stands."""
    x, y = world.things[mover].x, world.things[mover].y
    return SpotWish(x, y, lambda gx, gy: np.hypot(gx - x, gy - y) >= 0.1, what="another place")


def _between(resolver: Resolver, mover: int, relation: RelationPhrase) -> list[SpotWish]:
    refs = [sorted(_of_kind(resolver, anchor, mover), key=lambda ref: ref.cost)[:4] for anchor in relation.anchors]
    found = []
    for one, other in pairs_of(refs, mover):
        wish = _near_point((one.x + other.x) / 2, (one.y + other.y) / 2, 0.06, "the place between the two")
        found.append(wish._replace(cost=one.cost + other.cost))
    return found


def _in_area(world: WorldModel, mover: int, relation: RelationPhrase, area: Ref) -> list[SpotWish]:
    """Return the places in a region of the table."""
    name, thing = relation.name, world.things[mover]
    if area.kind == "robot" and name == "in":
        return []  # "in the gripper" is no place on the table
    if area.kind in ("robot", "person"):
        return [_side_wish(world, ["near" if area.kind == "robot" else "far"], area.kind == "person", absolute=True)]
    if area.kind == "cell":  # what a gesture shows
        return [_near_point(area.x, area.y, 0.12, "that place")]
    if name in SIDEWAYS and area.kind == "board":
        return [_side_wish(world, [SIDEWAYS[name]], False)]
    if area.kind == "center" and relation.measure is not None:  # "a bit towards the middle"
        dx, dy = world.center[0] - thing.x, world.center[1] - thing.y
        share = min(length_of(world, relation.measure, world.pitch) / max(math.hypot(dx, dy), 1e-6), 1.0)
        return [_near_point(thing.x + share * dx, thing.y + share * dy, 0.05, "the way to the middle")]
    if area.kind == "center":
        inner, outer = (_near_point(*world.center, most, "the middle of the table") for most in (0.06, 0.12))
        return [inner, outer._replace(cost=1.0)]  # the outer one is for several things
    if area.kind == "board" and name != "under":
        return [SpotWish(thing.x, thing.y, anywhere, what="the table")]
    if area.kind in ("corner", "edge", "side") and name in (*ONTO, "near", "under", "from", "toward", *SIDEWAYS):
        x0, x1, y0, y1 = world.bounds
        sides = ["far"] * (area.box[0] >= x1 - 1e-6) + ["near"] * (area.box[1] <= x0 + 1e-6)
        sides += ["left"] * (area.box[2] >= y1 - 1e-6) + ["right"] * (area.box[3] <= y0 + 1e-6)
        return [_side_wish(world, sides, area.kind != "side", absolute=True)]
    return []


def _side_wish(world: WorldModel, sides: list[str], edge: bool, absolute: bool = False) -> SpotWish:
    """Return the places at one or two sides of the table. edge: close to it. absolute: in the robot's frame."""
    x0, x1, y0, y1 = world.bounds
    vectors = {"far": (1, 0), "near": (-1, 0), "left": (0, 1), "right": (0, -1)}
    x = y = None
    tests: list[Mask] = [anywhere]
    for side in sides:
        if side in ("center", "up", "top", "down"):
            continue
        dx, dy = vectors[side] if absolute else world.toward(side)
        low, high, middle = (x0, x1, (x0 + x1) / 2) if dx else (y0, y1, (y0 + y1) / 2)
        sign = dx + dy
        end = high if sign > 0 else low
        nominal, limit = (middle + share * (end - middle) for share in ((1.0, 0.6) if edge else (0.75, 0.33)))
        x, y = (nominal, y) if dx else (x, nominal)
        tests.append(_beyond(limit, sign, bool(dx)))
    name = f"the {' '.join(sides)} {'edge' if edge and len(sides) < 2 else 'corner' if len(sides) > 1 else 'side'}"
    return SpotWish(x, y, lambda gx, gy: np.all([test(gx, gy) for test in tests], axis=0), what=name)


def _beyond(limit: float, sign: float, on_x: bool) -> Mask:
    return lambda gx, gy: sign * ((gx if on_x else gy) - limit) >= 0


def anchors_of(resolver: Resolver, relation: RelationPhrase, mover: int | None) -> list[Ref]:
    """Return the referents of the anchor and, at a cost, its referents among the things that can bear another one."""
    entity = relation.anchors[0]
    refs = _of_kind(resolver, entity, mover)
    if relation.name == "in" and entity.noun is None:  # "into the other one", "in the blue one"
        boxes = [ref for ref in refs if ref.things[-1:] and ref.things[-1] in resolver.world.containers]
        if boxes:
            return boxes
    if relation.name not in ONTO or entity.kind not in ("thing", "stack"):
        return refs
    known = {ref.things for ref in refs}
    free = [ref for ref in resolver.resolve(entity, resolver.bears) if ref.things not in known]
    return refs + [ref._replace(cost=ref.cost + costs.ONLY_USABLE) for ref in free]


def _of_kind(resolver: Resolver, entity: Entity, mover: int | None) -> list[Ref]:
    """Return the referents of a phrase; "the blue one" is rather of the moved thing's kind."""
    things, refs = resolver.world.things, resolver.resolve(entity)
    if entity.kind == "thing" and entity.noun is None and mover is not None:
        kind = things[mover].kind
        return [r._replace(cost=r.cost + costs.ANOTHER_KIND * (things[r.things[-1]].kind != kind)) for r in refs]
    return refs


def _apart(world: WorldModel, width: float, measure: Measure | None) -> float:
    """Return how far apart the middles of two things are, whose mean width is known, for a length that is said."""
    return length_of(world, measure, 0.0) + width * (measure is not None and not isinstance(measure, MiddleDistance))


def pairs_of(refs: list[list[Ref]], mover: int) -> list[tuple[Ref, Ref]]:
    """Return the pairs of the referents of two anchors, or of one, that are others than the moved thing."""
    pairs = [(a, b) for i, a in enumerate(refs[0]) for j, b in enumerate(refs[-1]) if len(refs) > 1 or i < j]
    return [(a, b) for a, b in pairs if a.things != b.things and mover not in a.things + b.things]
