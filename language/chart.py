"""Phrases for things and places: a chart parser that keeps every reading, by memoised recursive descent.

A general parser of ambiguous grammars builds the forest first and weighs it afterwards; here costs and the scene's
judgement prune each span while it is parsed, so that a sentence of 30 words takes milliseconds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

from language import costs
from language.cheapest import cheapest
from language.lattice import BARE_PLACES, Item, Lattice
from language.meanings import Entity, Measure, RelationPhrase
from language.spots import MiddleDistance
from language.words import ENCLOSING, REGIONS

_OURS = frozenset({"my", "our"})
_PLURAL = frozenset({"tetrahedra", "boxes", "dice", "furniture", "stuff"})
_MANY = frozenset(["them", "those", "these", "they", "both", "all", "two"])
_PICKING = frozenset({"superlative", "sides", "ordinal", "number"})  # what says which or how many of several
_NAMES = "size role single other every both any ordinal last superlative number exposed vacant"
_MODIFIERS = tuple(_NAMES.split())
_AREAS = ("corner", "edge", "side", "center")
_ONLY_PLACES = ("toward", "away", *BARE_PLACES, "spot_of")  # these say where a thing goes, not which one it is
_SPACED = ("left", "right", "front", "behind", "near")  # with how far apart two things are
MOST_RELATIONS = 3  # of one phrase
MOST_EXCLUDED = 3  # things that are added to the first one of those that are excluded
MOST_ATTACHED = 12  # phrases with one more relation that are weighed at one token
KEPT = 3  # items of the same span
WORSE = 5.0  # items are left out that cost this much more than the best of their span

Judge = Callable[[Entity], float]  # the cost of what an entity denotes


class _Draft(NamedTuple):
    """A noun phrase that is being parsed: the next token, its fields so far, its cost, the words left out."""

    at: int
    known: dict[str, Any]
    cost: float
    skipped: int


class NounPhrases:
    """The noun phrases of a chart's sentence."""

    def __init__(self, lattice: Lattice) -> None:
        self._lattice, self._get = lattice, lattice.get

    def at(self, start: int) -> list[Item]:
        """Return the noun phrases that begin at a token, after a gap."""
        found: list[Item] = []
        drafts = [_Draft(gap.end, {}, gap.cost, gap.skipped) for gap in self._lattice.gaps(start)]
        while drafts:
            draft = drafts.pop()
            found += self._ended(draft, start)
            drafts += self._extended(draft)
            if draft.known:  # fillers within the phrase, and one unknown word
                drafts += self._skipping(draft)
        return found

    def _skipping(self, draft: _Draft) -> list[_Draft]:
        lattice = self._lattice
        if draft.at >= len(lattice):
            return []
        cost = lattice.skip_cost(draft.at)
        second = cost and (draft.skipped or draft.at not in lattice.unknown)
        if second or lattice.text(draft.at) in (",", ":", ";", "to"):
            return []
        return [_Draft(draft.at + 1, draft.known, draft.cost + cost, draft.skipped | (1 << draft.at if cost else 0))]

    def _extended(self, draft: _Draft) -> list[_Draft]:
        """Return the drafts with one more modifier."""
        found = []
        for edge in self._get(draft.at, "pointing") if not draft.known else ():
            found.append(_Draft(edge.end, {"pointed": draft.at}, draft.cost + costs.POINTED, draft.skipped))
        for category in _MODIFIERS:
            for edge in self._get(draft.at, category):
                if category == "ordinal" and self._get(edge.end, "every"):
                    continue  # "first all balls" is a step
                more = _modified(draft.known, category, edge.value)
                if more and category == "number" and "any" in more and self._lattice.text(draft.at - 1) == "of":
                    more["number"] = 1  # "one of the two cubes"
                if more is not None:
                    found.append(_Draft(edge.end, more, draft.cost + edge.cost, draft.skipped))
        for edge in self._get(draft.at, "side"):
            sides = draft.known.get("sides", ())
            if edge.value not in sides:
                upper = self._lattice.table and self._lattice.text(draft.at) in ("top", "upper")  # of a tower, if any
                cost = draft.cost + edge.cost + costs.UPPER_SIDE * upper
                found.append(_Draft(edge.end, {**draft.known, "sides": (*sides, edge.value)}, cost, draft.skipped))
        colors = draft.known.get("colors", ())
        at = draft.at
        if colors and self._lattice.text(at) in ("and", ",", "&", "+"):
            at += 1 + (self._lattice.text(at + 1) == "and")
        for edge in self._get(at, "color"):
            more = {**draft.known, "colors": (*colors, edge.value)}
            found.append(_Draft(edge.end, more, draft.cost + edge.cost, draft.skipped))
        return found

    def _ended(self, draft: _Draft, start: int) -> list[Item]:
        """Return the phrases that end with the noun at the draft's token, or without a noun."""
        found = []
        at, known = draft.at, draft.known
        for edge in self._get(at, "noun"):
            found += self._thing(draft, edge, start)
        for edge in self._get(at, "stack"):
            found += self._stack(draft._replace(at=edge.end, cost=draft.cost + edge.cost), start)
        for edge in self._get(at, "region"):
            if edge.value == "robot" and at and self._lattice.tokens[at - 1].text in _OURS:
                continue  # "my hand" is not the robot's
            if not known.keys() & {"colors", "superlative", "single", "size", "role"}:
                found.append(_item(draft, edge.end, edge.cost, start, kind=edge.value))
        if not known:
            found += [_item(draft, edge.end, edge.cost, start, kind="mutual") for edge in self._get(at, "each_other")]
            for edge in self._get(at, "pronoun"):
                many = any(word in _MANY for word in edge.value.split())
                sure = 0.15 * (edge.end > at + 1 and self._lattice.table)  # "that one" is no thing of its own
                every = many and edge.value.startswith("all")
                found.append(_item(draft, edge.end, edge.cost - sure, start, kind="it", plural=many, every=every))
        elif known.keys() == {"pointed"}:
            found.append(_item(draft, at, 0.0, start, kind="thing"))
        elif not known.keys() - {"sides"}:
            far = costs.FAR_SIDE * ("far" in known["sides"] and len(known["sides"]) > 1)
            most = self._lattice.table and self._lattice.text(at - 1).endswith("most")  # rather a thing
            found.append(_item(draft, at, 0.5 + far + 1.5 * most, start, kind="side"))
            found.append(_item(draft, at, 1.2 - 0.6 * most, start, kind="thing"))
        elif self._lattice.table and len(known.get("colors", ())) > 1 and self._lattice.text(at - 2) in ("and", ","):
            found.append(_several(draft, at, costs.NO_NOUN + costs.LISTED, start))
        elif known.keys() & {"colors", "ordinal", "other", "every", "number", "single", "role"}:
            found.append(_item(draft, at, costs.NO_NOUN, start, kind="thing"))
        elif known.get("superlative") in ("left", "right") and len(known) == 1:
            sides = draft._replace(known={"sides": (known["superlative"],)})
            most = self._lattice.table and self._lattice.text(at - 1).endswith("most")
            found.append(_item(sides, at, 0.5 + 1.5 * most, start, kind="side"))
            found.append(_item(draft, at, costs.SUPERLATIVE_ALONE - most, start, kind="thing"))
        elif "superlative" in known:
            found.append(_item(draft, at, costs.SUPERLATIVE_ALONE, start, kind="thing"))
        return found + self._of_several(draft, start)

    def _of_several(self, draft: _Draft, start: int) -> list[Item]:
        """Return the phrases that say of which things before they select: "the rightmost of the blue cubes"."""
        text, known = self._lattice.text, draft.known
        picks = known.keys() & _PICKING
        if not self._lattice.table or text(draft.at) not in ("of", "among") or not picks:
            return []
        if picks == {"number"} and known["number"] == 1:
            return []  # "one of the cubes" is any of them
        if "sides" in known and not text(draft.at - 1).endswith("most"):
            return []  # "left of the two" is a place
        found = []
        for inner in self.at(draft.at + 1):
            value = inner.value
            if value.kind == "list" and not inner.skipped:  # "the nearest of the blue and cyan cubes"
                among = RelationPhrase("among", (value,), span=value.span)
                found.append(_item(draft, inner.end, inner.cost, start, kind="thing", relations=(among,)))
            named = {name: getattr(value, name) for name in ("noun", "colors", "size", "role") if getattr(value, name)}
            selects = value.every or value.any or value.ordinal or value.superlative or value.other or value.pointed
            counted = value.plural or (value.number or 1) > 1
            if value.kind == "thing" and counted and not (selects or inner.skipped or named.keys() & known.keys()):
                fields = {**known, **named, "plural": (known.get("number") or 1) > 1}
                sides = (*known.get("sides", ()), *value.sides)
                item = draft._replace(known={**fields, **({"sides": sides} if sides else {})})
                found.append(_item(item, inner.end, inner.cost, start, kind="thing"))
        return found

    def _thing(self, draft: _Draft, edge: Any, start: int) -> list[Item]:
        word = self._lattice.tokens[edge.end - 1].text
        noun = None if edge.value == "thing" else edge.value
        known = {**draft.known, "noun": noun, "plural": word.endswith("s") or word in _PLURAL}
        thing = _Draft(edge.end, known, draft.cost + edge.cost, draft.skipped)
        found = []
        for after in self._get(edge.end, "stack"):  # "block tower"
            found += self._stack(thing._replace(at=after.end), start)
        if len(known.get("colors", ())) > 1 and known["plural"] and self._lattice.table:
            found.append(_several(thing, edge.end, costs.LISTED, start))
        elif len(known.get("colors", ())) > 1:  # "the blue and green block" is a stack
            found.append(_item(thing, edge.end, 0.4, start, kind="stack"))
            if self._lattice.table:
                found.append(_several(thing, edge.end, 2 * costs.LISTED, start))
        else:
            found.append(_item(thing, edge.end, 0.0, start, kind="thing"))
            at = edge.end + (self._lattice.text(edge.end) in ("number", "no", "nr"))
            further = [e for e in self._get(edge.end, "noun") if e.value == "thing" and noun is not None]
            found += [_item(thing, e.end, 0.3, start, kind="thing") for e in further]  # "the button thing"
            numbers = [e for e in self._get(at, "number") if 0 < e.value < 20]
            found += [_item(thing, e.end, 0.3, start, kind="thing", ordinal=int(e.value)) for e in numbers]
        return found

    def _stack(self, draft: _Draft, start: int) -> list[Item]:
        found = [_item(draft, draft.at, 0.0, start, kind="stack")]
        for again in self._get(draft.at, "stack"):  # "combination tower"
            found.append(_item(draft, again.end, 0.0, start, kind="stack"))
        if self._lattice.text(draft.at) in ("of", "with", "made"):
            for inner in self.at(draft.at + 1):
                if inner.value.kind in ("thing", "stack") and not inner.skipped:
                    colors = draft.known.get("colors", ()) + inner.value.colors
                    known = {**draft.known, "colors": colors, "noun": inner.value.noun}
                    found.append(_item(draft._replace(known=known), inner.end, inner.cost, start, kind="stack"))
        return found


