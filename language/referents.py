"""Phrases in a world: the things, stacks and regions that they refer to, each with a cost for an imperfect fit.

Heads are resolved first, then relations, then the words that select among the rest (superlatives, ranks, nearest).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from operator import attrgetter
from typing import NamedTuple

from language import costs
from language.meanings import Entity, Gesture, RelationPhrase
from language.objects import HAND
from language.spots import NEAR, Rest, along, extent, half_of, middle_of, pair_of
from language.words import GROUPS
from language.world import FIXED, FLAT, SIDES, WorldModel

_fields = attrgetter(*(name for name in Entity.__slots__ if name != "span"))  # phrases that share these mean the same
TIE = 0.1  # pitches: distances and coordinates this close are equal
SIDEWAYS = {"left": "left", "right": "right", "front": "front", "behind": "back"}  # relations with their directions
_ANYWHERE = (*SIDEWAYS, "beside", "opposite", "with", "matching")  # relations to things that stand anywhere
_SELECTING = ("nearest", "farthest", "near")
_LOCATING = ("on", "over", "in", "at", "to", "of", "from")


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
    """Return the distance of a point to a referent's box."""
    x0, x1, y0, y1 = ref.box
    dx = x0 - x if x < x0 else x - x1 if x > x1 else 0.0
    dy = y0 - y if y < y0 else y - y1 if y > y1 else 0.0
    return math.hypot(dx, dy)


def spot(
    x: float, y: float, top: float = 0.0, kind: str = "cell", things: tuple[int, ...] = (), cost: float = 0.0
) -> Ref:
    """Return the referent of a point."""
    return Ref(kind, (x, x, y, y), top, things, cost)


def thing_ref(world: WorldModel, index: int, cost: float = 0.0) -> Ref:
    """Return the referent of a thing."""
    thing = world.things[index]
    return spot(thing.x, thing.y, thing.top, "thing", (index,), cost)


def color_fits(world: WorldModel, index: int, meant: tuple[str, ...]) -> bool:
    """Return whether a thing has the colour: the likeliest meaning of the word that the world holds."""
    return world.things[index].color == next((color for color in meant if color in world.colors), None)


def heads(world: WorldModel, entity: Entity) -> list[Ref]:
    """Return the referents of a phrase without its relations, superlatives and ranks."""
    found = _unshown(world, entity)
    if isinstance(entity.pointed, Gesture) and entity.kind in ("thing", "stack"):
        shown = set(entity.pointed.things)
        return [ref for ref in found if shown & set(ref.things)]
    return found


def _unshown(world: WorldModel, entity: Entity) -> list[Ref]:
    """Return the referents of a phrase, whatever a gesture shows."""
    if entity.kind == "spot":
        return _shown(world, entity)
    if entity.kind == "thing" and entity.plural and not entity.every and not entity.number and entity.colors:
        return [*stacks(world, entity), *(ref._replace(cost=1.0) for ref in _things(world, entity))]
    if entity.kind == "thing":
        return _things(world, entity)
    if entity.kind == "stack":
        return stacks(world, entity)
    return regions(world, entity)


def _shown(world: WorldModel, entity: Entity) -> list[Ref]:
    """Return the referents of a gesture: things or a place; before the gesture is known, all things."""
    if not isinstance(entity.pointed, Gesture):
        return [thing_ref(world, index) for index in range(len(world.things))]
    things = [thing_ref(world, index) for index in entity.pointed.things]
    return things if entity.pointed.place is None else [*things, spot(*entity.pointed.place)]


def _things(world: WorldModel, entity: Entity) -> list[Ref]:
    found = []
    for index, thing in enumerate(world.things):
        named = entity.noun == HAND or (entity.noun is None and any(thing.color == each[0] for each in entity.colors))
        if thing.kind == HAND and not named:  # it is no thing that could be taken
            continue
        if entity.noun is not None and thing.kind not in GROUPS.get(entity.noun, (entity.noun,)):
            continue
        if not all(color_fits(world, index, color) for color in entity.colors):
            continue
        if entity.role is not None and thing.target != (entity.role == "target"):
            continue
        unsaid = costs.SEE_THROUGH * (thing.target and entity.role is None)
        bare = bool(entity.colors) and entity.noun is None and not world.cells
        cost = costs.FIXED_UNNAMED * (bare and thing.kind in FIXED)
        if entity.single:
            alone = (world.below[index] is None) + (world.above[index] is None)
            cost += (3.0, 1.5, 0.0)[alone]
        sized = entity.size is None or _sized(world, thing.width, entity.size)
        if not sized or (entity.exposed and world.above[index] is not None):
            continue
        found.append(thing_ref(world, index, cost + unsaid))
    return found


