"""Resolves phrases in a world.

Heads are resolved first, then relations, then the words that select among the rest (superlatives, ranks, nearest).
"""

from __future__ import annotations

from collections.abc import Callable

from language.commands import costs
from language.commands.meanings import Entity, Relation
from language.commands.referents import TIE, Ref, best, distance, heads, spot, thing_ref
from language.commands.relating import Anchors, relation_cost
from language.commands.world import FLAT, SIDES, World

AREAS = ("corner", "edge", "side", "center", "board", "robot", "person")
_SELECTING = ("nearest", "farthest", "near")
_LOCATING = ("on", "over", "in", "at", "to", "of", "from")


class Resolver:
    """Resolves the phrases of a sentence in one world; every phrase once.

    it: the things that "it" and "them" mean. mentioned: the things that "other" excludes.
    origin: the thing whose neighbour "the nearest" is; None: the robot's.
    """

    def __init__(
        self, world: World, it: tuple[int, ...] = (), mentioned: tuple[int, ...] = (), origin: int | None = None
    ) -> None:
        self.world, self.it, self.mentioned, self.origin = world, it, mentioned, origin
        self._known: dict[tuple[Entity, int], list[Ref]] = {}
        self._heads: dict[tuple, list[Ref]] = {}
        self._anchors: dict[Entity, Anchors] = {}
        self.spots: dict[tuple, list] = {}  # of `places.spots`
        self.points: dict[tuple, list] = {}  # of one anchor
        self.weighed = 0  # points that were compared with a further relation

    def bears(self, ref: Ref) -> bool:
        """Returns whether something can be put on a referent."""
        top = ref.things[-1] if ref.things else None
        return top is None or (self.world.above[top] is None and self.world.things[top].kind in FLAT)

    def resolve(self, entity: Entity, usable: Callable[[Ref], bool] | None = None) -> list[Ref]:
        """Returns the referents of a phrase, the best first. usable: among which superlatives select, where one is."""
        key = (entity, usable is not None)
        if key not in self._known:
            self._known[key] = sorted(self._resolve(entity, usable), key=lambda ref: ref.cost)
        return self._known[key]

    def _resolve(self, entity: Entity, usable: Callable[[Ref], bool] | None) -> list[Ref]:
        if entity.kind == "it":
            return [thing_ref(self.world, index) for index in self.it]
        selecting = tuple(relation for relation in entity.relations if self._selects(entity, relation))
        filtering = tuple(relation for relation in entity.relations if relation not in selecting)
        refs = self._filtered(entity, filtering)
        if usable is not None and (kept := [ref for ref in refs if usable(ref)]):
            refs = kept
        for relation in selecting:
            refs = self._select(entity, refs, relation)
        return self._ranked(entity, refs)

    def anchors(self, entity: Entity) -> Anchors:
        """Returns the referents of a phrase as the anchors of a relation."""
        if entity not in self._anchors:
            self._anchors[entity] = Anchors(self.resolve(entity))
        return self._anchors[entity]

    def _filtered(self, entity: Entity, relations: tuple[Relation, ...]) -> list[Ref]:
        """Returns the referents of the phrase with the relations that do not select; phrases share their beginnings."""
        number = entity.every, entity.number, entity.single, entity.exposed, entity.plural, entity.other
        counted = entity.ordinal is not None
        what = entity.kind, entity.noun, entity.colors, entity.size, entity.sides, entity.pointed, entity.role
        key = (*what, number, counted, relations)
        if key not in self._heads:
            if relations:
                before = self._filtered(entity, relations[:-1])
                self._heads[key] = self._related(before, relations[-1], counted)
            else:
                refs = heads(self.world, entity)
                rest = set(self.mentioned) if entity.other else set()
                self._heads[key] = [ref for ref in refs if not rest & set(ref.things)]
        return self._heads[key]

    def _selects(self, entity: Entity, relation: Relation) -> bool:
        """Returns whether a relation selects the best of the referents that the others leave."""
        if relation.name in _SELECTING or (relation.name == "direction" and entity.kind in ("thing", "stack")):
            return True
        kinds = {anchor.kind for anchor in relation.anchors}
        return relation.name in _LOCATING and bool(kinds & {"side", "center"}) and entity.ordinal is None

    def _related(self, refs: list[Ref], relation: Relation, counted: bool = False) -> list[Ref]:
        if relation.name == "not":
            rejected = {i for ref in self.resolve(relation.anchors[0]) for i in ref.things}
            return [ref for ref in refs if not set(ref.things) & rejected]
        if counted and relation.name == "from" and relation.anchors[0].kind in ("side", "edge"):
            return refs  # "the second from the left" says how to count
        anchors = [self.anchors(anchor) for anchor in relation.anchors]
        found = []
        for ref in refs:
            cost = relation_cost(self.world, ref, relation, anchors)
            if cost is not None:
                found.append(ref._replace(cost=ref.cost + cost))
        return found or self._not_quite(refs, relation)

    def _not_quite(self, refs: list[Ref], relation: Relation) -> list[Ref]:
        """Returns the referents nearest to a region that contains none."""
        kinds = {anchor.kind for anchor in relation.anchors}
        if relation.name in _LOCATING and kinds & {"corner", "edge"}:
            found = self._nearest(refs, relation.anchors[0])
            return [ref._replace(cost=ref.cost + costs.NOT_QUITE_THERE) for ref in found]
        return []

    def _select(self, entity: Entity, refs: list[Ref], relation: Relation) -> list[Ref]:
        if relation.name == "direction":
            return self._toward(refs, (relation.value or "",))
        if relation.name == "farthest":
            return self._nearest(refs, relation.anchors[0], -1.0)
        if relation.name == "near":
            touching = self._related(refs, Relation("beside", relation.anchors))
            return touching or self._nearest(refs, relation.anchors[0])
        return self._nearest(refs, relation.anchors[0])

    def _nearest(self, refs: list[Ref], anchor: Entity, sign: float = 1.0) -> list[Ref]:
        """Returns the referents that are nearest to the anchor, or, with sign -1, farthest from it."""
        anchors = self.resolve(anchor)
        if not anchors:
            return []
        most = min(ref.cost for ref in anchors) + 1.0
        near = [(ref, frozenset(ref.things)) for ref in anchors if ref.cost <= most]

        def score(ref: Ref) -> float:
            x, y, things = ref.x, ref.y, ref.things
            others = [sign * distance(x, y, other) for other, its in near if its.isdisjoint(things)]
            return min(others, default=1e9)

        return best(refs, score, TIE * self.world.pitch)

    def _ranked(self, entity: Entity, refs: list[Ref]) -> list[Ref]:
        """Returns the referents that the phrase's sides, superlative and rank select."""
        if entity.ordinal is not None:
            return self._counted(entity, refs)
        if entity.kind not in ("thing", "stack"):
            return refs
        if entity.superlative is not None:
            refs = self._superlative(entity.superlative, refs)
        return self._toward(refs, entity.sides) if entity.sides else refs

    def _toward(self, refs: list[Ref], sides: tuple[str, ...]) -> list[Ref]:
        """Returns the referents that are farthest toward the sides."""
        tie = TIE * self.world.pitch
        if "center" in sides:
            middle = spot(*self.world.center)
            return best(refs, lambda ref: distance(ref.x, ref.y, middle), tie)
        if set(sides) & {"up", "top", "down"}:
            sign = 1.0 if sides[0] == "down" else -1.0
            return best(refs, lambda ref: sign * ref.top, tie)
        vectors = [self.world.toward(side) for side in dict.fromkeys(map(self.world.side, sides))]
        return best(refs, lambda ref: -sum(dx * ref.x + dy * ref.y for dx, dy in vectors), tie)

    def _superlative(self, name: str, refs: list[Ref]) -> list[Ref]:
        tie = TIE * self.world.pitch
        if name in ("left", "right"):
            return self._toward(refs, (name,))
        if name in ("high", "low"):
            return self._toward(refs, ("up" if name == "high" else "down",))
        if name in ("largest", "smallest"):
            sign = -1.0 if name == "largest" else 1.0
            return best(refs, lambda ref: sign * self._width(ref), 0.003)
        sign = 1.0 if name == "nearest" else -1.0
        robot = heads(self.world, Entity("robot"))[0]
        return best(refs, lambda ref: sign * distance(ref.x, ref.y, robot), tie)

    def _width(self, ref: Ref) -> float:
        return max((self.world.things[i].width for i in ref.things), default=0.0)

    def _counted(self, entity: Entity, refs: list[Ref]) -> list[Ref]:
        """Returns the referent of a rank: from the left, unless the phrase says from where."""
        assert entity.ordinal is not None
        start = "left"
        for relation in entity.relations:
            if relation.name in ("from", "on", "at") and relation.anchors and relation.anchors[0].sides:
                start = relation.anchors[0].sides[0]
                last = entity.ordinal == -1 and relation.name != "from"
                if last:
                    return self._toward(refs, (start,))
            if relation.name == "direction" and relation.value:
                start = relation.value
        dx, dy = self.world.toward(start) if start in (*SIDES, "front", "back", "forward", "backward") else (0.0, 1.0)
        order = sorted(refs, key=lambda ref: -(dx * ref.x + dy * ref.y))
        at = entity.ordinal - 1 if entity.ordinal > 0 else len(order) - 1
        return order[at : at + 1]
