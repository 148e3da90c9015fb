"""Readings of whole sentences: clauses with their objects and places, conditions and fragments."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from language import costs
from language.absence import cleared
from language.chart import Chart, Judge, is_mutual, says_where
from language.cheapest import Joined, cheapest
from language.lattice import Item, Lattice
from language.meanings import Clause, Entity, Gesture, Reading, RelationPhrase, bound, needs_gesture, pointing_words
from language.objects import DEVICES
from language.scanning import Token
from language.verbs import KNOWN, Act

MOST_PLACES = 3  # relations that are joined to one place
MOST_JOINED = 16  # of the places, and of the relations after each, that are joined
MOST_CLAUSES = 8
MOST_LISTED = 5  # things that are added to the first one of a list
MOST_COST = 16.0  # readings that cost more leave out most of the sentence
KEPT_CLAUSES, KEPT_READINGS = 16, 80  # of the same span; of the sentence
_BROUGHT = (Act.CARRY, Act.LOWER, Act.GIVE, Act.REMOVE, Act.STORE)
PLACED = (*_BROUGHT, Act.TAKE, Act.HOLD, Act.OPERATE, Act.UNSTACK)  # with a place
ARRANGED = (Act.BUILD, Act.GATHER)
_ON_BOTH = (*ARRANGED, Act.SWAP)
_LOOSE = ((",",), ("then",))  # which also join clauses
_LISTING = ((",", "and"), ("and",), *_LOOSE, ("as", "well", "as"), ("plus",), ("or",))
BARE = (Act.OPEN, Act.SHUT, Act.OPERATE, Act.GIVE, Act.TAKE, Act.UNSTACK, Act.TIDY, Act.EMPTY)  # without an object


def readings(
    words: str | list[Token],
    judge: Judge | None = None,
    made: Sequence[Gesture] = (),
    acts: Collection[Act] = frozenset(Act),
    table: bool = True,
) -> tuple[list[Reading], Lattice]:
    """Return the readings of a sentence, the cheapest first, and its lattice.

    Args:
        words: a sentence as a person writes it, or its plain words.
        judge: gives the costs of phrases in the scene; None: there is no scene.
        made: the gestures that accompany the sentence, in order.
        acts: of the verbs that can mean something in the scene.
        table: whether the scene is a table, not a board.

    Raises:
        NotUnderstood: the sentence is too long.
    """
    lattice = Lattice(words, len(made), acts, table)
    found = _Sentences(Chart(lattice, judge)).likeliest()
    return (_with_gestures(found, made, judge) if made else found), lattice


def _with_gestures(found: list[Reading], made: Sequence[Gesture], judge: Judge | None) -> list[Reading]:
    """Return the readings with their gestures, whose phrases can only now be compared with the scene."""
    changed = []
    used = [min(len(pointing_words(reading)), len(made)) for reading in found]
    for reading, its in zip(found, used, strict=True):
        cost = reading.cost + costs.UNUSED_GESTURE * (max(used) - its)
        shown = bound(reading, made)
        pairs = zip(reading.steps, shown.steps, strict=True)
        phrases = [
            after.entity for before, after in pairs if before.entity is not None and needs_gesture(before.entity)
        ]
        cost += sum(judge(phrase) for phrase in phrases if phrase is not None) if judge else 0.0
        changed.append(replace(shown, cost=cost))
    return sorted(changed, key=lambda reading: reading.cost)


class _Sentences:
    def __init__(self, chart: Chart) -> None:
        self.chart, self.lattice = chart, chart.lattice
        self._clauses: dict[int, list[Item]] = {}
        self._placed: dict[int, list[Item]] = {}
        self._objects: dict[tuple[int, bool], list[Item]] = {}

    def likeliest(self) -> list[Reading]:
        """Return the readings of the least cost."""
        rests = self._rests()
        found: list[tuple[Item, bool]] = []
        wait = {"wait": 1, "hang": 2, "hold": 2}.get(self.lattice.text(0), 0) if self.lattice.table else 0
        openings = [(0, False), *((edge.end, True) for edge in self.lattice.get(wait, "not_meant"))]
        for start, rejects in openings:
            start += self.lattice.text(start) in (",", ".", "!", ";") and rejects
            if rejects and "not" in (self.lattice.text(start - 1), self.lattice.text(start)) and self.lattice.table:
                continue  # "no, not the blue one": what follows is not meant either
            for item in [*self._sequences(start), *self._conditions(start)]:
                rest = rests[item.end]
                whole = item._replace(cost=item.cost + rest.cost, skipped=item.skipped | rest.skipped)
                if whole.cost <= MOST_COST:
                    found.append((whole, rejects))
        found.sort(key=lambda each: each[0].cost)
        return [self._reading(item, rejects) for item, rejects in found[:KEPT_READINGS]]

    def _rests(self) -> list[Item]:
        """Return, for each token, the cost of leaving out the rest of the sentence from there on."""
        rests = [Item(len(self.lattice), None, 0.0)]
        for index in range(len(self.lattice) - 1, -1, -1):
            join = "join" in self.lattice.edges[index] and self.lattice.tokens[index].text in (".", ";", "and", "then")
            cost = 0.0 if join else self.lattice.skip_cost(index)
            rest = rests[-1]
            idle = [(a.cost + rests[len(self.lattice) - a.end].cost, a) for a in self.lattice.asides(index)]
            best = min(idle, default=None, key=lambda each: each[0])
            if best is not None and best[0] < rest.cost + cost:
                rests.append(Item(index, None, best[0], rests[len(self.lattice) - best[1].end].skipped))
                continue
            rests.append(Item(index, None, rest.cost + cost, rest.skipped | (1 << index if cost else 0)))
        return rests[::-1]

    def _reading(self, item: Item, rejects: bool) -> Reading:
        reading = item.value if isinstance(item.value, Reading) else Reading(item.value)
        words = tuple(i for i in range(len(self.lattice)) if item.skipped >> i & 1)
        any_one = any(token.text == "whichever" for token in self.lattice.tokens)
        return replace(reading, cost=item.cost, rejects=rejects, unused=words, arbitrary=any_one)

    def _conditions(self, start: int) -> list[Item]:
        """Return "if there is X, steps, otherwise steps"."""
        found = []
        for item in self.lattice.gaps(start):
            for opening in self.lattice.get(item.end, "if"):
                for there in self.lattice.get(opening.end, "there"):
                    for entity in self.chart.entities(there.end):
                        absent = costs.EMPTY if entity.cost >= costs.EMPTY else 0.0  # what is asked for may be absent
                        found += self._consequences(entity._replace(cost=entity.cost - absent))
        return found

    def _consequences(self, condition: Item) -> list[Item]:
        found = []
        for steps in self._sequences(condition.end):
            cost, skipped = condition.cost + steps.cost, condition.skipped | steps.skipped
            plain = Reading(steps.value, condition=condition.value)
            found.append(Item(steps.end, plain, cost, skipped))
            for gap in self.lattice.gaps(steps.end):
                for word in self.lattice.get(gap.end, "else"):
                    for other in self._sequences(word.end):
                        full = replace(plain, otherwise=other.value)
                        total = cost + gap.cost + other.cost
                        found.append(Item(other.end, full, total, skipped | gap.skipped | other.skipped))
        return found

    def _sequences(self, start: int) -> list[Item]:
        """Return one or more clauses, joined."""
        layer = [item._replace(value=(item.value,)) for item in self.clauses(start)]
        found = layer
        for _ in range(MOST_CLAUSES - 1):
            longer = []
            joins = {end: self._joins(end) for end in dict.fromkeys(item.end for item in layer)}
            for item in layer:
                for at, cost in joins[item.end]:
                    for clause in self.clauses(at):
                        total = item.cost + cost + clause.cost + self._elliptic(item.value[-1], clause.value)
                        if total <= MOST_COST:
                            longer.append(Joined(clause.end, item, total, clause))
            layer = [
                Item(end, (*item.value, clause.value), total, item.skipped | clause.skipped)
                for end, item, total, clause in cheapest(longer, KEPT_CLAUSES)
            ]
            found = found + layer
            if not layer:
                break
        return found

    def _elliptic(self, before: Clause, clause: Clause) -> float:
        """Return the cost of a thing with a place after a command: rather what goes there than another object."""
        topic = before.entity is not None and before.span[0] == before.entity.span[0] and not before.entity.colors
        taken = clause.act in _GRIPS and clause.entity is not None and clause.entity.kind == "it"
        if self.lattice.table and topic and before.places and taken:
            return costs.TOPIC_TAKEN
        if not self.lattice.table or (before.verb is not None and clause.verb is not None):
            return 0.0
        related = clause.verb is None and clause.entity is not None and bool(clause.entity.relations)
        if before.verb is None and before.entity is not None and before.entity.relations:
            return costs.TOPIC_LEFT * (clause.entity is not None and clause.entity.kind != "it")
        return costs.NO_VERB_BUT_PLACE * (related and before.act is Act.CARRY)

    def _joins(self, end: int) -> list[tuple[int, float]]:
        """Return where a further clause may begin, with its cost."""
        found = {}
        at = end
        while self.lattice.text(at) in (",", "-", "please", ":", "!", "?"):
            at += 1
        for edge in self.lattice.get(at, "join"):
            further = [again.end for again in self.lattice.get(edge.end, "join")]
            found.update(dict.fromkeys([edge.end, *further], 0.0))
        if any(edge.cost == 0.0 for edge in self.lattice.get(at, "verb")):  # no word that is only similar to a verb
            found.setdefault(at, costs.STEP_WITHOUT_JOIN if at == end else 0.3)
        if at > end:
            found.setdefault(at, costs.STEP_WITHOUT_JOIN if not self.lattice.table else 0.4)
        for aside in self.lattice.asides(at):  # "open it, that is all I ask, and close it again"
            for edge in self.lattice.get(aside.end, "join"):
                found.setdefault(edge.end, aside.cost)
            if self.lattice.get(aside.end, "verb"):
                found.setdefault(aside.end, aside.cost + 0.3)
        return list(found.items())

    def clauses(self, start: int) -> list[Item]:
        """Return the clauses that begin at a token."""
        if start not in self._clauses:
            found: list[Item] = []
            for gap in self._openings(start):
                items = self._clause(gap.end)
                items = cheapest(items + [more for each in items for more in self._ordered(each)], KEPT_CLAUSES)
                found += [Item(i.end, i.value, gap.cost + i.cost, gap.skipped | i.skipped) for i in items]
            self._clauses[start] = cheapest(found, KEPT_CLAUSES)
        return self._clauses[start]

    def _openings(self, start: int) -> list[Item]:
        """Return where a clause may begin: after gaps, and after what asks for nothing."""
        found = [*self.lattice.gaps(start)]
        for gap in self.lattice.gaps(start):
            for aside in self.lattice.asides(gap.end) if not gap.cost else ():
                at = aside.end + (self.lattice.text(aside.end) in (",", ".", ";", "!", "and", "so"))
                found += [Item(g.end, None, aside.cost + g.cost, g.skipped) for g in self.lattice.gaps(at)]
        return found

    def _clause(self, at: int) -> list[Item]:
        found = []
        for edge in self.lattice.get(at, "verb"):
            found += [i._replace(cost=i.cost + edge.cost) for i in self._with_verb(edge.value, edge.end, at)]
        for edge in self.lattice.get(at, "never"):
            done = [i for i in self.clauses(edge.end) if i.value.verb is not None]
            found += [i._replace(value=replace(i.value, negated=True, span=(at, i.end))) for i in done]
            found += self._contrasted(edge.end)
        return found + self._without_verb(at)

    def _ordered(self, item: Item) -> list[Item]:
        """Return the clause with the order in which it is done to several things: "touch them | starting with X"."""
        entity, act = item.value.entity, item.value.act
        if entity is None or not (act in ARRANGED or (is_several(entity) and self.lattice.table)):
            return []
        found = []
        for edge in self.lattice.get(item.end + (self.lattice.text(item.end) in (",", "and")), "order"):
            for first in self.objects(edge.end, True) if edge.value != "reversed" else [Item(edge.end, None, 0.0)]:
                parts = tuple(filter(None, (first.value,)))
                order = RelationPhrase("order", parts, value=edge.value, span=(edge.end, first.end))
                clause = replace(item.value, places=(*item.value.places, order))
                more = Item(first.end, clause, item.cost + first.cost, item.skipped | first.skipped)
                found += [more, *self._ordered(more)]
        return found

    def _contrasted(self, at: int) -> list[Item]:
        """Return what is to be done instead: "do not | put it in the drawer but in the fridge"."""
        found = []
        for item in self.clauses(at):
            begin = item.end + (self.lattice.text(item.end) == ",")
            if item.value.verb is None or not item.value.places or self.lattice.text(begin) != "but":
                continue
            for place in self.places(begin + 1):
                clause = replace(item.value, places=place.value, span=(at, place.end))
                total = item.cost + place.cost - costs.CONTRAST
                found.append(Item(place.end, clause, total, item.skipped | place.skipped))
        return found

    def objects(self, start: int, lists: bool = False) -> list[Item]:
        """Return the phrases for things that begin at a token, and lists of them: "X, Y and Z"; on a board if asked."""
        lists = lists or self.lattice.table
        if (start, lists) not in self._objects:
            found = layer = [
                item  # "you" act, and are not moved
                for item in self.chart.entities(start)
                if not (self.lattice.table and item.value.kind == "robot" and self.lattice.text(item.end - 1) == "you")
            ]
            for _ in range(MOST_LISTED if lists else 0):
                layer = cheapest([more for item in layer for more in self._listed(item)], 3)
                found = found + layer
                if not layer:
                    break
            self._objects[start, lists] = found
        return self._objects[start, lists]

    def _listed(self, item: Item) -> list[Item]:
        """Return the lists with one more thing; `any`: one of them is meant, "X or Y"."""
        at, first = item.end, item.value
        if first.kind not in ("thing", "list"):
            return []
        if self.lattice.table and first.relations and self.lattice.text(at + 1) == "then":
            return []  # "put X next to Y and then Z next to W"
        for words in _LISTING:
            if tuple(self.lattice.text(at + i) for i in range(len(words))) == words:
                parts = first.parts if first.kind == "list" else (first,)
                return [
                    Item(
                        more.end,
                        Entity(
                            "list", any=words == ("or",), parts=(*parts, more.value), span=(first.span[0], more.end)
                        ),
                        item.cost + more.cost + costs.LISTED + 0.6 * (words in _LOOSE) + 0.3 * bool(first.relations),
                        item.skipped | more.skipped,
                    )
                    for more in self.chart.entities(at + len(words))
                    if more.value.kind == "thing" and not more.skipped
                ]
        return []

    def _with_verb(self, verb: str, at: int, start: int) -> list[Item]:
        act = KNOWN[verb].act
        if act is Act.NEVER:
            return [*self._never(verb, at, start), *self._thrown(verb, at, start)]
        if act in ARRANGED:
            built = self._building(verb, at, start)
            for i, place in [(item, place) for item in built for place in self.places(item.end)]:
                what = i.value.entity  # "stack the two cubes on the right" rather says which two
                says_which = what.kind == "thing" and what.span[0] == at and (what.number or what.every)
                which = costs.TAKEN_SOMEWHERE * bool(says_which)
                clause = replace(i.value, places=place.value)
                built = [*built, Item(place.end, clause, i.cost + place.cost + which, i.skipped | place.skipped)]
            return built
        found = [] if act is not Act.LOWER else [Item(at, Clause(verb, span=(start, at)), 0.0)]
        if act in BARE:
            found.append(Item(at, Clause(verb, span=(start, at)), costs.NO_OBJECT + 0.3))
        light = act is Act.OPERATE and self.lattice.text(at - 1) in _LIGHT and self.lattice.table
        if light:
            named = [each for each in self.objects(at) if each.value.noun in _DEVICES]
            return [more for each in named for more in self._completed(verb, each, start, at)]
        starts = [Item(at, None, 0.0)] + [Item(e.end, None, e.cost) for e in self.lattice.get(at, "particle")]
        for begin in starts:
            for entity in self.objects(begin.end):
                found += self._completed(verb, entity, start, at)
            if act in PLACED and act not in (Act.OPERATE, Act.HOLD, Act.GIVE):
                found += self._inverted(verb, begin, start)
        return found

    def _never(self, verb: str, at: int, start: int) -> list[Item]:
        """Return the clause of a verb that no robot here can do: whatever follows belongs to it."""
        end = at
        while end < len(self.lattice) and self.lattice.text(end) not in (".", ";", ",", "then", "!", "?"):
            end += 1
        entity = next((item.value for item in self.chart.entities(at) if item.value.kind == "thing"), None)
        return [Item(end, Clause(verb, entity, span=(start, end)), costs.NEVER)]

    def _thrown(self, verb: str, at: int, start: int) -> list[Item]:
        """Return the clause of such a verb with its object and place, for tasks that can do it."""
        if not KNOWN[verb].effect:
            return []
        things = self.chart.entities(at)
        return [more for each in things for more in self._placed_at(verb, each, start, each.end, 0.0)]

    def _building(self, verb: str, at: int, start: int) -> list[Item]:
        """Return the clauses that ask for a tower: "build a tower of three cubes", "stack the red and blue cube"."""
        tower = self._tower(at)
        found = [Item(i.end, Clause(verb, i.value, span=(start, i.end)), i.cost + 0.2, i.skipped) for i in tower]
        if self.lattice.text(start) in ("give", "i", "we", "have"):  # "give me the red cube and the blue one"
            return found
        return found + [
            Item(i.end, Clause(verb, i.value, span=(start, i.end)), i.cost + 0.9, i.skipped)
            for i in self.objects(at, True)
            if (is_several(i.value) and i.value.kind != "stack") or i.value.plural
        ]

    def _tower(self, at: int) -> list[Item]:
        """Return what a tower consists of: "a tower of three cubes"."""
        for first in self.lattice.gaps(at):
            for any_one in [*self.lattice.get(first.end, "any"), *self.lattice.get(first.end, "number"), None]:
                if any_one is not None and any_one.category == "number" and any_one.value > 1:
                    continue  # "two towers of two cubes" are no tower
                place = any_one.end if any_one else first.end
                while place < len(self.lattice) and (
                    {"size", "single", "other"} & self.lattice.edges[place].keys()
                    or self.lattice.text(place) in ("more", "new")
                ):
                    place += 1
                for edge in self.lattice.get(place, "stack"):
                    after = edge.end
                    if self.lattice.text(after) in ("of", "from", "with", "using", "out", "consisting", ":"):
                        after += 1 + (self.lattice.text(after + 1) == "of")
                        return [item._replace(cost=item.cost + first.cost) for item in self.objects(after, True)]
        return []

    def _inverted(self, verb: str, begin: Item, start: int) -> list[Item]:
        """Return the clauses whose place precedes the object or is without one: "and place on the red block"."""
        found = []
        for place in self.places(begin.end):
            clause = Clause(verb, None, place.value, span=(start, place.end))
            found.append(Item(place.end, clause, place.cost + costs.NO_OBJECT, place.skipped))
            for entity in self.objects(place.end):
                clause = Clause(verb, entity.value, place.value, span=(start, entity.end))
                cost = place.cost + entity.cost + costs.INVERTED
                found.append(Item(entity.end, clause, cost, place.skipped | entity.skipped))
        return found

    def _completed(self, verb: str, entity: Item, start: int, at: int) -> list[Item]:
        """Return the clauses with this object, with and without a particle and a place."""
        found = []
        for end, cost, meant in [(entity.end, 0.0, verb), *self._particles(verb, entity, start, at)]:
            act = KNOWN[meant].act
            base = entity.cost + cost
            alone = 1.0 if act is Act.CARRY else 0.0
            found.append(Item(end, Clause(meant, entity.value, span=(start, end)), base + alone, entity.skipped))
            if act in PLACED:
                found += self._placed_at(meant, entity, start, end, cost)
            if act is Act.SWAP and self.lattice.text(end) in ("with", "for", "and", "against"):
                for other in self.chart.entities(end + 1):
                    both = Entity("list", parts=(entity.value, other.value), span=(entity.value.span[0], other.end))
                    clause = Clause(meant, both, span=(start, other.end))
                    found.append(Item(other.end, clause, base + other.cost, entity.skipped | other.skipped))
        for edge in self.lattice.get(entity.end, "done"):  # "have the drawer opened"
            if KNOWN[verb].act in (Act.GIVE, Act.CARRY) and not entity.value.single:
                clause = Clause(edge.value, entity.value, span=(start, edge.end))
                found.append(Item(edge.end, clause, entity.cost + edge.cost + 0.3, entity.skipped))
        return found

    def _particles(self, verb: str, entity: Item, start: int, at: int) -> list[tuple[int, float, str]]:
        """Return the particles after an object: the token after each, its cost, and the verb together with it."""
        found: list[tuple[int, float, str]] = []
        for edge in self.lattice.get(entity.end, "particle"):
            joined = [token.text for token in self.lattice.tokens[start:at]]
            for more in self.lattice.get(edge.end, "particle"):  # "back in"
                names = self._verbs_of([*joined, *(t.text for t in self.lattice.tokens[entity.end : more.end])])
                found += [(more.end, more.cost, name) for name in names]
            names = self._verbs_of([*joined, *(t.text for t in self.lattice.tokens[entity.end : edge.end])])
            found += [(edge.end, edge.cost, name) for name in names]
            if not names or KNOWN[verb].act in (Act.TAKE, Act.CARRY):
                found.append((edge.end, edge.cost + 0.15 * bool(names), verb))
        return found

    def _verbs_of(self, words: list[str]) -> list[str]:
        """Return the verbs that consist of these words, one for each act."""
        from language.lattice import trie

        node = trie()
        for word in words:
            node = node.get(word, {})
        names = [value for category, value in node.get(None, ()) if category == "verb"]
        return list({KNOWN[name].act: name for name in reversed(names) if KNOWN[name].act is not Act.NEVER}.values())

    def _placed_at(self, verb: str, entity: Item, start: int, at: int, cost: float) -> list[Item]:
        taking = KNOWN[verb].act in (Act.TAKE, Act.HOLD)
        which = 1.5 * (self.lattice.text(at) in ("that", "which", "who") and self.lattice.table)
        given = KNOWN[verb].act is Act.GIVE and self.lattice.table  # rather onto the hand than elsewhere
        away = 0.5 * (self.lattice.table and entity.value.kind != "it")  # "from" says which thing, rather than where to
        return [
            Item(
                place.end,
                Clause(verb, entity.value, place.value, span=(start, place.end)),
                entity.cost
                + cost
                + place.cost
                + costs.TAKEN_SOMEWHERE * (taking and place.value[0].name != "away")
                + costs.PLACED_LIST * _placed_in_part(entity.value)
                + which
                + 1.0 * (given and not any(anchor.kind == "person" for anchor in place.value[0].anchors))
                + away * (place.value[0].name == "from"),
                entity.skipped | place.skipped,
            )
            for place in self.places(at)
        ]

    def _without_verb(self, at: int) -> list[Item]:
        found = []
        for entity in self.objects(at):
            clause = Clause(None, entity.value, span=(at, entity.end))
            cost = entity.cost + costs.NO_VERB + costs.PLACED_LIST * _placed_in_part(entity.value)
            found.append(Item(entity.end, clause, cost, entity.skipped))
            for place in self.places(entity.end):
                clause = Clause(CARRYING, entity.value, place.value, span=(at, place.end))
                it = entity.value
                vague = it.kind == "thing" and not (it.noun or it.colors or it.other or it.superlative or it.sides)
                vague = vague and self.lattice.table and not self._obliged(entity.end, place.value[0].span[0])
                cost = entity.cost + place.cost + costs.NO_VERB_BUT_PLACE + costs.VAGUE * vague
                cost += costs.PLACED_LIST * _placed_in_part(it)
                found.append(Item(place.end, clause, cost, entity.skipped | place.skipped))
            if self.lattice.table:
                found += self._done(entity, at) + self._with_particle(entity, at)
        for edge in self.lattice.get(at, "none") if self.lattice.table else ():
            for place in self.places(edge.end):
                if (done := cleared(place.value[0], (at, place.end))) is not None:
                    found.append(Item(place.end, done, place.cost + costs.NO_VERB_BUT_PLACE, place.skipped))
        for place in self.places(at):
            clause = Clause(None, None, place.value, span=(at, place.end))
            found.append(Item(place.end, clause, place.cost + costs.NO_VERB, place.skipped))
            found += self._place_first(place, at) if self.lattice.table else []
        tower = self._tower(at) if self.lattice.table else []
        found += [Item(i.end, Clause(BUILDING, i.value, span=(at, i.end)), i.cost + 1.0, i.skipped) for i in tower]
        return found

    def _obliged(self, start: int, end: int) -> bool:
        """Return whether some words say that a thing has to go where the words after them say."""
        return any(self.lattice.text(at) in _OBLIGED for at in range(start, end))

    def _place_first(self, place: Item, at: int) -> list[Item]:
        """Return the clauses after their place: "in the drawer: the gray one", "between the two set the red cube"."""
        found = []
        begin = place.end + (self.lattice.text(place.end) in (":", ","))
        mutual = any(map(is_mutual, place.value))  # "touch two cubes"
        verbs = [] if mutual else [(CARRYING, begin, costs.NO_VERB_BUT_PLACE + costs.NO_VERB * (begin == place.end))]
        verbs += [(e.value, e.end, e.cost) for e in self.lattice.get(begin, "verb") if KNOWN[e.value].act is Act.CARRY]
        for verb, start, cost in verbs:
            for entity in self.objects(start):
                total = place.cost + entity.cost + cost + costs.INVERTED
                skipped = place.skipped | entity.skipped
                clause = Clause(verb, entity.value, place.value, span=(at, entity.end))
                found.append(Item(entity.end, clause, total, skipped))
                for gap in self.lattice.gaps(entity.end) if verb is CARRYING else ():
                    for edge in self.lattice.get(gap.end, "done"):
                        if KNOWN[edge.value].act is Act.CARRY and not gap.cost:
                            clause = Clause(edge.value, entity.value, place.value, span=(at, edge.end))
                            found.append(Item(edge.end, clause, total - cost + costs.PARTICIPLE, skipped))
        return found

    def _with_particle(self, entity: Item, at: int) -> list[Item]:
        """Return the clauses of a thing and a particle: "the drawer out, the blue cube in, the drawer shut"."""
        found = []
        for gap in self.lattice.gaps(entity.end):
            particles = self.lattice.get(gap.end, "particle") if not gap.cost else ()
            for edge in (each for each in particles if self.lattice.text(each.end) != "there"):
                names = {n for v in _WITH_PARTICLE for n in self._verbs_of([v, self.lattice.text(gap.end)])}
                bare = entity.value.noun is None  # "red out" is rather a cube than a door
                cost = entity.cost + edge.cost + costs.NO_VERB_BUT_PLACE + costs.NO_NOUN * bare
                for name in sorted(names):
                    boxes = KNOWN[name].act in (Act.OPEN, Act.SHUT)
                    if boxes or KNOWN[name].act in (Act.REMOVE, Act.UNSTACK):
                        clause = Clause(name, entity.value, span=(at, edge.end))
                        total = cost + costs.VAGUE * (bare and boxes)
                        found.append(Item(edge.end, clause, total, entity.skipped | gap.skipped))
        return found

    def _done(self, entity: Item, at: int) -> list[Item]:
        """Return the clauses whose verb follows the object: "the drawer closed", "the cube was put in the drawer"."""
        found: list[Item] = []
        asks = {self.lattice.text(i) for i in range(max(at - 1, 0), at + 1)} & _ASKING
        if entity.value.single or asks:  # "only the drawer open" says that nothing else is
            return found
        for gap in self.lattice.gaps(entity.end):
            for edge in [*self.lattice.get(gap.end, "done"), *self.lattice.get(gap.end, "verb")]:
                act = KNOWN[edge.value].act
                both = edge.category == "done" and is_several(entity.value)  # "the two cubes should be stacked"
                beside = act is Act.TOUCH and edge.category == "verb"  # "the cube touching it"
                if gap.cost or beside or act in (Act.NEVER, Act.TIDY) or (act in _ON_BOTH and not both):
                    continue
                cost = entity.cost + edge.cost + costs.PARTICIPLE + (0.0 if edge.category == "done" else 0.3)
                particles = (Item(e.end, None, e.cost) for e in self.lattice.get(edge.end, "particle"))
                for end in [Item(edge.end, None, 0.0), *particles]:
                    clause = Clause(edge.value, entity.value, span=(at, end.end))
                    more = 1.0 * (act is Act.CARRY) + end.cost
                    found.append(Item(end.end, clause, cost + more, entity.skipped | gap.skipped))
                    if act in PLACED:
                        found += self._placed_at(edge.value, entity._replace(cost=cost), at, end.end, 0.0)
        return found

    def places(self, start: int) -> list[Item]:
        """Return the places that begin at a token: one relation, or several joined."""
        if start not in self._placed:
            layer = [_as_place(item) for item in self.chart.relations(start) if says_where(item.value)]
            found = layer
            for _ in range(MOST_PLACES - 1):
                likely = sorted(layer, key=lambda item: item.cost)[:MOST_JOINED]
                layer = cheapest([more for item in likely for more in self._joined(item)], 6)
                found = found + layer
            self._placed[start] = cheapest(found, 12)
        return self._placed[start]

    def _joined(self, item: Item) -> list[Item]:
        found = []
        at, cost = item.end, costs.PLACE_TWICE
        if self.lattice.text(at) in ("and", ","):
            at, cost = at + 1, 0.3
        for more in sorted(self.chart.relations(at), key=lambda more: more.cost)[:MOST_JOINED]:
            if says_where(more.value) and _way(more.value) not in map(_way, item.value):
                total = item.cost + cost + more.cost
                found.append(Item(more.end, (*item.value, more.value), total, item.skipped | more.skipped))
        return found


# only for a device that is named
_LIGHT = ("do", "doing", "does", "did", "done", "work", "works", "working", "use", "start")
_ASKING = {"is", "are", "was", "were", "has", "had", "did"}  # before a subject: "was the drawer opened"
_OBLIGED = frozenset({"should", "must", "shall", "goes", "belongs", "ought", "needs", "has"})
_DEVICES = (*DEVICES, "device")
_GRIPS = (Act.TAKE, Act.HOLD, Act.GIVE, Act.TOUCH)
_WITH_PARTICLE = ("take", "put", "push", "pull")  # what a particle alone may stand for: "in", "out", "up"
CARRYING = next(name for name, verb in KNOWN.items() if verb.act is Act.CARRY and "put {" in " ".join(verb.templates))
BUILDING = next(name for name, verb in KNOWN.items() if verb.act is Act.BUILD)


def is_several(entity: Entity) -> bool:
    """Return whether a phrase means several things, one after the other."""
    return entity.kind == "list" or entity.every or entity.plural or (entity.number or 1) > 1


def _placed_in_part(entity: Entity) -> bool:
    """Return whether another than the last thing of a list has a place, as if each had one: "X on Y, Z on W"."""
    return entity.kind == "list" and any(part.relations for part in entity.parts[:-1])


def _way(place: RelationPhrase) -> str:
    """Return the kind of a place, of which a clause has one: a relation or a direction."""
    return f"direction {place.value}" if place.name == "direction" else place.name


def _as_place(item: Item) -> Item:
    far = item.value.name in ("nearest", "farthest")
    return item._replace(value=(item.value,), cost=item.cost + costs.NEAREST_PLACE * far)
