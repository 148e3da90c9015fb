"""Clauses for several things: each of them one after the other, two that change places, and stacks of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

from language import costs
from language.meanings import Clause, Entity, Gesture, RelationPhrase
from language.movers import Movers
from language.places import ONTO, _anywhere, _Wish, free_spot
from language.spots import Spot
from language.steps import BOXES, CARRY, ON_TABLE, Draft, allows, at_a_mark, beside, obstacle, off_table
from language.verbs import Act, doing
from language.world import WorldModel

GRIPS_ONE = "my gripper takes one thing at a time"


class Several(Movers):
    """Plan what is done with several things."""

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
        clause, orders = without_orders(clause)
        things = self._several(plan, clause, replace(entity, every=entity.every or entity.is_bare_plural))
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
        ordered = self._in_order(plan, things, orders)
        if isinstance(ordered, Draft):
            return ordered
        things = ordered
        for number, index in enumerate(things):
            plan = self._one_of(plan, clause, index, len(things) > 1)
            if "is full" in plan.failure and number:
                plan = replace(plan, failure=f"{plan.failure.partition(' is full')[0]} holds one thing at a time")
            first = plan.steps[-1].goal if plan.steps and not number and len(things) > 1 else None
            onto = any(each.name in ONTO for each in clause.places) and act is Act.CARRY and not plan.world.cells
            if first is not None and onto and plan.world.is_loose(first):
                plan = replace(plan, failure="only one thing stands on another", reason="impossible", entity=entity)
            if plan.failure:
                return replace(plan, entity=plan.entity or entity)
        box = next((i for i in things if i in plan.world.containers), plan.box)
        done = replace(plan, it=tuple(things), mentioned=tuple(things), box=box, topic=None)
        marked = (*done.steps[:before], *(replace(each, several=True) for each in done.steps[before:]))
        return replace(done, steps=marked)

    def _one_of(self, plan: Draft, clause: Clause, index: int, several: bool) -> Draft:
        """Return the plan that does the clause for one thing of several, or why that is not possible."""
        part = beside(clause) if at_a_mark(plan) else clause
        if clause.act in (Act.REMOVE, Act.UNSTACK) and several and not part.places:
            part = replace(part, verb=CARRY, places=ON_TABLE)
        found = list(self._act(replace(plan, mover=index), part))
        good = [done for done in found if not done.failure]
        if good:
            return min(good, key=lambda done: done.cost)
        failed = found[0] if found else plan
        text = failed.failure or "there is no place for all of them"
        return replace(failed, failure=text, reason="impossible")

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

    def _in_order(self, plan: Draft, things: list[int], orders: Sequence[RelationPhrase]) -> list[int] | Draft:
        """Return the things in the order that is said: the phrase selects the first one, then among the rest."""
        resolver = self.resolver(plan.world, plan.it, None, plan.mentioned, plan.box)
        for order in orders:
            phrase = order.anchors[0]
            selected: list[int] = []
            for part in phrase.parts or (phrase,):
                left = [i for i in things if i not in selected]
                if not (found := resolver.among(part, left)):
                    return replace(plan, failure="it is none of them", reason="nothing", entity=part)
                while found:
                    selected.append(found[0])
                    left.remove(found[0])
                    found = resolver.among(part, left) if left and not phrase.parts else []
            rest = [i for i in things if i not in selected and order.value != "only"]
            things = [*rest, *reversed(selected)] if order.value == "last" else [*selected, *rest]
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


def without_orders(clause: Clause) -> tuple[Clause, tuple[RelationPhrase, ...]]:
    """Return a clause without the order in which it is done to several things, and that order."""
    orders = tuple(place for place in clause.places if place.name == "order")
    places = tuple(place for place in clause.places if place.name != "order")
    return (replace(clause, places=places), orders) if orders else (clause, ())