def _sized(world: WorldModel, width: float, size: str) -> bool:
    widths = [thing.width for thing in world.things]
    middle = (min(widths) + max(widths)) / 2
    return width > middle if size == "large" else width < middle


def stacks(world: WorldModel, entity: Entity) -> list[Ref]:
    """Return the runs of blocks, one upon the other, that have the phrase's colours."""
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
    tall = [ref for ref in found if len(ref.things) > 1]
    return tall if tall and not world.cells else found


def _stack_cost(world: WorldModel, entity: Entity, run: list[int]) -> float | None:
    """Return how badly a run's colours fit, or None."""
    if not entity.colors:
        return 0.0
    for meant in entity.colors:
        if not any(color_fits(world, i, meant) for i in run):
            return None
    strange = sum(not any(color_fits(world, i, meant) for meant in entity.colors) for i in run)
    return 1.5 * min(strange, 2) if strange else 0.0


def regions(world: WorldModel, entity: Entity) -> list[Ref]:
    """Return the parts of the board that a phrase may mean."""
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
    if entity.kind == "person" and world.hand is not None:
        return [spot(world.things[world.hand].x, world.things[world.hand].y, world.ground, "person")]
    if entity.kind in ("robot", "person"):
        x = x0 - world.pitch if entity.kind == "robot" else x1 + world.pitch
        return [Ref(entity.kind, (x, x, y0, y1), world.ground)]
    if entity.kind == "board" or (entity.kind in ("cell", "gap") and not world.cells):
        return [Ref("board", world.bounds, world.ground)]
    return []


def _corner(world: WorldModel, sides: Iterable[str]) -> tuple[float, float]:
    """Return the point of a corner, of which one or two sides are named."""
    x, y = world.center
    x0, x1, y0, y1 = world.bounds
    for side in sides:
        dx, dy = world.toward(side)
        x = x if not dx else x1 if dx > 0 else x0
        y = y if not dy else y1 if dy > 0 else y0
    return x, y


def edge_box(world: WorldModel, side: str) -> tuple[float, float, float, float]:
    """Return the box of an edge: the outermost row or column."""
    x0, x1, y0, y1 = world.bounds
    dx, dy = world.toward(side)
    if dx:
        return (x1, x1, y0, y1) if dx > 0 else (x0, x0, y0, y1)
    return (x0, x1, y1, y1) if dy > 0 else (x0, x1, y0, y0)


def best(refs: list[Ref], score: Callable[[Ref], float], tie: float, number: int = 1) -> list[Ref]:
    """Return the referents of the least score, and those within `tie` of it; or this number of them."""
    if not refs:
        return []
    if number > 1:
        return sorted(refs, key=score)[:number]
    scores = [score(ref) for ref in refs]
    least = min(scores)
    return [ref for ref, value in zip(refs, scores, strict=True) if value <= least + tie]


def relation_cost(world: WorldModel, ref: Ref, relation: RelationPhrase, anchors: Sequence[Anchors]) -> float | None:
    """Return the cost of a relation of a referent to the cheapest of its anchors' referents, or None if none holds."""
    if relation.name == "into":
        return 0.0 if any(index in world.inside for index in ref.things) else None
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
    least = math.inf
    for anchor in anchors[0].candidates(world, ref, relation.name):
        if anchor.cost < least:  # no relation costs less than nothing
            cost = _cost(world, ref, relation, anchor)
            least = least if cost is None else min(least, cost + anchor.cost)
    return None if least == math.inf else least


class Anchors:
    """The referents of an anchor, found by the things that they consist of."""

    def __init__(self, refs: list[Ref]) -> None:
        self.refs = refs
        self._areas = [ref for ref in refs if not ref.things]
        self._by_thing: dict[int, list[Ref]] = {}
        for ref in refs:
            for index in ref.things:
                self._by_thing.setdefault(index, []).append(ref)

    def candidates(self, world: WorldModel, ref: Ref, name: str) -> list[Ref]:
        """Return the referents to which the relation may hold: for "on" and the like, those of the same column."""
        if not ref.things or name in _ANYWHERE or ref.things[-1] in world.inside:
            return self.refs
        chain, at = [], ref.things[0]
        neighbours = world.above if name == "under" else world.below
        while at is not None:
            chain.append(at)
            at = neighbours[at]  # type: ignore[assignment]
        found = {id(anchor): anchor for index in chain for anchor in self._by_thing.get(index, ())}
        return [*self._areas, *found.values()]


