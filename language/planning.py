"""Plans of a reading in a world: steps with their things and places, each checked in the world that the others leave.

Steps that people imply are put in: a drawer is opened before something goes in, what is held is put down first.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

from language import costs
from language.meanings import Clause, Entity, Gesture, Reading, RelationPhrase
from language.places import ONTO, _anywhere, _Wish, free_spot
from language.referents import Ref, color_fits
from language.revising import only_verb, unfit
from language.spots import Spot
from language.steps import (
    BOXES,
    CARRY,
    KEPT,
    LOOSE,
    ON_TABLE,
    Draft,
    Steps,
    allows,
    at_a_mark,
    beside,
    different,
    finished,
    obstacle,
    off_table,
    without_stops,
)
from language.verbs import DEVICE_VERBS, KNOWN, Act, bringing, doing
from language.world import WorldModel

# Effort: phrases that are weighed and steps that are tried for one sentence, of about 0.03 ms each.
ENOUGH_EFFORT, ENOUGH_ON_BOARD = 350, 700  # after this, no further readings are weighed if one can be carried out
GRIPS_ONE = "my gripper takes one thing at a time"


class Planner(Steps):
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
            refs = self.resolver(self.world, self.it, None).resolve(reading.condition)
            if refs:
                self.it = refs[0].things
            else:
                steps = reading.otherwise or (Clause(doing(Act.CARRY), negated=True, span=reading.condition.span),)
        steps = tuple(only_verb(clause, self.world.only) for clause in steps) if self.world.only else steps
        found = self._sequence(without_stops(steps) * reading.times, last=True, arbitrary=reading.arbitrary)
        forbidden = [clause for clause in steps if clause.negated and clause.act is not None]
        return [self._allowed(finished(each), forbidden) for each in found]

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
            layer = [_marked(plan, d, clause) for plan in before for d in self._after(plan, clause, last)]
            layer.sort(key=lambda plan: (bool(plan.failure), plan.cost))
            self._sequences[key] = different(layer)[:KEPT]
        return self._sequences[key]

    def judge(self, entity: Entity) -> float:
        """Return the cost of what a phrase denotes in the first world; for the chart."""
        self._spend()
        if entity.kind in ("it", "robot", "person", "board", "cell", "gap", "side", "center", "edge", "list"):
            return 0.0
        if self.world.held is not None or entity.other or isinstance(entity.pointed, int):
            return 0.0
        refs = self.resolver(self.world, self.it, None).resolve(entity)
        return refs[0].cost if refs else costs.EMPTY

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
        if plan.failure or (act is Act.OPERATE and _names_it(plan, clause)):  # "the red wheel, turn it"
            yield plan
        elif (other := unfit(plan.world, clause)) and not clause.negated:
            yield replace(plan, failure=other, reason="impossible")
        elif clause.negated:
            refs = self._refs(plan, clause, clause.entity) if clause.entity is not None and act in BOXES else []
            yield plan if not refs else replace(plan, box=refs[0].things[-1], it=refs[0].things[-1:])
        elif act is None:
            yield from self._fragment(plan, clause, last)
        elif (
            plan.topic is not None and clause.entity is not None and clause.entity.kind != "it" and act is not Act.SWAP
        ):
            yield replace(self._unsaid(plan), cost=plan.cost + 1.0)
        elif act in (Act.NEVER, Act.TIDY):
            yield from self._undoable(plan, clause)
        elif act is Act.SWAP:
            yield self._swap(plan, clause)
        elif act in (Act.BUILD, Act.GATHER):
            yield self._build(plan, clause)
        elif self._means_several(plan, clause):
            yield self._each(plan, clause)
        else:
            for mover in self._movers(plan, clause):
                done = [mover] if mover.failure or mover.mover is None else self._act(mover, clause)
                yield from (self._spoken(each, mover.mover) if mover.mover is not None else each for each in done)
            if clause.entity is not None and clause.entity.is_bare_plural:
                yield from self._all(plan, clause, clause.entity)

    def _spoken(self, plan: Draft, mover: int) -> Draft:
        """Return the plan with what "it" and "in there" mean after a clause."""
        boxes = [each for step in plan.steps[-1:] for each in (step.object, step.goal) if each in self.world.containers]
        box = mover if mover in self.world.containers else boxes[-1] if boxes else plan.box
        return replace(plan, it=(mover,), box=box, topic=None)

    def _means_several(self, plan: Draft, clause: Clause) -> bool:
        entity = clause.entity
        if entity is None:
            return False
        if entity.kind == "it":
            held = plan.world.held is not None and clause.act in LOOSE
            return entity.plural and (len(plan.it) > 1 or entity.every or clause.act in BOXES) and not held
        return entity.kind == "list" or entity.every or (entity.number or 1) > 1

    # ---- Clauses without a verb, and such that nobody can carry out

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
            else:
                yield replace(plan, failure="that says where, but not what", reason="what", entity=None)
            return
        regions = ("corner", "edge", "side", "center", "board", "person")
        if plan.topic is not None and entity.kind in regions:  # "blue cube: left edge"
            put = Clause(
                CARRY, plan.topic.entity, (RelationPhrase("at", (entity,), span=entity.span),), span=clause.span
            )
            yield from self._after(replace(plan, topic=None), put, last)
            return
        if plan.topic is not None and self._is_box(plan, entity):  # "blue cube, drawer"
            into = RelationPhrase("in", (entity,), span=entity.span)
            put = Clause(CARRY, plan.topic.entity, (into,), span=clause.span)
            yield from self._after(replace(plan, topic=None), put, last)
            return
        refs = self._refs(plan, clause, entity)
        things = [ref.things[-1] for ref in refs if ref.things]
        devices = bool(things) and all(i in plan.world.devices for i in things)
        if devices and (plan.steps or not last):  # "first the lever, then the wheel"
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
            it = tuple(dict.fromkeys(things)) if entity.plural or entity.kind == "list" else tuple(things[:1])
            yield replace(plan, topic=clause, it=it, mentioned=it, cost=plan.cost + refs[0].cost)

    def _same_again(self, plan: Draft, clause: Clause, before: Clause) -> Iterator[Draft]:
        """Yield the plan in which a fragment says more about the object of the clause before, or repeats its verb."""
        start, new = self._sequence_start(plan), clause.entity
        assert new is not None
        meant = (
            [ref.things[-1] for ref in self._refs(plan, before, before.entity) if ref.things] if before.entity else []
        )
        named = [ref.things[-1] for ref in self._refs(plan, before, new) if ref.things]
        if (
            len(plan.steps) == 1 and len(meant) > 1 and set(named) & set(meant) and before.entity is not None
        ):  # "the ball, the green one"
            closer = replace(new, noun=new.noun or before.entity.noun)
            yield from (replace(d, cost=d.cost + 0.2) for d in self._after(start, replace(before, entity=closer), True))
        elif (
            before.entity is None
            or before.entity.kind == "it"
            or before.entity.other
            or (
                before.entity.noun is None
                and (self.world.cells or not (before.entity.colors or before.entity.relations))
            )
        ):
            yield from (
                replace(d, cost=d.cost + 0.5) for d in self._after(start, replace(before, entity=clause.entity), True)
            )
        else:
            bare = not (new.noun or new.colors or new.other or new.parts or self.world.cells)  # "..., the right one"
            again, cost = replace(before, entity=clause.entity), 0.6 + costs.ANOTHER_BARE * bare
            yield from (replace(d, cost=d.cost + cost) for d in self._after(plan, again, True))

    def _sequence_start(self, plan: Draft) -> Draft:
        """Return the plan before its last clause, if it has only one; otherwise a plan without steps."""
        return Draft(self.world, it=self.it, mentioned=self.mentioned, box=plan.box, arbitrary=plan.arbitrary)

    def _unsaid(self, plan: Draft) -> Draft:
        assert plan.topic is not None
        return replace(plan, failure="it is not said what to do with it", reason="what", entity=plan.topic.entity)

    def _undoable(self, plan: Draft, clause: Clause) -> Iterator[Draft]:
        verb = KNOWN[clause.verb or ""]
        if verb.act is Act.TIDY:
            yield replace(plan, failure="what shall go where", reason="where", entity=clause.entity)
        elif (
            verb.effect and plan.world.verbs is None and clause.entity is not None and clause.places
        ):  # a task that can
            for mover in self._movers(plan, clause):
                yield from (
                    [mover]
                    if mover.failure or mover.mover is None
                    else self._act(mover, replace(clause, verb=clause.verb))
                )
        else:
            yield replace(plan, failure="never", reason="never", entity=Entity(span=clause.span))

    # ---- Several things

    def _all(self, plan: Draft, clause: Clause, entity: Entity) -> Iterator[Draft]:
        """Yield the plan that does the clause for all things of a plural, if several fit it."""
        done = self._each(plan, replace(clause, entity=replace(entity, every=True)))
        if not done.failure and len(done.it) > 1:
            one = min((ref.cost for ref in self._refs(plan, clause, entity) if ref.kind == "thing"), default=0.0)
            yield replace(done, cost=plan.cost + one + costs.ALL_OF_PLURAL)

    def _each(self, plan: Draft, clause: Clause) -> Draft:
        """Return the plan that does the clause for every thing of the phrase, one after the other."""
        entity = clause.entity
        assert entity is not None
        things = self._several(plan, clause, entity)
        if isinstance(things, Draft):
            return things
        act, before = clause.act, len(plan.steps)
        if act in (Act.TAKE, Act.HOLD) and not clause.places and len(things) > 1 and plan.world.held is None:
            stacked = [i for i in things if plan.world.below[i] is not None]
            if not plan.world.cells and act is Act.TAKE and any(i in plan.world.inside for i in things):
                clause = replace(clause, verb=doing(Act.REMOVE))
            elif not stacked:
                return replace(plan, failure=GRIPS_ONE, reason="impossible", entity=entity)
        if act is Act.GIVE and len(things) > 1 and plan.world.hand is not None:
            return replace(plan, failure="your hand holds one thing at a time", reason="impossible", entity=entity)
        if act not in (*BOXES, Act.OPERATE, Act.TOUCH) and entity.kind != "list":
            things.sort(key=lambda i: -plan.world.things[i].bottom)
        things = off_table(plan.world, clause, things)
        for number, index in enumerate(things):
            part = beside(clause) if at_a_mark(plan) else clause
            if act in (Act.REMOVE, Act.UNSTACK) or clause.act is Act.REMOVE:
                part = replace(part, verb=CARRY, places=ON_TABLE) if len(things) > 1 and not part.places else part
            found = list(self._act(replace(plan, mover=index), part))
            good = [done for done in found if not done.failure]
            if not good:
                failed = found[0] if found else plan
                text = failed.failure or "there is no place for all of them"
                if "is full" in text and number:
                    text = f"{text.partition(' is full')[0]} holds one thing at a time"
                return replace(failed, failure=text, reason="impossible", entity=failed.entity or entity)
            plan = min(good, key=lambda done: done.cost)
            if (
                number == 0
                and plan.steps
                and any(each.name in ONTO for each in clause.places)
                and part.act is Act.CARRY
            ):
                first = plan.steps[-1]
                if (
                    first.goal is not None
                    and plan.world.is_loose(first.goal)
                    and not plan.world.cells
                    and len(things) > 1
                ):
                    return replace(plan, failure="only one thing stands on another", reason="impossible", entity=entity)
        box = next((i for i in things if i in plan.world.containers), plan.box)
        done = replace(plan, it=tuple(things), mentioned=tuple(things), box=box, topic=None)
        marked = (*done.steps[:before], *(replace(each, several=True) for each in done.steps[before:]))
        return replace(done, steps=marked)

    def _several(self, plan: Draft, clause: Clause, entity: Entity) -> list[int] | Draft:
        """Return the things of a phrase for several, or the plan that says why there are none."""
        world, act = plan.world, clause.act
        if entity.kind == "list":
            found = []
            for part in entity.parts:
                drafts = list(
                    self._movers(plan if part.kind == "it" else replace(plan, it=()), replace(clause, entity=part))
                )
                good = [each for each in drafts if not each.failure and each.mover is not None]
                if not good:
                    return drafts[0]
                best = min(each.cost for each in good)
                if sum(each.cost < best + costs.CLOSE for each in good) > 1 and not part.any:
                    movers = tuple(each.mover for each in good if each.mover is not None)
                    return replace(plan, failure="several", reason="several", entity=part, candidates=movers)
                found.append(min(good, key=lambda each: each.cost).mover)
            return [index for index in dict.fromkeys(found) if index is not None]
        if entity.kind == "it":
            return self._them(plan, act, entity)
        refs = self.resolver(world, plan.it, None, plan.mentioned, plan.box).resolve(entity)
        refs = [ref for ref in refs if ref.things and all(allows(world, act, i) for i in ref.things[-1:])] or refs
        alone = [ref for ref in refs if len(ref.things) == 1] if act in (Act.BUILD, Act.GATHER) else refs
        things = list(dict.fromkeys(i for ref in alone or refs for i in ref.things if ref.cost <= refs[0].cost + 0.5))
        things = [i for i in things if not world.things[i].target] or things  # "all cubes" moves the real ones
        if entity.every and entity.number and len(things) < entity.number and entity.noun is not None:  # "both cubes"
            return replace(plan, failure=f"{len(things)} things fit", reason="nothing", entity=entity)
        fresh = [i for i in things if not self._done(world, act, i)]
        things, wanted = (fresh or things) if act in (*BOXES, Act.OPERATE) else things, entity.number
        if not things or (wanted and len(things) < wanted and not entity.every):
            return replace(plan, failure=f"{len(things)} things fit", reason="nothing", entity=entity)
        if act is Act.UNSTACK:
            things = [i for i in things if world.below[i] is not None] or things
        if wanted and entity.every and len(things) > wanted and entity.noun is None and not entity.colors:  # "both"
            spoken = [i for i in things if i in (*plan.it, *plan.mentioned)]
            few = 0 < len(spoken) < wanted and act not in BOXES  # it asks which
            entity, things = replace(entity, every=not few), things if few else spoken or things
        if wanted and len(things) > wanted and not entity.every:
            if plan.arbitrary or entity.any:
                things.sort(key=lambda i: (bool(obstacle(world, (i,))), i in world.inside, world.things[i].x))
                return things[:wanted]
            return replace(
                plan, failure=f"{len(things)} things fit", reason="several", entity=entity, candidates=tuple(things)
            )
        return things

    def _them(self, plan: Draft, act: Act | None, entity: Entity) -> list[int]:
        """Return the things of "them"; "all of them" are all that there are where none were spoken of."""
        world, every = plan.world, entity.every and len(plan.it) < 2
        named = [i for i in (range(len(world.things)) if every else plan.it) if allows(world, act, i)]
        named = [i for i in named if not (every and world.things[i].target)]
        if len(named) < 2 and act not in BOXES and not plan.steps:
            named = [i for i in self.recent if allows(world, act, i)][:2] or named
        if act in BOXES and len(named) < 2:
            named = [i for i in world.containers if not self._done(world, act, i)]
        return named or [i for i in self._unnamed(plan, act) if not self._done(world, act, i)]

    # ---- One thing

    def _movers(self, plan: Draft, clause: Clause) -> Iterator[Draft]:
        """Yield the plan with each thing that the clause may concern as its mover."""
        entity, held, act, world = clause.entity, plan.world.held, clause.act, plan.world
        asks_held = act in (Act.CARRY, Act.LOWER, Act.GIVE, Act.REMOVE, Act.STORE, Act.NEVER)
        if held is not None and asks_held and self._fits_held(plan, entity):
            cost = self._held_cost(world, held, entity)
            yield replace(plan, mover=held, cost=plan.cost + cost, mentioned=(held,), entity=entity)
            return
        if entity is None or entity.kind == "it":
            yield from self._pronoun(plan, clause)
            return
        refs = self._refs(plan, clause, entity)
        if not refs:
            yield replace(plan, failure="nothing fits", reason="nothing", entity=entity)
        for ref in refs:
            if not ref.things and ref.kind == "person" and world.hand is not None and act is Act.TOUCH:
                ref = ref._replace(things=(world.hand,))
            if not ref.things:
                yield replace(plan, failure="that is a place and no thing", reason="place", entity=entity)
                continue
            index, cost = ref.things[-1], plan.cost + ref.cost
            arbitrary = plan.arbitrary or entity.any
            yield replace(plan, mover=index, cost=cost, entity=entity, mentioned=(index,), arbitrary=arbitrary)

    def _pronoun(self, plan: Draft, clause: Clause) -> Iterator[Draft]:
        """Yield the plan with what "it" may mean, or what is meant where nothing is named."""
        act, world = clause.act, plan.world
        named = [i for i in plan.it if allows(world, act, i)]
        if act in BOXES and plan.box is not None and not named:
            named = [plan.box]
        if act in BOXES and not named and plan.it and plan.it[0] in world.inside:
            named = [world.inside[plan.it[0]]]
        if not named:
            named = self._unnamed(plan, act)
            if clause.entity is None or act in (*BOXES, Act.OPERATE):
                named = [i for i in named if not self._done(world, act, i)] or named
        if not named or (len(named) > 1 and act not in (*BOXES, Act.OPERATE, Act.UNSTACK)):
            if plan.it and not world.cells and not plan.failure and act is not None and plan.it[0] < len(world.things):
                yield replace(plan, mover=plan.it[0], entity=clause.entity)
                return
            named_by = clause.entity or Entity(span=clause.span)
            why = "nothing was mentioned that this may mean; name the thing, or point at it"
            yield replace(plan, failure=why, reason="dialogue", entity=named_by)
        for index in named if len(named) > 1 and plan.it[:1] != tuple(named[:1]) else named[:1]:
            yield replace(plan, mover=index, mentioned=(index,), entity=clause.entity)

    def _unnamed(self, plan: Draft, act: Act | None) -> list[int]:
        """Return what a verb without an object may concern in this world."""
        world = plan.world
        if act in BOXES:
            return list(world.containers)
        if act is Act.OPERATE:
            return list(world.devices)
        if act is Act.UNSTACK:
            return [i for i, below in enumerate(world.below) if below is not None and world.above[i] is None]
        if act in (Act.TAKE, Act.HOLD, Act.REMOVE) and plan.box is not None and world.contents(plan.box):
            return world.contents(plan.box)
        if act in LOOSE and world.hand is not None and world.contents(world.hand) and act is not Act.GIVE:
            return world.contents(world.hand)
        return []

    def _refs(self, plan: Draft, clause: Clause, entity: Entity) -> list[Ref]:
        """Return the referents of a phrase: those that the verb can act on, if there are any."""
        world, act = plan.world, clause.act
        resolver = self.resolver(world, plan.it, None, plan.mentioned, plan.box)
        refs = resolver.resolve(entity)
        if act is None:
            return refs
        if not self.help:
            return refs
        key = (id(resolver), act)
        if key not in self._usable:
            fits = self._is_usable if world.cells else self._is_meant
            self._usable[key] = lambda ref: bool(ref.things) and fits(world, act, ref)
        free = resolver.resolve(entity, self._usable[key])
        known = {ref.things for ref in refs}
        more = [ref._replace(cost=ref.cost + costs.ONLY_USABLE) for ref in free if ref.things not in known]
        refs = refs + more if act in (Act.TAKE, Act.CARRY, Act.REMOVE, Act.GIVE) or not world.cells else refs
        if world.cells:
            return refs
        fit = [ref for ref in refs if ref.things and allows(world, act, ref.things[-1])]
        selects = entity.superlative or entity.sides or entity.ordinal or entity.relations
        usable = [ref for ref in fit if (self._is_meant if selects else self._is_usable)(world, act, ref)]
        if (
            len(usable) > 1 and not entity.any and plan.steps and plan.box is not None
        ):  # "open the fridge, give me the cube"
            inside = [ref for ref in usable if world.inside.get(ref.things[-1]) == plan.box]
            usable = inside if len(inside) == 1 else usable
        if len(usable) > 1 and not entity.other and world.held is None:
            loose = [ref for ref in usable if ref.things[-1] not in world.inside]
            usable = loose if loose and entity.any else usable
        return usable or fit or refs

    def _is_meant(self, world: WorldModel, act: Act, ref: Ref) -> bool:
        """Whether a verb can act on a thing, if need be after other steps."""
        return allows(world, act, ref.things[-1]) and (act not in BOXES or self._is_usable(world, act, ref))

    def _is_usable(self, world: WorldModel, act: Act, ref: Ref) -> bool:
        index = ref.things[-1]
        if act in BOXES:
            return index in world.containers and not self._done(world, act, index)
        if act is Act.OPERATE:
            return index in world.devices
        if act is Act.TOUCH:
            return not world.things[index].target
        if act is Act.GIVE and world.hand is not None and world.inside.get(index) == world.hand:
            return False
        if world.cells:
            return not obstacle(world, (index,))
        return world.is_loose(index) and not obstacle(world, (index,))

    def _fits_held(self, plan: Draft, entity: Entity | None) -> bool:
        """Whether a phrase may mean the held thing."""
        held = plan.world.held
        if plan.world.cells and held is not None:
            return entity is None or all(color_fits(plan.world, held, color) for color in entity.colors)
        if (
            entity is None
            or held is None
            or (entity.kind == "it" and (not plan.it or plan.it[0] == held or not plan.steps))
        ):
            return True
        if entity.kind == "it":
            return True
        if entity.kind != "thing" or entity.other or entity.every or (entity.number or 1) > 1:
            return False
        thing = plan.world.things[held]
        if entity.noun not in (None, thing.kind) or not all(color_fits(plan.world, held, c) for c in entity.colors):
            return False
        if entity.relations or entity.superlative or entity.sides or entity.ordinal or entity.role == "target":
            return any(ref.things[-1:] == (held,) for ref in self.resolver(plan.world, plan.it, None).resolve(entity))
        return True

    def _held_cost(self, world: WorldModel, held: int, entity: Entity | None) -> float:
        """Return the cost of a phrase for the held thing: how badly it fits."""
        if entity is None or entity.kind == "it":
            return 0.0
        thing = world.things[held]
        cost = 0.0 if entity.kind == "thing" else 3.0
        cost += 3.0 * (entity.noun not in (None, thing.kind))
        cost += 3.0 * (not all(color_fits(world, held, color) for color in entity.colors))
        return cost + sum(0.7 for relation in entity.relations if relation.name != "held")

    # ---- Two and more things at once

    def _swap(self, plan: Draft, clause: Clause) -> Draft:
        """Return the plan in which two things change places, by way of a free spot."""
        entity = clause.entity
        if entity is None:
            named = list(plan.it)
        else:
            some = self._several(
                plan, clause, replace(entity, every=True) if entity.kind == "thing" and entity.plural else entity
            )
            if isinstance(some, Draft):
                return some
            named = some
        if len(named) != 2:
            return replace(
                plan, failure=("two things change places, no more and no less"), reason="impossible", entity=entity
            )
        one, other = named
        first, second = (self._location(plan.world, each) for each in named)
        plan = self._ready(plan)
        if not plan.world.inside.get(one) and plan.world.inside.get(other) is not None:
            one, other, first, second = other, one, second, first
        spot = free_spot(plan.world, one, [_Wish(plan.world.center[0], plan.world.center[1], _anywhere)])
        steps = [(one, spot), (other, first)]
        if first.on not in plan.world.containers or second.on in plan.world.containers:
            steps.append((one, second))
        for index, where in steps:
            plan = self._made_takeable(plan, index) if plan.world.held != index else plan
            if plan.failure:
                return plan
            plan = self._put(plan, Clause(CARRY), index, where)
        return replace(plan, cost=plan.cost - costs.MOVED_TWICE - 2 * costs.ANOTHER_OBJECT, it=(one, other), topic=None)

    def _location(self, world: WorldModel, index: int) -> Spot:
        thing, box = world.things[index], world.inside.get(index)
        return Spot(thing.x, thing.y, thing.bottom, world.below[index] if box is None else box, 0.0)

    def _build(self, plan: Draft, clause: Clause) -> Draft:
        """Return the plan that stacks things, the first one lowest."""
        entity = clause.entity
        if entity is None:
            return replace(plan, failure="it is not said what to stack", reason="where")
        things = self._several(plan, clause, replace(entity, any=True) if entity.number else entity)
        if isinstance(things, Draft):
            return things
        stacks = clause.act is Act.BUILD
        if stacks and entity.is_bare_plural and not plan.arbitrary and len(things) > 2 and plan.world.flat_only:
            return replace(plan, failure="several", reason="several", entity=entity, candidates=tuple(things))
        if stacks and len(things) > 2 and plan.world.flat_only:
            failure = f"a stack of {len(things)} is too high: I put one cube on another, and nothing on top of that"
            return replace(plan, failure=failure, reason="impossible", entity=entity)
        if len(things) < 2:
            return replace(
                plan, failure=f"a {'stack' if stacks else 'row'} needs two things", reason="impossible", entity=entity
            )
        if entity.kind != "list":
            things.sort(key=lambda i: plan.world.above[i] is not None)
        for below, index in pairwise(things):
            place = RelationPhrase("on" if stacks else "near", (Entity(pointed=Gesture((below,))),))
            found = list(self._handled(replace(plan, mover=index), Clause(CARRY, None, (place,)), index))
            plan = min(found, key=lambda done: (bool(done.failure), done.cost))
            if plan.failure:
                return plan
        return replace(plan, it=tuple(things), arbitrary=plan.arbitrary or bool(entity.number), topic=None)


def _marked(before: Draft, plan: Draft, clause: Clause) -> Draft:
    """Return the plan after a clause; its last step keeps the instruction that it was read from."""
    if (clause.instruction is not None or clause.several) and len(plan.steps) > len(before.steps):
        last = replace(plan.steps[-1], instruction=clause.instruction, several=clause.several)
        plan = replace(plan, steps=(*plan.steps[:-1], last))
    return replace(plan, last=clause)


def _names_it(plan: Draft, clause: Clause) -> bool:
    """Whether the words before a clause only named what it operates, which is done already."""
    last, spoken = plan.last, clause.entity is not None and clause.entity.kind == "it"
    operated = bool(plan.steps) and plan.steps[-1].act is Act.OPERATE
    return spoken and operated and last is not None and last.act is None and last.entity is not None