def _modified(known: dict[str, Any], category: str, value: Any) -> dict[str, Any] | None:
    """Return the fields so far with one more modifier; None if they have it already."""
    key = {"both": "number", "last": "ordinal", "vacant": "exposed"}.get(category, category)
    if key in known:
        return None
    values: dict[str, Any] = {"both": 2, "last": -1, **dict.fromkeys(("ordinal", "superlative", "size", "role"), value)}
    if category == "number":
        return {**known, "number": int(value)} if value == int(value) and 0 < value < 100 else None
    return {**known, key: values.get(category, True), **({"every": True} if category == "both" else {})}


def _several(draft: _Draft, end: int, cost: float, start: int) -> Item:
    """Return the list that several colours before one noun mean: "the red and blue cubes"."""
    fields = {name: value for name, value in draft.known.items() if name not in ("colors", "plural", "every", "number")}
    span = (start, end)
    parts = tuple(Entity("thing", **fields, colors=(meant,), span=span) for meant in draft.known["colors"])
    return Item(end, Entity("list", parts=parts, span=span), draft.cost + cost, draft.skipped)


def _item(draft: _Draft, end: int, cost: float, start: int, **fields: Any) -> Item:
    known = {**draft.known, **fields}
    if known["kind"] in REGIONS:
        known.pop("colors", None)
    if known.get("number") == 1 and known.get("plural"):  # "one of the cubes", whose "of the" says nothing
        known = {**known, "number": None, "plural": False, "any": True}
    return Item(
        end, Entity(**known, span=(draft.at if not draft.known else start, end)), draft.cost + cost, draft.skipped
    )