def _cost(world: WorldModel, ref: Ref, relation: RelationPhrase, anchor: Ref) -> float | None:
    if anchor is ref or (anchor.things and anchor.things == ref.things):
        return None
    name = relation.name
    if name in SIDEWAYS:
        return _beside(world, ref, anchor, SIDEWAYS[name], relation)
    if name == "beside":
        return 0.0 if 0.5 * world.pitch < distance(ref.x, ref.y, anchor) <= 1.3 * world.pitch else None
    if name == "under":
        return _on(world, anchor, ref)
    if name == "matching":
        things = (*ref.things, *anchor.things)
        return 0.0 if len(things) > 1 and len({world.things[i].color for i in things}) == 1 else None
    if name == "with":
        return 0.0 if _in_box(world, anchor, ref) else _on(world, anchor, ref)
    if name == "opposite":
        return _opposite(world, ref, anchor)
    if _in_box(world, ref, anchor):
        return 0.0 if name in ("in", "from", "of", "at", "on", "to") else None
    if anchor.things and anchor.things[0] in world.containers and name in ("in", "from", "of", "on", "over"):
        return None
    if anchor.kind in ("thing", "stack"):
        cost = _on(world, ref, anchor, inside=name in ("from", "of", "in", "at"))
        raised = anchor.kind == "thing" and world.below[anchor.things[0]] is not None
        return cost if cost is None else cost + costs.ELEVATED * raised
    return _within(world, ref, anchor)


def _in_box(world: WorldModel, ref: Ref, anchor: Ref) -> bool:
    """Whether the referent is in the anchor, a container or the open hand."""
    if not ref.things or ref.things[-1] not in world.inside:
        return False
    box = world.inside[ref.things[-1]]
    return box in anchor.things or (anchor.kind == "person" and box == world.hand)


def _on(world: WorldModel, ref: Ref, anchor: Ref, inside: bool = False) -> float | None:
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


def _within(world: WorldModel, ref: Ref, area: Ref) -> float | None:
    """The cost of being in a region."""
    if area.kind == "board":
        if ref.things and (ref.things[0] in world.inside or world.things[ref.things[0]].kind in FIXED):
            return None
        standing = not ref.things or world.below[ref.things[0]] is None
        return 0.0 if standing else 0.5
    if area.kind == "robot" and ref.things and ref.things[-1] == world.held:
        return 0.0
    return 0.0 if distance(ref.x, ref.y, area) < 0.6 * world.pitch else None


def _beside(world: WorldModel, ref: Ref, anchor: Ref, side: str, relation: RelationPhrase) -> float | None:
    """The cost of being left of the anchor or the like: none for the neighbour in the same row."""
    dx, dy = world.toward(side)
    along = (dx * (ref.x - anchor.x) + dy * (ref.y - anchor.y)) / world.pitch
    aside = abs(dy * (ref.x - anchor.x) + dx * (ref.y - anchor.y)) / world.pitch
    if along < 0.5:
        return None
    if relation.measure is not None and relation.measure.unit == "cell":
        return 0.0 if abs(along - relation.measure.number) < 0.5 and aside < 0.5 else None
    return min(0.3 * max(aside - 0.5, 0.0) + 0.15 * (along - 1.0), 1.5) if along > 1 else 0.3 * max(aside - 0.5, 0.0)


def _opposite(world: WorldModel, ref: Ref, anchor: Ref) -> float | None:
    x, y = world.center
    mirrored = abs(ref.x + anchor.x - 2 * x) + abs(ref.y + anchor.y - 2 * y)
    return 0.0 if mirrored < 0.6 * world.pitch else None


