"""Plans of a reading in a world: steps with their things and places, each checked in the world that the others leave.

Steps that people imply are put in: a drawer is opened before something goes in, what is held is put down first.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import pairwise

from language import costs
from language.chart import is_mutual
from language.meanings import Clause, Entity, Gesture, Reading, RelationPhrase
from language.referents import color_fits
from language.revising import only_verb, unfit
from language.several import Several
from language.spots import a_name, is_elsewhere, pinned
from language.steps import (
    BOXES,
    CARRY,
    KEPT,
    LOOSE,
    ON_TABLE,
    Draft,
    allows,
    different,
    finished,
    unsaid,
)
from language.verbs import DEVICE_VERBS, KNOWN, Act, bringing, doing
from language.world import WorldModel

# Effort: phrases that are weighed and steps that are tried for one sentence, of about 0.03 ms each.
ENOUGH_EFFORT, ENOUGH_ON_BOARD = 350, 700  # after this, no further readings are weighed if one can be carried out


class Planner(Several):
    """Plans readings in one world."""

    @property
    def acts(self) -> frozenset[Act]:
        """What can mean something in this world."""
        world, found = self.world, set(Act)
        if not world.devices:
            found -= {Act.OPERATE} if world.cells else set()
        if world.cells:
            found -= {Act.OPEN, Act.SHUT, Act.EMPTY, Act.STORE, Act.TIDY, Act.NEVER}
        return frozenset(found)

    def plans(self, reading: Reading) -> list[Draft]:
        """Return the plans of a reading, the cheapest first; those that fail come last and say why."""
        steps = reading.steps
        if reading.condition is not None:
            refs = self.resolver(self.world, self.it).resolve(reading.condition)
            if refs:
                self.it = refs[0].things
            else:
                steps = reading.otherwise or (Clause(doing(Act.CARRY), negated=True, span=reading.condition.span),)
        steps = tuple(only_verb(clause, self.world.only) for clause in steps) if self.world.only else steps
        found = self._sequence(
            _without_stops(_back_once(steps)) * reading.times, last=True, arbitrary=reading.arbitrary
        )
        if len(steps) > 1 and all("is full" in each.failure for each in found):
            found = self._made_room(steps, reading.arbitrary) or found
        forbidden = [clause for clause in steps if clause.negated and clause.act is not None]
        return [self._allowed(self._moving(finished(each)), forbidden) for each in found]

    def _moving(self, plan: Draft) -> Draft:
        """Return the plan, or that several things are there already: no step of it moves one."""
        carried = [step for step in plan.steps if step.carries]
        rest = any(not (step.carries or step.takes) for step in plan.steps)
        if plan.failure or rest or len({step.object for step in carried}) < 2 or self.world.cells:
            return plan
        moved = any(is_elsewhere(plan.world, self.world, step.object, 0.1) for step in carried)
        return plan if moved else replace(plan, failure="they are there already", reason="already", steps=())

    def _made_room(self, steps: tuple[Clause, ...], arbitrary: bool) -> list[Draft]:
        """Return the plans of clauses that first put on the table what fills a container and goes elsewhere later."""
        moved = [clause for clause in steps if clause.entity is not None and clause.act in LOOSE]
        named = [self._refs(Draft(self.world), clause, clause.entity) for clause in moved if clause.entity is not None]
        inside = [ref.things[-1] for refs in named for ref in refs[:1] if ref.things]
        for index in (each for each in inside if self.world.inside.get(each) in self.world.containers):
            out = Clause(CARRY, pinned(index), ON_TABLE)
            found = [each for each in self._sequence((out, *steps), True, arbitrary) if not each.failure]
            if found:
                note = f"I put {a_name(self.world, index)} on the table first"
                return [replace(each, notes=(*each.notes, note), cost=each.cost - costs.MOVED_TWICE) for each in found]
        return []

    def _sequence(self, steps: tuple[Clause, ...], last: bool, arbitrary: bool = False) -> list[Draft]:
        """Return the plans of clauses, which readings share. last: whether no clause follows."""
        if not steps:
            return [Draft(self.world, it=self.it, mentioned=self.mentioned, box=self.box, arbitrary=arbitrary)]
        key = (steps, last, self.it, arbitrary)
        if key not in self._sequences:
            clause = steps[-1]
            thing = clause.entity is not None and clause.entity.noun not in DEVICE_VERBS.values()
            if clause.act is Act.CARRY and thing and not clause.places and not last:
                clause = replace(clause, verb=bringing("up"))  # "move the cube and put it there"
            before = self._sequence(steps[:-1], False, arbitrary)
            layer = [_marked(plan, d, clause) for plan in before for d in self._either(plan, clause, last)]
            layer.sort(key=lambda plan: (bool(plan.failure), plan.cost))
            self._sequences[key] = different(layer)[:KEPT]
        return self._sequences[key]

    def judge(self, entity: Entity) -> float:
        """Return the cost of what a phrase denotes in the first world; for the chart."""
        self._spend()
        if entity.kind in ("it", "robot", "person", "board", "cell", "gap", "side", "center", "edge", "list", "mutual"):
            return 0.0
        if self.world.held is not None or entity.other or isinstance(entity.pointed, int):
            return 0.0
        beside = [each for each in entity.relations if each.name in ("left", "right", "front", "behind", "near")]
        if entity.span[0] > 3 and any(anchor.kind == "it" for each in beside for anchor in each.anchors):
            return 0.0  # the clauses before tell what "it" is
        refs = self.resolver(self.world, self.it).resolve(entity)
        return refs[0].cost if refs else costs.EMPTY

    def _either(self, plan: Draft, clause: Clause, last: bool) -> Iterable[Draft]:
        """Return the plans with one more clause; of "the drawer or the fridge" with the first that can be done."""
        entity = clause.entity
        if entity is None or entity.kind != "list" or not entity.any or clause.negated:
            return self._after(plan, clause, last)
        found = [list(self._after(plan, replace(clause, entity=part), last)) for part in entity.parts]
        return next((drafts for drafts in found if any(not each.failure for each in drafts)), found[0])

    def _after(self, plan: Draft, clause: Clause, last: bool) -> Iterator[Draft]:
        """Yield the plans with one more clause."""
        act = clause.act
        if plan.topic is not None and act is not None and (clause.entity is None or clause.entity.kind == "it"):
            topic = plan.topic
            plan, clause = replace(plan, topic=None), replace(clause, entity=topic.entity)
        if act is Act.CARRY and clause.entity is not None and clause.entity.kind == "robot" and not plan.world.cells:
            near = next((anchor for p in clause.places if p.name != "near" for anchor in p.anchors), None)
            if near is not None:  # "move the gripper to"
                clause = Clause(doing(Act.TOUCH), near, span=clause.span)
            act = clause.act
        if act is Act.EMPTY and clause.entity is not None and clause.entity.kind == "robot":  # "empty your gripper"
            clause, act = Clause(doing(Act.LOWER), span=clause.span), Act.LOWER
        if plan.topic is not None and act is not None and self._repeats(plan, clause):  # "the drawer: open the drawer"
            plan = replace(plan, topic=None)
        if plan.failure or (act is Act.OPERATE and self._names_it(plan, clause)):  # "the red wheel, turn it"
            yield plan
        elif (other := unfit(plan.world, clause)) and not clause.negated:
            yield replace(plan, failure=other, reason="impossible")
        elif clause.negated:
            refs = self._refs(plan, clause, clause.entity) if clause.entity is not None and act in BOXES else []
            yield plan if not refs else replace(plan, box=refs[0].things[-1], it=refs[0].things[-1:])
        elif act is None and (touch := _touched_next(plan.last, clause)) is not None:
            yield from self._after(plan, touch, last)
        elif act is None:
            yield from self._fragment(plan, clause, last)
        elif any(is_mutual(place) for place in clause.places):
            yield from self._mutual(plan, clause)
        elif plan.topic is not None and clause.entity is not None and act is not Act.SWAP and not _spoken(clause):
            yield replace(unsaid(plan, plan.topic), cost=plan.cost + 1.0)
        elif act in (Act.NEVER, Act.TIDY):
            yield from self._undoable(plan, clause)
        elif act is Act.SWAP:
            yield self._swap(plan, clause)
        elif act in (Act.BUILD, Act.GATHER):
            yield self._build(plan, clause)
        elif self._means_several(plan, clause):
            yield self._each(plan, clause)
        elif (moved := self._tower_moved(plan, clause)) is not None:
            yield moved
        else:
            for mover in self._movers(plan, clause):
                done = [mover] if mover.failure or mover.mover is None else self._act(mover, clause)
                yield from (self._spoken(each, mover, clause) if mover.mover is not None else each for each in done)
            if clause.entity is not None and clause.entity.is_bare_plural:
                yield from self._all(plan, clause, clause.entity)

    def _spoken(self, plan: Draft, moved: Draft, clause: Clause) -> Draft:
        """Return the plan with what "it" and "in there" mean after a clause. moved: before it, with its mover."""
        mover = moved.mover
        assert mover is not None
        done = plan.steps[min(len(moved.steps), len(plan.steps) - 1) :]
        boxes = [each for step in done for each in (step.object, step.goal) if each in self.world.containers]
        beside = [anchor for each in getattr(clause.entity, "relations", ()) for anchor in each.anchors if anchor.noun]
        if not boxes and plan.box is None and beside:  # "take the one nearest to the drawer and drop it in"
            named = self.resolver(moved.world, moved.it).resolve(beside[-1])
            boxes = [i for ref in named[:1] for i in ref.things if i in self.world.containers]
        box = mover if mover in self.world.containers else boxes[-1] if boxes else plan.box
        return replace(plan, it=(mover,), box=box, topic=None)

    def _means_several(self, plan: Draft, clause: Clause) -> bool:
        entity = clause.entity
        if entity is None:
            return False
        if any(place.name == "order" for place in clause.places):
            return True
        if entity.kind == "it":
            held = plan.world.held is not None and clause.act in LOOSE
            last = self.recent[:2] if clause.act in (Act.CARRY, Act.TOUCH, Act.GATHER) else ()
            two = len(plan.it) > 1 or sum(allows(plan.world, clause.act, i) for i in last) > 1
            return entity.plural and (two or entity.every or clause.act in BOXES) and not held
        whole = clause.act is Act.UNSTACK and entity.kind == "stack"
        stored = clause.act is Act.STORE and entity.plural  # what does not fit is said
        return whole or stored or entity.kind == "list" or entity.every or (entity.number or 1) > 1

    # ---- Clauses without a verb, and such that nobody can carry out

    def _names_it(self, plan: Draft, clause: Clause) -> bool:
        """Whether the words before a clause only named what it operates, which is done already."""
        last, spoken = plan.last, clause.entity is not None and clause.entity.kind == "it"
        operated = bool(plan.steps) and plan.steps[-1].act is Act.OPERATE
        named = operated and last is not None and last.act is None and last.entity is not None
        return named and (spoken or self._repeats(plan, clause))

    def _repeats(self, plan: Draft, clause: Clause) -> bool:
        """Whether a clause names as its object what the words before it only named."""
        if clause.entity is None or clause.entity.kind != "thing" or plan.world.cells:
            return False
        refs = self._refs(plan, clause, clause.entity)
        return len(refs) == 1 and len(plan.it) == 1 and refs[0].things[-1:] == plan.it

    def _fragment(self, plan: Draft, clause: Clause, last: bool) -> Iterator[Draft]:
        """Yield what a clause without a verb adds: a topic for the next one, or the object or place of the former."""
        entity, before = clause.entity, plan.last
        if entity is None:
            if before is not None and before.act is not None and plan.steps and before.entity is not None:
                start = self._sequence_start(plan)
                places = (*before.places, *clause.places)
                cost = 0.3 + costs.TAKEN_SOMEWHERE * (before.act in (Act.TAKE, Act.HOLD) and not self.world.cells)
                yield from (
                    replace(d, cost=d.cost + cost) for d in self._after(start, replace(before, places=places), last)
                )
            elif plan.topic is not None:
                put = Clause(CARRY, plan.topic.entity, clause.places, span=clause.span)
                yield from self._after(replace(plan, topic=None), put, last)
            elif plan.world.held is not None and not plan.world.cells:  # "into the drawer please"
                held = replace(pinned(plan.world.held), span=clause.span)
                yield from self._after(plan, Clause(CARRY, held, clause.places, span=clause.span), last)
            else:
                yield replace(plan, failure="that says where, but not what", reason="what", entity=None)
            return
        if plan.topic is not None and (place := self._as_place(plan, entity)) is not None:
            put = Clause(CARRY, plan.topic.entity, (place,), span=clause.span)
            yield from self._after(replace(plan, topic=None), put, last)
            return
        refs = self._refs(plan, clause, entity)
        things = [ref.things[-1] for ref in refs if ref.things]
        devices = bool(things) and all(i in plan.world.devices for i in things)
        carried = before is not None and before.act is Act.CARRY and not entity.noun  # "and the cyan one far right"
        if last and entity.kind == "thing" and self._is_done(plan, before, things):
            yield plan  # "open the drawer, the blue one"
        elif devices and not carried and (plan.steps or not last):  # "first the lever, then the wheel"
            yield from self._after(plan, replace(clause, verb=next(iter(DEVICE_VERBS))), last)
        elif entity.kind in ("it", "person") or not things:
            yield replace(
                plan,
                failure="nothing fits" if entity.kind == "thing" else "",
                reason="nothing" if entity.kind == "thing" else "what",
                entity=entity,
                topic=clause,
            )
        elif before is not None and before.act is not None and plan.steps and last and before.act not in BOXES:
            yield from self._same_again(plan, clause, before)
        else:
            many = entity.plural or entity.kind == "list" or (entity.number or 1) > 1
            it = tuple(dict.fromkeys(things)) if many else tuple(things[:1])
            cost = refs[0].cost if last else 0.0  # what is done with it counts how well it fits
            yield replace(plan, topic=clause, it=it, mentioned=it, cost=plan.cost + cost)

    def _is_done(self, plan: Draft, before: Clause | None, things: list[int]) -> bool:
        """Whether the clause before named one thing, which is done with and may be one of these."""
        done = {step.object for step in plan.steps}
        if plan.world.cells or before is None or before.entity is None or not done or not done <= set(things[:2]):
            return False
        return len(self._refs(plan, before, before.entity)) == 1

    def _as_place(self, plan: Draft, entity: Entity) -> RelationPhrase | None:
        """Return what is named after a thing as its place: "blue cube: left edge", "blue cube, drawer"."""
        if entity.kind in ("corner", "edge", "side", "center", "board", "person"):
            return RelationPhrase("at", (entity,), span=entity.span)
        return RelationPhrase("in", (entity,), span=entity.span) if self._is_box(plan, entity) else None

    def _same_again(self, plan: Draft, clause: Clause, before: Clause) -> Iterator[Draft]:
        """Yield the plan in which a fragment says more about the object of the clause before, or repeats its verb."""
        start, new, old = self._sequence_start(plan), clause.entity, before.entity
        assert new is not None
        meant = [ref.things[-1] for ref in self._refs(plan, before, old) if ref.things] if old is not None else []
        both = {*meant} & {ref.things[-1] for ref in self._refs(plan, before, new) if ref.things}
        if old is not None and len(plan.steps) == 1 and len(meant) > 1 and both:  # "the ball, the green one"
            new, cost = replace(new, noun=new.noun or old.noun), 0.2
        elif old is None or old.kind == "it" or old.other or (old.noun is None and not self._tells_more(old)):
            cost = 0.5
        else:
            bare = not (new.noun or new.colors or new.other or new.parts or self.world.cells)  # "..., the right one"
            start, cost = plan, 0.6 + costs.ANOTHER_BARE * bare
        again = self._after(start, replace(before, entity=new), True)
        yield from (replace(draft, cost=draft.cost + cost) for draft in again)

    def _tells_more(self, entity: Entity) -> bool:
        """Whether a phrase without a noun tells a thing of a table by its colour or where it is."""
        return not self.world.cells and bool(entity.colors or entity.relations)

    def _sequence_start(self, plan: Draft) -> Draft:
        """Return a plan without steps, in which what was spoken of is known."""
        return Draft(self.world, it=self.it, mentioned=self.mentioned, box=plan.box, arbitrary=plan.arbitrary)

    def _undoable(self, plan: Draft, clause: Clause) -> Iterator[Draft]:
        verb = KNOWN[clause.verb or ""]
        if verb.act is Act.TIDY:
            yield replace(plan, failure="what shall go where", reason="where", entity=clause.entity)
        elif (
            verb.effect and plan.world.verbs is None and clause.entity is not None and clause.places
        ):  # a task that can
            for mover in self._movers(plan, clause):
                yield from [mover] if mover.failure or mover.mover is None else self._act(mover, clause)
        else:
            yield replace(plan, failure="never", reason="never", entity=Entity(span=clause.span))


def is_like(world: WorldModel, index: int, entity: Entity) -> bool:
    """Whether a thing has the colours and the kind of a phrase, wherever it is."""
    kind = entity.noun in (None, "thing", world.things[index].kind)
    return kind and all(color_fits(world, index, color) for color in entity.colors)


def empty_box(reading: Reading, plan: Draft) -> int | None:
    """Return the container whose content shall be taken though it has none: "give me the cube in the fridge"."""
    clause, box = reading.steps[0], next((step.goal for step in plan.steps if step.carries), None)
    entity = clause.entity
    if entity is None or entity.kind != "thing" or clause.act not in (Act.TAKE, Act.GIVE, Act.REMOVE):
        return None
    chosen = entity.colors or entity.relations or entity.superlative or entity.any or entity.every or entity.pointed
    if chosen or [place.name for place in clause.places] != ["in"] or box not in plan.world.containers:
        return None
    return None if len(plan.world.contents(box)) > 1 else box


def _marked(before: Draft, plan: Draft, clause: Clause) -> Draft:
    """Return the plan after a clause; its last step keeps the instruction that it was read from."""
    if (clause.instruction is not None or clause.several) and len(plan.steps) > len(before.steps):
        last = replace(plan.steps[-1], instruction=clause.instruction, several=clause.several)
        plan = replace(plan, steps=(*plan.steps[:-1], last))
    return replace(plan, last=clause)


def _back_once(steps: tuple[Clause, ...]) -> tuple[Clause, ...]:
    """Return the clauses without one that says again that it goes back: "it belongs where it was, so put it back"."""

    def back(clause: Clause) -> bool:
        names = {place.name for place in clause.places}
        return "home" in names and names <= {"home", "here"} and not clause.negated

    twice = [at for at, (one, other) in enumerate(pairwise(steps), 1) if back(one) and back(other)]
    return tuple(step for at, step in enumerate(steps) if at not in twice or (step.entity and step.entity.kind != "it"))


def _without_stops(steps: tuple[Clause, ...]) -> tuple[Clause, ...]:
    """Return the clauses without putting down what the next one brings elsewhere: "take it down and give it to me"."""
    kept = list(steps)
    for at, (one, other) in enumerate(pairwise(steps)):
        if one.entity is None or other.entity is None:
            continue
        shown = isinstance(one.entity.pointed, Gesture) and other.entity.pointed == one.entity.pointed
        goes_on = (shown or other.entity.kind == "it") and other.act in (Act.GIVE, Act.CARRY, Act.STORE)
        down = all(place.name == "direction" and place.value == "down" for place in one.places)
        if goes_on and down and one.act in (Act.TAKE, Act.CARRY, Act.UNSTACK):
            kept[at] = replace(one, verb=bringing("up"), places=(), instruction=None)
    return tuple(kept)


def _spoken(clause: Clause) -> bool:
    """Whether a clause says "it" of what was named before: as its object, or as its place, "put the cube in it"."""
    named = any(a.kind == "it" for place in clause.places for a in place.anchors)
    there = any(place.name in ("here", "into") and not place.anchors for place in clause.places)
    return named or there or (clause.entity is not None and clause.entity.kind == "it")


def _touched_next(before: Clause | None, clause: Clause) -> Clause | None:
    """Return what is touched after another thing: "point at the red one and then at the blue one"."""
    named = [anchor for place in clause.places[:1] if place.name in ("at", "to") for anchor in place.anchors]
    touches = before is not None and before.act is Act.TOUCH and clause.entity is None
    one = [anchor.kind for anchor in named] == ["thing"]
    return replace(before, entity=named[0], places=()) if before is not None and touches and one else None