class Chart:
    """The entities and places of one sentence."""

    def __init__(self, lattice: Lattice, judge: Judge | None = None) -> None:
        """judge: adds a cost to an entity; None: readings are weighed without a scene."""
        self.lattice, self._judge = lattice, judge
        self._entities: dict[int, list[Item]] = {}
        self._relations: dict[int, list[Item]] = {}
        self._regions: dict[int, list[Item]] = {}
        self._ungapped: dict[int, list[Item]] = {}
        self._noun_phrases = NounPhrases(lattice)

    def entities(self, start: int) -> list[Item]:
        """Return the phrases for things and regions that begin at a token, with every attachment of relations."""
        if start not in self._entities:
            self._entities[start] = []  # a phrase never contains itself
            phrases = self._noun_phrases.at(start)
            phrases += [more for item in phrases for more in self._superlative_after(item)]
            complete = [self._judged(item) for item in phrases]
            layer = complete
            for _ in range(MOST_RELATIONS):
                layer = cheapest([self._judged(item) for item in self._with_relation(layer)], KEPT, WORSE)
                complete = complete + layer
            self._entities[start] = cheapest(complete, KEPT, WORSE)
        return self._entities[start]

    def _superlative_after(self, item: Item) -> list[Item]:
        """Return a thing with the superlative that follows it: "the cube furthest left", "the one that is largest"."""
        known = item.value
        if not self.lattice.table or known.kind != "thing" or known.superlative or known.sides or known.ordinal:
            return []
        found = []
        for gap in self.lattice.gaps(item.end):
            for edge in self.lattice.get(gap.end, "superlative") if not gap.cost else ():
                if not any(word.endswith(("est", "most")) for word in map(self.lattice.text, range(gap.end, edge.end))):
                    continue  # "the cube far left"
                if edge.value in ("nearest", "farthest") and self.lattice.get(edge.end, "relation"):
                    continue  # "the one closest to you"
                if self.lattice.get(edge.end, "noun") or self.lattice.text(edge.end) == "one":
                    continue  # "is the red cube the leftmost one"
                fields = {name: getattr(known, name) for name in _FIELDS} | {"superlative": edge.value}
                entity = Entity(**fields, span=(known.span[0], edge.end))
                found.append(Item(edge.end, entity, item.cost + edge.cost, item.skipped))
        return found

    def _with_relation(self, items: list[Item]) -> list[Item]:
        pairs = []
        for item in items:
            if item.value.kind == "it" or (item.value.kind == "board" and self.lattice.table):
                continue
            for relation in self.relations(item.end) + self._bare_regions(item) + self._further(item):
                bare = relation.value.name == "direction"
                if (bare and relation.value.value in ("up", "down")) or relation.value.name in _ONLY_PLACES:
                    continue
                if relation.value.name == "among" and item.value.kind != "thing":
                    continue  # "the one nearest to you | among these"
                further = relation.value.name in ("to", "left", "right") and relation.value.anchors[0].kind in _AREAS
                if further and item.value.kind in _AREAS and self.lattice.table:
                    continue  # "from the right | to the left side"
                cost = item.cost + relation.cost + costs.RELATION
                cost += costs.BARE_DIRECTION * (bare and relation.value.value != "top")
                pairs.append((cost, item, relation))
        pairs.sort(key=lambda pair: pair[0])
        return [
            Item(after.end, related(item.value, after.value, after.end), cost, item.skipped | after.skipped)
            for cost, item, after in pairs[:MOST_ATTACHED]
        ]

    def _further(self, item: Item) -> list[Item]:
        """Return the relations after "and": "left of the ball and behind the cube"."""
        if not item.value.relations or self.lattice.text(item.end) not in ("and", "but"):
            return []
        return [found._replace(cost=found.cost + 0.2) for found in self.relations(item.end + 1)]

    def _bare_regions(self, item: Item) -> list[Item]:
        """Return regions that follow a thing without a preposition: "the red cube left edge"."""
        if item.value.kind not in ("thing", "stack"):
            return []
        if any(anchor.kind == "side" for each in item.value.relations[-1:] for anchor in each.anchors):
            return []  # "in the left corner"
        if item.end not in self._regions:
            self._regions[item.end] = [
                Item(
                    found.end,
                    RelationPhrase("at", (found.value,), span=(item.end, found.end)),
                    found.cost + costs.REGION_WITHOUT_PREPOSITION,
                    found.skipped,
                )
                for found in self.entities(item.end)
                if found.value.kind in _AREAS and not found.skipped
            ]
        return self._regions[item.end]

    def _judged(self, item: Item) -> Item:
        if self._judge is None:
            return item
        cost = self._judge(item.value)
        return item._replace(cost=item.cost + cost) if cost else item

    def relations(self, start: int) -> list[Item]:
        """Return the relations with their anchors that begin at a token."""
        if start not in self._relations:
            self._relations[start] = []
            found: list[Item] = []
            for gap in self.lattice.gaps(start):
                for item in self._without_gap(gap.end):
                    found.append(Item(item.end, item.value, item.cost + gap.cost, item.skipped | gap.skipped))
            self._relations[start] = cheapest(found, KEPT, WORSE, lambda item: (item.end, item.value.name))
        return self._relations[start]

    def _without_gap(self, start: int) -> list[Item]:
        """Return all relations that begin at a token; those after different gaps share them."""
        if start not in self._ungapped:
            plain = self._plain(start)
            further = [more for each in plain for more in self._by(each)]
            self._ungapped[start] = [*plain, *self._measured(start), *further]
        return self._ungapped[start]

    def _plain(self, start: int) -> list[Item]:
        found = []
        get = self.lattice.get
        for edge in get(start, "relation"):
            for anchor in self.anchored(edge.end) if self.lattice.text(edge.end) != "," else ():
                relation = RelationPhrase(edge.value, (anchor.value,), span=(start, anchor.end))
                cost = edge.cost + anchor.cost + odd(relation)
                if edge.end > start + 1 and relation.name == "on" and anchor.value.kind in _AREAS:
                    cost += costs.ON_TOP_OF_REGION
                found.append(Item(anchor.end, relation, cost, anchor.skipped))
        for category in ("held", "bare", "here", *BARE_PLACES):
            for edge in get(start, category):
                span = (start, edge.end)
                shown = category == "here" and self.lattice.gestures
                anchors = (Entity("spot", pointed=start, span=span),) if shown else ()
                cost = edge.cost + costs.BARE_PLACE * (category in BARE_PLACES)
                found.append(Item(edge.end, RelationPhrase(category, anchors, value=edge.value, span=span), cost))
        for edge in get(start, "mutual"):
            span = (start, edge.end)
            together = RelationPhrase(edge.value, (Entity("mutual", span=span),), span=span)
            found.append(Item(edge.end, together, edge.cost))
        for edge in get(start, "direction"):
            measures = [item for item in self.measure(edge.end) if item.value.unit != "bit" or item.end > edge.end]
            for item in [Item(edge.end, None, 0.0), *measures]:
                relation = RelationPhrase("direction", (), item.value, edge.value, (start, item.end))
                away = 0.5 * (self.lattice.table and self.lattice.text(start) == "away")  # rather a part of the verb
                side = self.lattice.table and start > 0 and self.lattice.text(start - 1) == "on"  # "on the left"
                found.append(Item(item.end, relation, edge.cost + item.cost + away + side * costs.WAY_FOR_SIDE))
        for edge in get(start, "not"):
            for item in self.relations(edge.end):
                if item.value.name == "not":  # "but not the red one"
                    found.append(item)
                    continue
                inner = Entity(relations=(item.value,), span=item.value.span)
                relation = RelationPhrase("not", (inner,), span=(start, item.end))
                found.append(Item(item.end, relation, item.cost, item.skipped))
            for item in self._excluded(edge.end):
                relation = RelationPhrase("not", (item.value,), span=(start, item.end))
                found.append(Item(item.end, relation, item.cost, item.skipped))
        return found + self._between(start)

    def _excluded(self, start: int) -> list[Item]:
        """Return what is excluded: one thing or several, "except the red one and the blue one"."""
        some = self.lattice.table  # "all but two" leaves open which
        found = layer = [i for i in self.entities(start) if not (some and (i.value.number or 1) > 1)]
        for _ in range(MOST_EXCLUDED if self.lattice.table else 0):
            layer = [
                Item(more.end, _both(item.value, more.value), item.cost + more.cost, item.skipped | more.skipped)
                for item in layer
                if item.value.kind in ("thing", "list") and self.lattice.text(item.end) in ("and", "or", "nor", ",")
                for more in self.entities(item.end + 1 + (self.lattice.text(item.end + 1) in ("and", "or", "nor")))
                if more.value.kind == "thing"
            ]
            layer = cheapest(layer, KEPT, WORSE)
            found = found + layer
        return found

    def _between(self, start: int) -> list[Item]:
        found = []
        for edge in self.lattice.get(start, "between"):
            for one in self.entities(edge.end):
                if len(one.value.parts) == 2:  # "between the blue and cyan cubes"
                    relation = RelationPhrase("between", one.value.parts, span=(start, one.end))
                    found.append(Item(one.end, relation, edge.cost + one.cost - costs.LISTED, one.skipped))
                elif one.value.plural or (one.value.number or 0) > 1:
                    relation = RelationPhrase("between", (one.value,), span=(start, one.end))
                    found.append(Item(one.end, relation, edge.cost + one.cost, one.skipped))
                for join in self.lattice.get(one.end, "join"):
                    for other in self.entities(join.end):
                        relation = RelationPhrase("between", (one.value, other.value), span=(start, other.end))
                        cost = edge.cost + one.cost + other.cost
                        found.append(Item(other.end, relation, cost, one.skipped | other.skipped))
        return found

    def _measured(self, start: int) -> list[Item]:
        """Return relations after a length: "two squares to the left of the cube", "3 cm back"."""
        found = []
        for measure in self.measure(start):
            for item in self._plain(measure.end):
                relation: RelationPhrase = item.value
                if relation.name == "from" and self.lattice.text(measure.end) == "away":
                    continue  # "3 cm away from it" is farther
                if relation.measure is None and relation.name not in ("held", "bare", "here", "of", *BARE_PLACES):
                    measured = replace(relation, measure=measure.value, span=(start, item.end))
                    found.append(Item(item.end, measured, measure.cost + item.cost, measure.skipped | item.skipped))
        return [each for item in found for each in (item, *self._between_middles(item))]

    def _between_middles(self, item: Item) -> list[Item]:
        """Return a relation with a length that is measured as the words after it say: "from center to center"."""
        edges = self.lattice.get(item.end + (self.lattice.text(item.end) == ","), "middles")
        measure = MiddleDistance(item.value.measure.number, item.value.measure.unit)
        return [item._replace(end=edge.end, value=replace(item.value, measure=measure)) for edge in edges]

    def _by(self, item: Item) -> list[Item]:
        """Return a relation with the length after it: "away from me by 6 cm", "right of it, with a gap of 2 cm"."""
        relation: RelationPhrase = item.value
        if relation.measure is not None or not self.lattice.table:
            return []
        if relation.name in ("toward", "away"):
            found = self.measure(item.end)
        elif relation.name in _SPACED:
            found = self._spacing(item.end + (self.lattice.text(item.end) == ","))
        else:
            return []
        return [
            Item(by.end, replace(relation, measure=by.value, span=(relation.span[0], by.end)), item.cost, item.skipped)
            for by in found
            if by.value.unit != "bit"
        ]

    def _spacing(self, start: int) -> list[Item]:
        """Return the lengths that say how far two things are apart: "with a gap of 2 cm", "7 cm center to center"."""
        found = []
        leads = [start, *(edge.end for edge in self.lattice.get(start, "spacing"))]
        for at in leads:
            for length in self.measure(at):
                tails = [edge.end for edge in self.lattice.get(length.end, "spaced")]
                plain = at > start or isinstance(length.value, MiddleDistance) or self.lattice.text(start) == "by"
                found += [length._replace(end=end) for end in [*tails, *([length.end] if plain else [])]]
        return found

    def anchored(self, start: int) -> list[Item]:
        """Return the entities that may follow a preposition."""
        return self.entities(start)

    def measure(self, start: int) -> list[Item]:
        """Return the lengths that begin at a token."""
        found = [Item(edge.end, Measure(1.0, "bit"), edge.cost) for edge in self.lattice.get(start, "bit")]
        if self.lattice.text(start) == "by":
            found += self.measure(start + 1)
        numbers = self.lattice.get(start, "number") + [e._replace(value=1.0) for e in self.lattice.get(start, "any")]
        for number in numbers:
            at = number.end + (number.end < len(self.lattice) and self.lattice.is_filler(number.end))
            for unit in self.lattice.get(at, "unit"):
                cost = number.cost + unit.cost
                found.append(Item(unit.end, Measure(number.value, unit.value), cost))
                for middles in self.lattice.get(unit.end, "middles"):
                    found.append(Item(middles.end, MiddleDistance(number.value, unit.value), cost))
        return found


