"""Readings of whole sentences: steps with their objects and places, conditions and fragments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from language.commands import costs
from language.commands.chart import Chart, Judge
from language.commands.gestures import bound, needs_gesture, pointing_words
from language.commands.items import Item
from language.commands.lattice import Lattice
from language.commands.meanings import Entity, Gesture, Reading, Relation, Step

MOST_PLACES = 3  # relations that are joined to one place
MOST_JOINED = 16  # of the places, and of the relations after each, that are joined
MOST_STEPS = 5
MOST_COST = 16.0  # readings that cost more leave out most of the sentence
KEPT_STEPS, KEPT_READINGS = 16, 80  # of the same span; of the sentence
_MOVING = ("move", "push", "drop", "give", "remove", "take")


def readings(sentence: str, judge: Judge | None = None, made: Sequence[Gesture] = ()) -> tuple[list[Reading], Lattice]:
    """Returns the readings of a sentence, the cheapest first, and its lattice.

    Args:
        sentence: as a person writes it.
        judge: gives the costs of phrases in the scene; None: there is no scene.
        made: the gestures that accompany the sentence, in order.

    Raises:
        NotUnderstood: the sentence is too long.
    """
    lattice = Lattice(sentence, len(made))
    found = _Sentences(Chart(lattice, judge)).likeliest()
    return (_with_gestures(found, made, judge) if made else found), lattice


def _with_gestures(found: list[Reading], made: Sequence[Gesture], judge: Judge | None) -> list[Reading]:
    """Returns the readings with their gestures, whose phrases can only now be compared with the scene."""
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
        self._steps: dict[int, list[Item]] = {}
        self._placed: dict[int, list[Item]] = {}

    def likeliest(self) -> list[Reading]:
        """Returns the readings of the least cost."""
        rests = self._rests()
        found: list[tuple[Item, bool]] = []
        openings = [(0, False), *((edge.end, True) for edge in self.lattice.get(0, "not_meant"))]
        for start, rejects in openings:
            for item in [*self._sequences(start), *self._conditions(start)]:
                rest = rests[item.end]
                whole = item._replace(cost=item.cost + rest.cost, skipped=item.skipped | rest.skipped)
                if whole.cost <= MOST_COST:
                    found.append((whole, rejects))
        found.sort(key=lambda each: each[0].cost)
        return [self._reading(item, rejects) for item, rejects in found[:KEPT_READINGS]]

    def _rests(self) -> list[Item]:
        """Returns, for each token, the cost of leaving out the rest of the sentence from there on."""
        rests = [Item(len(self.lattice), None, 0.0)]
        for index in range(len(self.lattice) - 1, -1, -1):
            join = "join" in self.lattice.edges[index] and self.lattice.tokens[index].text in (".", ";", "and", "then")
            cost = 0.0 if join else self.chart.gaps.skip_cost(index)
            rest = rests[-1]
            rests.append(Item(index, None, rest.cost + cost, rest.skipped | (1 << index if cost else 0)))
        return rests[::-1]

    def _reading(self, item: Item, rejects: bool) -> Reading:
        reading = item.value if isinstance(item.value, Reading) else Reading(item.value)
        words = tuple(i for i in range(len(self.lattice)) if item.skipped >> i & 1)
        return replace(reading, cost=item.cost, rejects=rejects, unused=words)

    def _conditions(self, start: int) -> list[Item]:
        """Returns "if there is X, steps, otherwise steps"."""
        found = []
        for item in self.chart.gaps.at(start):
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
            for gap in self.chart.gaps.at(steps.end):
                for word in self.lattice.get(gap.end, "else"):
                    for other in self._sequences(word.end):
                        full = replace(plain, otherwise=other.value)
                        total = cost + gap.cost + other.cost
                        found.append(Item(other.end, full, total, skipped | gap.skipped | other.skipped))
        return found

    def _sequences(self, start: int) -> list[Item]:
        """Returns one or more steps, joined."""
        layer = [item._replace(value=(item.value,)) for item in self.steps(start)]
        found = layer
        for _ in range(MOST_STEPS - 1):
            longer = []
            for item in layer:
                for at, cost in self._joins(item.end):
                    for step in self.steps(at):
                        total = item.cost + cost + step.cost
                        longer.append(Item(step.end, (*item.value, step.value), total, item.skipped | step.skipped))
            layer = _cheapest(longer, KEPT_STEPS)
            found = found + layer
            if not layer:
                break
        return found

    def _joins(self, end: int) -> list[tuple[int, float]]:
        """Returns where a further step may begin, with its cost."""
        found = {}
        at = end
        while at < len(self.lattice) and self.lattice.tokens[at].text in (",", "-", "please"):
            at += 1
        for edge in self.lattice.get(at, "join"):
            further = [again.end for again in self.lattice.get(edge.end, "join")]
            found.update(dict.fromkeys([edge.end, *further], 0.0))
        if "verb" in (self.lattice.edges[at] if at < len(self.lattice) else {}):
            found.setdefault(at, costs.STEP_WITHOUT_JOIN if at == end else 0.3)
        if at > end:
            found.setdefault(at, costs.STEP_WITHOUT_JOIN)
        return list(found.items())

    def steps(self, start: int) -> list[Item]:
        """Returns the steps that begin at a token."""
        if start not in self._steps:
            found: list[Item] = []
            for gap in self.chart.gaps.at(start):
                items = _cheapest(self._step(gap.end), KEPT_STEPS)
                found += [Item(i.end, i.value, gap.cost + i.cost, gap.skipped | i.skipped) for i in items]
            self._steps[start] = _cheapest(found, KEPT_STEPS)
        return self._steps[start]

    def _step(self, at: int) -> list[Item]:
        found = [
            Item(edge.end, Step(edge.value, span=(at, edge.end)), edge.cost) for edge in self.lattice.get(at, "control")
        ]
        for edge in self.lattice.get(at, "verb"):
            found += [
                Item(i.end, i.value, i.cost + edge.cost, i.skipped) for i in self._with_verb(edge.value, edge.end, at)
            ]
        for edge in self.lattice.get(at, "never"):
            found += [
                Item(i.end, Step("nothing", i.value.entity, span=(at, i.end)), i.cost, i.skipped)
                for i in self.steps(edge.end)
                if i.value.action in ("take", "move", "reach", "push", "drop", "press", "turn", "remove", "switch")
            ]
        return found + self._without_verb(at)

    def _with_verb(self, action: str, at: int, start: int) -> list[Item]:
        found = [] if action != "drop" else [Item(at, Step("drop", span=(start, at)), 0.0)]
        starts = [Item(at, None, 0.0)] + [Item(e.end, None, e.cost) for e in self.lattice.get(at, "particle")]
        for begin in starts:
            for entity in self.chart.entities(begin.end):
                found += self._completed(action, entity, start)
            if action in _MOVING:
                found += self._inverted(action, begin, start)
        return found

    def _inverted(self, action: str, begin: Item, start: int) -> list[Item]:
        """Returns the steps whose place precedes the object or is without one: "and place on the red block"."""
        found = []
        for place in self.places(begin.end):
            step = Step(action, None, place.value, (start, place.end))
            found.append(Item(place.end, step, place.cost + costs.NO_OBJECT, place.skipped))
            for entity in self.chart.entities(place.end):
                step = Step(action, entity.value, place.value, (start, entity.end))
                cost = place.cost + entity.cost + costs.INVERTED
                found.append(Item(entity.end, step, cost, place.skipped | entity.skipped))
        return found

    def _completed(self, action: str, entity: Item, start: int) -> list[Item]:
        """Returns the steps with this object, with and without a particle and a place."""
        found = []
        after = self.lattice.get(entity.end, "particle")
        for at, cost in [(entity.end, 0.0), *((edge.end, edge.cost) for edge in after)]:
            base = entity.cost + cost
            if action != "move":
                found.append(Item(at, Step(action, entity.value, (), (start, at)), base, entity.skipped))
            else:
                found.append(Item(at, Step(action, entity.value, (), (start, at)), base + 1.0, entity.skipped))
            if action in _MOVING:
                for place in self.places(at):
                    step = Step(action, entity.value, place.value, (start, place.end))
                    total = base + place.cost + costs.TAKEN_SOMEWHERE * (action == "take")
                    found.append(Item(place.end, step, total, entity.skipped | place.skipped))
        return found

    def _without_verb(self, at: int) -> list[Item]:
        found = []
        for entity in self.chart.entities(at):
            step = Step("fragment", entity.value, (), (at, entity.end))
            found.append(Item(entity.end, step, entity.cost + costs.NO_VERB, entity.skipped))
            for place in self.places(entity.end):
                step = Step("move", entity.value, place.value, (at, place.end))
                cost = entity.cost + place.cost + costs.NO_VERB_BUT_PLACE
                found.append(Item(place.end, step, cost, entity.skipped | place.skipped))
        for place in self.places(at):
            step = Step("fragment", None, place.value, (at, place.end))
            found.append(Item(place.end, step, place.cost + costs.NO_VERB, place.skipped))
        return found

    def places(self, start: int) -> list[Item]:
        """Returns the places that begin at a token: one relation, or several joined."""
        if start not in self._placed:
            layer = [_as_place(item) for item in self.chart.relations(start) if _says_where(item.value)]
            found = layer
            for _ in range(MOST_PLACES - 1):
                likely = sorted(layer, key=lambda item: item.cost)[:MOST_JOINED]
                layer = _cheapest([more for item in likely for more in self._joined(item)], 6)
                found = found + layer
            self._placed[start] = _cheapest(found, 12)
        return self._placed[start]

    def _joined(self, item: Item) -> list[Item]:
        found = []
        at, cost = item.end, costs.PLACE_TWICE
        if at < len(self.lattice) and self.lattice.tokens[at].text in ("and", ","):
            at, cost = at + 1, 0.3
        for more in sorted(self.chart.relations(at), key=lambda more: more.cost)[:MOST_JOINED]:
            if _says_where(more.value) and more.value.name not in {place.name for place in item.value}:
                total = item.cost + cost + more.cost
                found.append(Item(more.end, (*item.value, more.value), total, item.skipped | more.skipped))
        return found


def _as_place(item: Item) -> Item:
    far = item.value.name in ("nearest", "farthest")
    return item._replace(value=(item.value,), cost=item.cost + costs.NEAREST_PLACE * far)


def _says_where(relation: Relation) -> bool:
    return relation.name not in ("held", "bare", "not", "with", "of")


def _cheapest(items: list[Item], kept: int) -> list[Item]:
    """Returns the cheapest items of each span."""
    spans: dict[int, list[Item]] = {}
    for item in sorted(items, key=lambda item: item.cost):
        same = spans.setdefault(item.end, [])
        if len(same) < kept:
            same.append(item)
    return [item for same in spans.values() for item in same]


def entities_of(step: Step) -> list[Entity]:
    """Returns the phrases of a step."""
    return [*([step.entity] if step.entity else []), *(anchor for place in step.places for anchor in place.anchors)]