def _between(world: WorldModel, ref: Ref, anchors: Sequence[Anchors]) -> float | None:
    pairs = [(a, b) for a in anchors[0].refs for b in anchors[-1].refs if a.things != b.things]
    costs_found = []
    for one, other in pairs:
        away = abs(ref.x - (one.x + other.x) / 2) + abs(ref.y - (one.y + other.y) / 2)
        span = abs(one.x - other.x) + abs(one.y - other.y)
        if set(ref.things).isdisjoint(one.things + other.things) and away < 0.5 * span:
            costs_found.append(one.cost + other.cost + away / max(span, 1e-9) + 0.1 * span / world.pitch)
    return min(costs_found, default=None)


class Resolver:
    """Resolves the phrases of a sentence in one world, each once.

    it: the things that "it" and "them" mean. mentioned: the things that "other" excludes.
    origin: the thing whose neighbour "the nearest" is; None: the robot's. first: the world before the sentence.
    """

    def __init__(
        self,
        world: WorldModel,
        it: tuple[int, ...] = (),
        mentioned: tuple[int, ...] = (),
        origin: int | None = None,
        first: WorldModel | None = None,
    ) -> None:
        self.first = first or world
        self.world, self.it, self.mentioned, self.origin = world, it, mentioned, origin
        self.box: int | None = None  # the container that was spoken of
        self.others: tuple[int, ...] = ()  # what "the other one" means
        self.rest: Rest | None = None  # where the thing that moves was before
        self.aloft = False  # whether the thing that moves was not on the table
        self._known: dict[tuple, list[Ref]] = {}
        self._heads: dict[tuple, list[Ref]] = {}
        self._anchors: dict[tuple, Anchors] = {}
        self.spots: dict[tuple, list] = {}  # of `places.spots`
        self.points: dict[tuple, list] = {}  # of one anchor
        self.weighed = 0  # points that were compared with a further relation

    def boxes(self) -> list[int]:
        """Return the containers that "in there" may mean: the one that was spoken of, else those that are open."""
        if self.box is not None:
            return [self.box]
        return [box for box in self.world.containers if box in self.world.open] or list(self.world.containers)

    def bears(self, ref: Ref) -> bool:
        """Return whether something can be put on a referent."""
        top = ref.things[-1] if ref.things else None
        return top is None or (self.world.above[top] is None and self.world.things[top].kind in FLAT)

    def resolve(self, entity: Entity, usable: Callable[[Ref], bool] | None = None) -> list[Ref]:
        """Return the referents of a phrase, the best first. usable: among which superlatives select, where one is."""
        key = (_fields(entity), usable is not None)
        if key not in self._known:
            self._known[key] = sorted(self._resolve(entity, usable), key=lambda ref: ref.cost)
        return self._known[key]

    def _resolve(self, entity: Entity, usable: Callable[[Ref], bool] | None) -> list[Ref]:
        if entity.kind == "it":
            return [thing_ref(self.world, i) for i in (self.it != (self.origin,) and self.it) or self.others or self.it]
        if entity.kind == "list":
            return [ref for part in entity.parts for ref in self.resolve(part, usable)[:1]]
        selecting = tuple(relation for relation in entity.relations if self._selects(entity, relation))
        filtering = tuple(relation for relation in entity.relations if relation not in selecting)
        refs = self._filtered(entity, filtering)
        if usable is not None and (kept := [ref for ref in refs if usable(ref)]):
            refs = kept
        for relation in selecting:
            refs = self._select(entity, refs, relation)
        return self._ranked(entity, refs)

    def among(self, entity: Entity, things: Sequence[int]) -> list[int]:
        """Return which of some things a phrase means, the best first, where it selects among these alone."""
        refs = self._resolve(entity, lambda ref: bool(ref.things) and ref.things[-1] in things)
        found = (ref.things[-1] for ref in sorted(refs, key=lambda ref: ref.cost) if ref.things)
        return [index for index in found if index in things]

    def anchors(self, entity: Entity) -> Anchors:
        """Return the referents of a phrase as the anchors of a relation: marks only where there is nothing else."""
        key = _fields(entity)
        if key not in self._anchors:
            self._anchors[key] = Anchors(self._solid(self.resolve(entity)))
        return self._anchors[key]

    def _solid(self, refs: list[Ref]) -> list[Ref]:
        """Return referents without see-through ones if there are others."""
        return [ref for ref in refs if not any(self.world.things[i].target for i in ref.things)] or refs

    def _filtered(self, entity: Entity, relations: tuple[RelationPhrase, ...]) -> list[Ref]:
        """Return the referents of the phrase with the relations that do not select; phrases share their beginnings."""
        number = entity.every, entity.number, entity.single, entity.exposed, entity.plural, entity.other
        counted = entity.ordinal is not None
        what = entity.kind, entity.noun, entity.colors, entity.size, entity.sides, entity.pointed, entity.role
        key = (*what, number, counted, relations)
        if key not in self._heads:
            if relations:
                before = self._filtered(entity, relations[:-1])
                self._heads[key] = self._related(before, relations[-1], counted)
            else:
                refs = self._former_stacks(entity) or heads(self.world, entity)
                rest = set(self.mentioned) if entity.other else set()
                kept = [ref for ref in refs if not rest & set(ref.things)]
                meant = [r for r in kept if set(self.others) & set(r.things)] if entity.other and not entity.any else []
                self._heads[key] = meant if meant and not entity.number and not entity.plural else kept
        return self._heads[key]

    def _former_stacks(self, entity: Entity) -> list[Ref]:
        """Return what is left of the stacks that a sentence takes apart: "unstack it, and put it beside the stack"."""
        world, first = self.world, self.first
        if entity.kind != "stack" or world is first or world.cells:
            return []
        found = []
        for ref in heads(first, entity):
            rest = [i for i in ref.things if world.things[i] == first.things[i] and i != world.held]
            if len(ref.things) > 1 and 0 < len(rest) < len(ref.things):
                thing = world.things[rest[-1]]
                found.append(spot(thing.x, thing.y, thing.top, "stack", tuple(rest), ref.cost))
        return found

    def _selects(self, entity: Entity, relation: RelationPhrase) -> bool:
        """Return whether a relation selects the best of the referents that the others leave."""
        if relation.name in _SELECTING or (relation.name == "direction" and entity.kind in ("thing", "stack")):
            return True
        kinds = {anchor.kind for anchor in relation.anchors}
        return relation.name in _LOCATING and bool(kinds & {"side", "center"}) and entity.ordinal is None

    def _related(self, refs: list[Ref], relation: RelationPhrase, counted: bool = False) -> list[Ref]:
        if relation.name in ("not", "among"):
            parts = relation.anchors[0].parts or relation.anchors
            named = {i for part in parts for ref in self.resolve(part) for i in ref.things}
            excluded = relation.name == "not"
            return [ref for ref in refs if (not named & {*ref.things} if excluded else {*ref.things} <= named)]
        if counted and relation.name == "from" and relation.anchors[0].kind in ("side", "edge"):
            return refs  # "the second from the left" says how to count
        anchors = [self.anchors(anchor) for anchor in relation.anchors]
        found = []
        for ref in refs:
            cost = relation_cost(self.world, ref, relation, anchors)
            if cost is not None:
                found.append(ref._replace(cost=ref.cost + cost))
        return found or self._not_quite(refs, relation)

    def _not_quite(self, refs: list[Ref], relation: RelationPhrase) -> list[Ref]:
        """Return the referents nearest to a region that contains none."""
        kinds = {anchor.kind for anchor in relation.anchors}
        if relation.name in _LOCATING and kinds & {"corner", "edge"}:
            found = self._nearest(self._solid(refs), relation.anchors[0])
            return [ref._replace(cost=ref.cost + costs.NOT_QUITE_THERE) for ref in found]
        return []

    def _select(self, entity: Entity, refs: list[Ref], relation: RelationPhrase) -> list[Ref]:
        anchor, number = next(iter(relation.anchors), Entity()), entity.number or 1
        sides, sign = anchor.sides or (relation.value or "",), -1.0 if relation.name == "farthest" else 1.0
        locates = relation.name == "direction" or (relation.name != "farthest" and anchor.kind == "side" and sides[0])
        if locates and (entity.every or entity.plural) and number == 1 and (half := half_of(self.world, refs, sides)):
            return half  # "all cubes on the right"
        if relation.name == "direction" or (locates and number > 1 and not self.world.cells):
            return self._toward(refs, sides, number)
        if anchor.kind == "mutual":  # "the two cubes that are closest together"
            return pair_of(refs, sign) if number == 2 else []
        if relation.name == "near":
            return self._near(refs, relation, several=entity.plural or entity.every)
        return self._nearest(self._solid(refs), anchor, sign, number)

    def _near(self, refs: list[Ref], relation: RelationPhrase, several: bool) -> list[Ref]:
        """Return the referents beside the anchor, or the nearest one; several: all that are near, on a table."""
        anchors = self.anchors(relation.anchors[0]).refs if several and not self.world.cells else []
        near = [ref for ref in refs if any(0.0 < distance(ref.x, ref.y, anchor) < NEAR for anchor in anchors)]
        beside = near or self._related(refs, RelationPhrase("beside", relation.anchors))
        return beside or self._nearest(self._solid(refs), relation.anchors[0])

    def _nearest(self, refs: list[Ref], anchor: Entity, sign: float = 1.0, number: int = 1) -> list[Ref]:
        """Return the referents that are nearest to the anchor, or, with sign -1, farthest from it."""
        anchors = self.anchors(anchor).refs
        if not anchors:
            return []
        most = min(ref.cost for ref in anchors) + 1.0
        near = [(ref, frozenset(ref.things)) for ref in anchors if ref.cost <= most]

        def score(ref: Ref) -> float:
            x, y, things = ref.x, ref.y, ref.things
            others = [sign * distance(x, y, other) for other, its in near if its.isdisjoint(things)]
            return min(others, default=1e9)

        return best(refs, score, TIE * self.world.pitch, number)

    def _ranked(self, entity: Entity, refs: list[Ref]) -> list[Ref]:
        """Return the referents that the phrase's sides, superlative and rank select."""
        if entity.ordinal is not None:
            return self._counted(entity, refs)
        if entity.kind not in ("thing", "stack"):
            return refs
        if entity.superlative is not None:
            refs = self._superlative(entity.superlative, self._solid(refs), entity.number or 1)
        return self._toward(refs, entity.sides, entity.number or 1) if entity.sides else refs

    def _toward(self, refs: list[Ref], sides: tuple[str, ...], number: int = 1) -> list[Ref]:
        """Return the referents that are farthest toward the sides."""
        tie = TIE * self.world.pitch
        if "center" in sides and not self.world.cells and len(refs) % 2 and len(refs) > 2:  # "the middle one" of a row
            return [middle_of(self.world, refs)]
        if "center" in sides:
            middle = spot(*self.world.center)
            return best(refs, lambda ref: distance(ref.x, ref.y, middle), tie)
        if set(sides) & {"up", "top", "down"}:
            sign = 1.0 if sides[0] == "down" else -1.0
            bearing = [ref for ref in refs if ref.things and self.world.above[ref.things[-1]] is not None]
            refs = bearing if sides[0] == "down" and bearing and not self.world.cells else refs
            return best(refs, lambda ref: sign * ref.top, tie)
        ways = [along(self.world, side) for side in dict.fromkeys(map(self.world.side, sides))]
        return best(refs, lambda ref: -sum(way(ref) for way in ways), tie, number)

    def _superlative(self, name: str, refs: list[Ref], number: int) -> list[Ref]:
        tie = TIE * self.world.pitch
        if name in SIDEWAYS.values():
            return self._toward(refs, (name,), number)
        if name in ("high", "low"):
            return self._toward(refs, ("up" if name == "high" else "down",))
        if name in ("largest", "smallest"):
            sign, width = -1.0 if name == "largest" else 1.0, partial(extent, self.world)
            return best(refs, lambda ref: sign * max(map(width, ref.things), default=0.0), 0.003, number)
        sign = 1.0 if name == "nearest" else -1.0
        robot = heads(self.world, Entity("robot"))[0]
        return best(refs, lambda ref: sign * distance(ref.x, ref.y, robot), tie, number)

    def _counted(self, entity: Entity, refs: list[Ref]) -> list[Ref]:
        """Return the referent of a rank: from the left, unless the phrase says from where."""
        assert entity.ordinal is not None
        start = "left"
        for relation in entity.relations:
            if relation.name in ("from", "on", "at") and relation.anchors and relation.anchors[0].sides:
                start = relation.anchors[0].sides[0]
                if entity.ordinal == -1 and relation.name != "from":
                    return self._toward(refs, (start,))
            start = (relation.value or start) if relation.name == "direction" else start
        known = start in (*SIDES, "front", "back", "forward", "backward")
        way = along(self.world, start) if known else attrgetter("y")
        loose = [r for r in self._solid(refs) if entity.noun or (r.things and self.world.is_loose(r.things[-1]))]
        order = sorted(loose or refs, key=lambda ref: -way(ref))
        return order[entity.ordinal - 1 :][:1] if entity.ordinal > 0 else order[-1:]
