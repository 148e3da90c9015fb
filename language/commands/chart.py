"""A chart parser that keeps every reading: memoised recursive descent over the lattice, with costs.

Each method returns the items that begin at a token, the cheapest first. A general parser of ambiguous grammars builds
the forest first and weighs it afterwards; here costs and the scene's judgement prune each span while it is parsed, so
that a sentence of 30 words takes milliseconds.
"""

from __future__ import annotations

from collections.abc import Callable

from language.commands import costs
from language.commands.items import Gaps, Item
from language.commands.lattice import Lattice
from language.commands.meanings import Entity, Measure, Relation
from language.commands.noun_phrases import NounPhrases
from language.commands.verb_words import FILLERS

MOST_RELATIONS = 3  # of one phrase
MOST_ATTACHED = 12  # phrases with one more relation that are weighed at one token
KEPT = 3  # items of the same span
WORSE = 5.0  # items are left out that cost this much more than the best of their span

Judge = Callable[[Entity], float]  # the cost of what an entity denotes


class Chart:
    """The entities and places of one sentence."""

    def __init__(self, lattice: Lattice, judge: Judge | None = None) -> None:
        """judge: adds a cost to an entity; None: readings are weighed without a scene."""
        self.lattice, self._judge = lattice, judge
        self.gaps = Gaps(lattice)
        self._entities: dict[int, list[Item]] = {}
        self._relations: dict[int, list[Item]] = {}
        self._noun_phrases = NounPhrases(self.gaps)

    def entities(self, start: int) -> list[Item]:
        """Returns the phrases for things and regions that begin at a token, with every attachment of relations."""
        if start not in self._entities:
            self._entities[start] = []  # a phrase never contains itself
            complete = [self._judged(item) for item in self._noun_phrases.at(start)]
            layer = complete
            for _ in range(MOST_RELATIONS):
                layer = self._best([self._judged(item) for item in self._with_relation(layer, start)])
                complete = complete + layer
            self._entities[start] = self._best(complete)
        return self._entities[start]

    def _with_relation(self, items: list[Item], start: int) -> list[Item]:
        pairs = []
        for item in items:
            if item.value.kind == "it":
                continue
            for relation in self.relations(item.end) + self._bare_regions(item) + self._further(item):
                bare = relation.value.name == "direction"
                if bare and relation.value.value in ("up", "down"):
                    continue
                cost = item.cost + relation.cost + costs.RELATION
                cost += costs.BARE_DIRECTION * (bare and relation.value.value != "top")
                pairs.append((cost, item, relation))
        pairs.sort(key=lambda pair: pair[0])
        return [
            Item(after.end, related(item.value, after.value, after.end), cost, item.skipped | after.skipped)
            for cost, item, after in pairs[:MOST_ATTACHED]
        ]

    def _further(self, item: Item) -> list[Item]:
        """Returns the relations after "and": "left of the ball and behind the cube"."""
        end = item.end
        if not item.value.relations or end >= len(self.lattice) or self.lattice.tokens[end].text not in ("and", "but"):
            return []
        return [found._replace(cost=found.cost + 0.2) for found in self.relations(end + 1)]

    def _bare_regions(self, item: Item) -> list[Item]:
        """Returns regions that follow a thing without a preposition: "the red cube left edge"."""
        if item.value.kind not in ("thing", "stack"):
            return []
        cost = costs.REGION_WITHOUT_PREPOSITION
        return [
            Item(
                found.end, Relation("at", (found.value,), span=(item.end, found.end)), found.cost + cost, found.skipped
            )
            for found in self.entities(item.end)
            if found.value.kind in ("corner", "edge", "side", "center") and not found.skipped
        ]

    def _judged(self, item: Item) -> Item:
        if self._judge is None:
            return item
        cost = self._judge(item.value)
        return item._replace(cost=item.cost + cost) if cost else item

    def _best(self, items: list[Item]) -> list[Item]:
        """Returns the cheapest items of each span."""
        spans: dict[int, list[Item]] = {}
        for item in sorted(items, key=lambda item: item.cost):
            kept = spans.setdefault(item.end, [])
            if len(kept) < KEPT and (not kept or item.cost <= kept[0].cost + WORSE):
                kept.append(item)
        return [item for kept in spans.values() for item in kept]

    def relations(self, start: int) -> list[Item]:
        """Returns the relations with their anchors that begin at a token."""
        if start not in self._relations:
            self._relations[start] = []
            found: list[Item] = []
            for gap in self.gaps.at(start):
                for item in [*self._plain(gap.end), *self._measured(gap.end)]:
                    found.append(Item(item.end, item.value, item.cost + gap.cost, item.skipped | gap.skipped))
            self._relations[start] = self._best_relations(found)
        return self._relations[start]

    def _best_relations(self, items: list[Item]) -> list[Item]:
        spans: dict[tuple, list[Item]] = {}
        for item in sorted(items, key=lambda item: item.cost):
            kept = spans.setdefault((item.end, item.value.name), [])
            if len(kept) < KEPT and (not kept or item.cost <= kept[0].cost + WORSE):
                kept.append(item)
        return [item for kept in spans.values() for item in kept]

    def _plain(self, start: int) -> list[Item]:
        found = []
        get = self.lattice.get
        for edge in get(start, "relation"):
            for anchor in self.anchored(edge.end):
                relation = Relation(edge.value, (anchor.value,), span=(start, anchor.end))
                cost = edge.cost + anchor.cost + odd(relation)
                if (
                    edge.end > start + 1
                    and relation.name == "on"
                    and anchor.value.kind in ("corner", "edge", "side", "center")
                ):
                    cost += costs.ON_TOP_OF_REGION
                found.append(Item(anchor.end, relation, cost, anchor.skipped))
        for category in ("held", "bare", "here"):
            for edge in get(start, category):
                span = (start, edge.end)
                shown = category == "here" and self.lattice.gestures
                anchors = (Entity("spot", pointed=start, span=span),) if shown else ()
                found.append(Item(edge.end, Relation(category, anchors, value=edge.value, span=span), edge.cost))
        for edge in get(start, "direction"):
            measures = [item for item in self.measure(edge.end) if item.value.unit != "bit" or item.end > edge.end]
            for item in [Item(edge.end, None, 0.0), *measures]:
                relation = Relation("direction", (), item.value, edge.value, (start, item.end))
                found.append(Item(item.end, relation, edge.cost + item.cost))
        for edge in get(start, "not"):
            for item in self.relations(edge.end):
                inner = Entity(relations=(item.value,), span=item.value.span)
                found.append(Item(item.end, Relation("not", (inner,), span=(start, item.end)), item.cost, item.skipped))
            for item in self.entities(edge.end):
                found.append(
                    Item(item.end, Relation("not", (item.value,), span=(start, item.end)), item.cost, item.skipped)
                )
        return found + self._between(start)

    def _between(self, start: int) -> list[Item]:
        found = []
        for edge in self.lattice.get(start, "between"):
            for one in self.entities(edge.end):
                if one.value.plural or (one.value.number or 0) > 1:
                    relation = Relation("between", (one.value,), span=(start, one.end))
                    found.append(Item(one.end, relation, edge.cost + one.cost, one.skipped))
                for join in self.lattice.get(one.end, "join"):
                    for other in self.entities(join.end):
                        relation = Relation("between", (one.value, other.value), span=(start, other.end))
                        cost = edge.cost + one.cost + other.cost
                        found.append(Item(other.end, relation, cost, one.skipped | other.skipped))
        return found

    def _measured(self, start: int) -> list[Item]:
        """Returns relations after a length: "two squares to the left of the cube", "3 cm back"."""
        found = []
        for measure in self.measure(start):
            for item in self._plain(measure.end):
                relation: Relation = item.value
                if relation.measure is None and relation.name not in ("held", "bare", "here", "of"):
                    measured = Relation(
                        relation.name, relation.anchors, measure.value, relation.value, (start, item.end)
                    )
                    found.append(Item(item.end, measured, measure.cost + item.cost, measure.skipped | item.skipped))
        return found

    def anchored(self, start: int) -> list[Item]:
        """Returns the entities that may follow a preposition."""
        return self.entities(start)

    def measure(self, start: int) -> list[Item]:
        """Returns the lengths that begin at a token."""
        found = [Item(edge.end, Measure(1.0, "bit"), edge.cost) for edge in self.lattice.get(start, "bit")]
        if start < len(self.lattice) and self.lattice.tokens[start].text == "by":
            found += self.measure(start + 1)
        numbers = self.lattice.get(start, "number") + [e._replace(value=1.0) for e in self.lattice.get(start, "any")]
        for number in numbers:
            at = number.end + (number.end < len(self.lattice) and self.lattice.tokens[number.end].text in FILLERS)
            for unit in self.lattice.get(at, "unit"):
                found.append(Item(unit.end, Measure(number.value, unit.value), number.cost + unit.cost))
        return found


def related(entity: Entity, relation: Relation, end: int) -> Entity:
    """Returns the entity with one more relation."""
    return Entity(
        entity.kind,
        entity.noun,
        entity.colors,
        entity.size,
        entity.sides,
        entity.superlative,
        entity.ordinal,
        entity.number,
        entity.every,
        entity.any,
        entity.single,
        entity.other,
        entity.plural,
        entity.exposed,
        entity.pointed,
        entity.role,
        (*entity.relations, relation),
        (entity.span[0], end),
    )


def odd(relation: Relation) -> float:
    """Returns the cost of a preposition that does not go with its anchor."""
    kind = relation.anchors[0].kind
    thing = kind in ("thing", "stack", "it", "fixture")
    if relation.name in ("in", "at", "to") and thing:
        return costs.ODD_PREPOSITION
    if relation.name == "of" and thing:
        return 2 * costs.ODD_PREPOSITION
    return 0.0