_FIELDS = tuple(name for name in Entity.__slots__ if name not in ("relations", "span"))


def related(entity: Entity, relation: RelationPhrase, end: int) -> Entity:
    """Return the entity with one more relation."""
    fields = {name: getattr(entity, name) for name in _FIELDS}
    return Entity(**fields, relations=(*entity.relations, relation), span=(entity.span[0], end))


def _both(one: Entity, other: Entity) -> Entity:
    """Return the list of a thing, or of several, and a further one."""
    return Entity("list", parts=(*(one.parts or (one,)), other), span=(one.span[0], other.span[1]))


def is_mutual(place: RelationPhrase) -> bool:
    """Whether a place says where several things are to each other: "next to each other"."""
    return any(anchor.kind == "mutual" for anchor in place.anchors)


def says_where(relation: RelationPhrase) -> bool:
    """Whether a relation may be the place where something goes."""
    return relation.name not in ("held", "bare", "not", "with", "of", "among")


def odd(relation: RelationPhrase) -> float:
    """Return the cost of a preposition that does not go with its anchor."""
    kind = relation.anchors[0].kind
    thing = kind in ("thing", "stack", "it") and relation.anchors[0].noun not in ENCLOSING
    if relation.name in ("in", "at", "to") and thing:
        return costs.ODD_PREPOSITION
    if relation.name == "of" and thing:
        return 2 * costs.ODD_PREPOSITION
    if relation.name == "from" and kind == "robot":  # rather "away"
        return costs.ODD_PREPOSITION
    if kind == "list" and relation.name != "among":
        return costs.TOO_MUCH if relation.name in ("on", "over") else 4 * costs.ODD_PREPOSITION
    if relation.name in ("left", "right") and kind == "side":  # "in the lower right to ..."
        return 2 * costs.ODD_PREPOSITION
    return 0.0
