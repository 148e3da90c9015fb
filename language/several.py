"""Clauses for several things: each of them one after the other, two that change places, and stacks of them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from language import costs
from language.chart import is_mutual
from language.free_spots import GRID, SHARES, clear_of
from language.meanings import Clause, Entity, RelationPhrase
from language.movers import Movers
from language.referents import thing_ref
from language.spots import Point, Spot, a_name, along, pinned, place_at, point_at, settle
from language.steps import BOXES, CARRY, ON_TABLE, Draft, allows, obstacle, topmost
from language.verbs import Act, doing
from language.wishes import ONTO, SpotWish, anywhere, free_spot
from language.words import ENCLOSING
from language.world import WorldModel

CLOSE = 1.7  # widths between the middles of things up to which one is next to the other already
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
            lifts = clause.act in (Act.TAKE, Act.HOLD) and not clause.places and plan.world.held is None
            one = lifts and (entity.number or 0) > 1 and things.reason == "several"
            return replace(things, failure=GRIPS_ONE, reason="impossible", candidates=()) if one else things
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
        named, things = things, off_table(plan.world, clause, things)
        if named and not things:
            note = f"{'they are' if len(named) > 1 else f'{a_name(plan.world, named[0])} is'} on the table already"
            return replace(plan, notes=plan.notes if plan.steps else (*plan.notes, note), it=tuple(named), topic=None)
        ordered = self._in_order(plan, things, orders)
        if isinstance(ordered, Draft):
            return ordered
        things = ordered
        onto = act is Act.CARRY and any(each.name in ONTO for each in clause.places)
        things = self._without_base(plan, clause, things) if onto and entity.kind != "list" else things
        whole = towers_of(plan.world, things) if act is Act.UNSTACK and entity.kind == "stack" else [things]
        for number, index in enumerate(things):
            plan = self._one_of(plan, clause, index, len(things) > 1)
            if "is full" in plan.failure and number:
                plan = replace(plan, failure=f"{plan.failure.partition(' is full')[0]} holds one thing at a time")
            goal = plan.steps[-1].goal if plan.steps and len(things) > 1 else None
            if onto and goal is not None and plan.world.is_loose(goal):
                if plan.world.flat_only:
                    high = _too_high(len({goal, *things}))
                    plan = replace(plan, failure=high, reason="impossible", entity=entity)
                clause = replace(clause, places=tuple(_on(each, index) for each in clause.places))
            if plan.failure:
                return replace(plan, entity=plan.entity or entity)
        box = next((i for i in things if i in plan.world.containers), plan.box)
        spoken = tuple(dict.fromkeys(i for each in whole for i in each))
        done = replace(plan, it=spoken, mentioned=tuple(things), box=box, topic=None)
        marked = (*done.steps[:before], *(replace(each, several=True) for each in done.steps[before:]))
        return replace(done, steps=marked)

    def _without_base(self, plan: Draft, clause: Clause, things: list[int]) -> list[int]:
        """Return things without what they are put on: "put everything on the pink one"."""
        anchors = [each.anchors[0] for each in clause.places if each.name in ONTO and each.anchors]
        resolver = self.resolver(plan.world, plan.it, None, plan.mentioned, plan.box)
        bases = {ref.things[-1] for anchor in anchors for ref in resolver.resolve(anchor)[:1] if len(ref.things) == 1}
        return [i for i in things if i not in bases] or things

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
            return self._listed(plan, clause, entity)
        home = any(place.name == "home" for place in clause.places)
        if entity.kind == "it" or (home and self._counts_carried(entity)):
            return self._them(plan, act, entity, home)
        resolver = self.resolver(world, plan.it, None, plan.mentioned, plan.box)
        refs = resolver.resolve(entity)
        refs = [ref for ref in refs if ref.things and all(allows(world, act, i) for i in ref.things[-1:])] or refs
        if entity.number and entity.kind == "thing":  # "the two on the right": of what the verb can act on
            fit = [i for i, each in enumerate(world.things) if allows(world, act, i) and not each.target]
            refs = [thing_ref(world, i) for i in resolver.among(entity, fit)] or refs
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
            things = self._on_others(plan, entity, things)
            tops = tuple(tower[-1] for tower in towers_of(world, things))
            if entity.kind == "stack" and len(tops) > 1 and not (entity.every or entity.plural):
                return replace(plan, failure="several", reason="several", entity=entity, candidates=tops)
            if entity.kind == "stack" and not tops:
                return replace(plan, failure="nothing stands on another thing: there is no tower", reason="impossible")
        if act is Act.REMOVE:
            things = [i for i in things if i in world.inside] or things
        if wanted and entity.every and len(things) > wanted:  # "both", "two cubes"
            spoken = [i for i in things if i in (*plan.it, *plan.mentioned)]
            last = [i for i in self.recent[:wanted] if i in things and act in (Act.CARRY, Act.TOUCH, Act.GATHER)]
            spoken = last if len(last) == wanted and len(spoken) < wanted and not entity.other else spoken
            named = (entity.noun is not None or bool(entity.colors)) and len(spoken) != wanted
            alike = [i for i in things if i not in spoken and world.things[i].kind in self._kinds(plan)]
            if entity.other and len(alike) == wanted:  # "the other two", after one of three balls
                return alike
            few = (named or 0 < len(spoken) < wanted or entity.other) and act not in BOXES  # it asks which
            entity, things = replace(entity, every=not few), things if few else spoken or things
        if wanted and len(things) > wanted and not entity.every:
            if plan.arbitrary or entity.any:
                things.sort(key=lambda i: (bool(obstacle(world, i)), i in world.inside, world.things[i].x))
                return things[:wanted]
            return replace(
                plan, failure=f"{len(things)} things fit", reason="several", entity=entity, candidates=tuple(things)
            )
        return things

    def _listed(self, plan: Draft, clause: Clause, entity: Entity) -> list[int] | Draft:
        """Return the things of a list, one for each of its phrases, or the plan that says why one is not found."""
        found = []
        for part in entity.parts:
            start = plan if part.kind == "it" else replace(plan, it=())
            drafts = list(self._movers(start, replace(clause, entity=part)))
            good = [each for each in drafts if not each.failure and each.mover is not None]
            if not good:
                return drafts[0]
            best = min(each.cost for each in good)
            if sum(each.cost < best + costs.CLOSE for each in good) > 1 and not part.any:
                movers = tuple(each.mover for each in good if each.mover is not None)
                return replace(plan, failure="several", reason="several", entity=part, candidates=movers)
            found.append(min(good, key=lambda each: each.cost).mover)
        return [index for index in dict.fromkeys(found) if index is not None]

    def _kinds(self, plan: Draft) -> set[str]:
        """Return the kinds of the things that were spoken of last."""
        return {plan.world.things[i].kind for i in (*plan.it, *plan.mentioned)}

    def _on_others(self, plan: Draft, entity: Entity, things: list[int]) -> list[int]:
        """Return those of some things that stand on others: those of the tower that was spoken of, if one is meant."""
        stacked = [i for i in things if plan.world.below[i] is not None] or things
        spoken = [i for tower in towers_of(plan.world, things) if {*plan.it} & {*tower} for i in tower]
        meant = [i for i in stacked if i in spoken] if entity.kind == "stack" and not entity.every else []
        return meant or stacked

    def _in_order(
        self, plan: Draft, things: list[int], orders: Sequence[RelationPhrase], number: int | None = None
    ) -> list[int] | Draft:
        """Return the things in the order that is said: the phrases select the first, middle and last ones.

        number: how many are wanted, those that are selected first.
        """
        resolver = self.resolver(plan.world, plan.it, None, plan.mentioned, plan.box)
        ends: dict[str, list[int]] = {"first": [], "middle": [], "last": []}
        for order in orders:
            if order.value == "reversed":
                things = things[::-1]
                continue
            phrase, selected = order.anchors[0], ends["first" if order.value == "only" else order.value or "first"]
            for part in phrase.parts or (phrase,):
                left = [i for i in things if not any(i in end for end in ends.values())]
                if not (found := resolver.among(part, left)):
                    return replace(plan, failure="it is none of them", reason="nothing", entity=part)
                while found:
                    selected.append(found[0])
                    left.remove(found[0])
                    repeats = left and not phrase.parts and number is None
                    found = resolver.among(part, left) if repeats else []
        rest = [i for i in things if not any(i in end for end in ends.values())]
        rest = [] if any(order.value == "only" for order in orders) else rest
        rest = rest if number is None else rest[: max(number - sum(map(len, ends.values())), 0)]
        middle = max((len(rest) + sum(map(len, ends.values())) - 1) // 2 - len(ends["first"]), 0)
        rest[middle:middle] = ends["middle"]
        parted = any(each.anchors and each.anchors[0].parts for each in orders)
        return [*ends["first"], *rest, *(ends["last"] if parted else ends["last"][::-1])]

    def _counts_carried(self, entity: Entity) -> bool:
        """Whether "all three" are as many as were put somewhere one after the other."""
        said = entity.noun or entity.colors or entity.relations or entity.sides or entity.other
        return not said and 1 < (entity.number or 0) <= len(self.carried)

    def _them(self, plan: Draft, act: Act | None, entity: Entity, home: bool) -> list[int]:
        """Return the things of "them"; "all of them", or of a tower, are all where none were spoken of.

        home: whether they go back, so that things are meant which were moved.
        """
        if entity.number:
            return list(self.carried[: entity.number])
        together = act in (Act.BUILD, Act.GATHER) and not plan.it
        world, every = plan.world, (entity.every or together) and len(plan.it) < 2
        named = [i for i in (range(len(world.things)) if every else plan.it) if allows(world, act, i)]
        named = [i for i in named if not (every and world.things[i].target)]
        if every and act is Act.TOUCH:  # of everything, what lies about
            named = [i for i in named if world.is_loose(i)]
        if len(named) < 2 and act not in BOXES and not plan.steps:
            recent = [i for i in self.recent if allows(world, act, i)]
            moved = [i for i in self.carried if i in self.rests] if home else []
            named = (moved if len(moved) > 1 else recent[:2]) or named
        if act in BOXES and len(named) < 2:
            named = [i for i in world.containers if not self._done(world, act, i)]
        return named or [i for i in self._unnamed(plan, act) if not self._done(world, act, i)]

    def _swap(self, plan: Draft, clause: Clause) -> Draft:
        """Return the plan in which two things change places, by way of a free spot."""
        entity = clause.entity
        if entity is None:
            named = list(plan.it)
        else:
            every = entity.kind == "thing" and entity.plural
            some = self._several(plan, clause, replace(entity, every=True) if every else entity)
            if isinstance(some, Draft):
                return some
            named = some
        if len(named) != 2:
            failure = "two things change places, no more and no less"
            return replace(plan, failure=failure, reason="impossible", entity=entity)
        one, other = named
        first, second = (self._location(plan.world, each) for each in named)
        plan = self._ready(plan)
        tower = plan.world.column(first.x, first.y) if one not in plan.world.inside else []
        if other in tower and one in tower:
            done = self._swapped_within(plan, tower[min(map(tower.index, named)) :], one, other)
            return replace(done, cost=plan.cost, it=(one, other), topic=None)
        if not plan.world.inside.get(one) and plan.world.inside.get(other) is not None:
            one, other, first, second = other, one, second, first
        for box in (first.on, second.on):
            if box in plan.world.containers and box not in plan.world.open:
                plan = self._opened_first(plan, box)
        spot = free_spot(plan.world, one, [SpotWish(plan.world.center[0], plan.world.center[1], anywhere)])
        steps = [(one, spot), (other, first)]
        if first.on not in plan.world.containers or second.on in plan.world.containers:
            steps.append((one, second))
        for index, where in steps:
            plan = self._made_takeable(plan, index) if plan.world.held != index else plan
            if plan.failure:
                return plan
            plan = self._put(plan, Clause(CARRY), index, where)
        return replace(plan, cost=plan.cost - costs.MOVED_TWICE - 2 * costs.ANOTHER_OBJECT, it=(one, other), topic=None)

    def _swapped_within(self, plan: Draft, tower: Sequence[int], one: int, other: int) -> Draft:
        """Return the plan in which two things of a tower change places. tower: from the lower one of them up."""
        base = self._location(plan.world, tower[0])
        room = SHARES[plan.world.cells][0] * plan.world.things[tower[0]].width

        def apart(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.bool_]:
            return np.hypot(x - base.x, y - base.y) >= room

        for index in reversed(tower):
            plan = self._put(
                plan, Clause(CARRY), index, free_spot(plan.world, index, [SpotWish(base.x, base.y, apart)])
            )
        plan = replace(plan, notes=())  # of the places where things stand meanwhile
        swapped = [{one: other, other: one}.get(index, index) for index in tower]
        plan = self._put(plan, Clause(CARRY), swapped[0], base)
        for below, index in pairwise(swapped):
            at = settle(plan.world, index, Point(base.x, base.y, 0.0, below))
            plan = plan if plan.failure else self._put(plan, Clause(CARRY), index, at)
        return plan

    def _location(self, world: WorldModel, index: int) -> Spot:
        thing, box = world.things[index], world.inside.get(index)
        return Spot(thing.x, thing.y, thing.bottom, world.below[index] if box is None else box, 0.0)

    def _build(self, plan: Draft, clause: Clause) -> Draft:
        """Return the plan that puts things on each other, the first one lowest, or in a row, the first one leftmost."""
        clause, orders = without_orders(clause)
        entity, stacks = clause.entity, clause.act is Act.BUILD
        if entity is None:
            return replace(plan, failure="it is not said what to stack", reason="where")
        chosen = entity.number is not None and bool(orders)
        phrase = replace(entity, any=True) if entity.number else entity
        phrase = replace(entity, every=True, number=None) if chosen else phrase
        old = self._former(plan) if stacks and entity.kind == "it" else []
        things = old or self._several(plan, clause, phrase)
        if isinstance(things, Draft):
            return things
        if stacks and entity.is_bare_plural and not plan.arbitrary and len(things) > 2 and plan.world.flat_only:
            return replace(plan, failure="several", reason="several", entity=entity, candidates=tuple(things))
        if entity.kind != "list" and not old:
            things.sort(key=lambda i: self._rank(plan.world, i, stacks))
        ordered = self._in_order(plan, things, orders, entity.number if chosen else None)
        if isinstance(ordered, Draft):
            return ordered
        if stacks and len(ordered) > 2 and plan.world.flat_only:
            return replace(plan, failure=_too_high(len(ordered)), reason="impossible", entity=entity)
        if len(ordered) < 2:
            return replace(
                plan, failure=f"a {'stack' if stacks else 'row'} needs two things", reason="impossible", entity=entity
            )
        pair = not (stacks or orders or clause.places) and len(ordered) == 2
        ways = (ordered, ordered[::-1]) if pair else ()
        beside = [self._placed_once(plan, i, (place_at(j, "near"),)) for i, j in ways]
        done = next((draft for draft in beside if not draft.failure), None)
        done = done or (self._stacked if stacks else self._lined)(plan, ordered, clause.places)
        arbitrary = plan.arbitrary or bool(entity.number)
        return replace(done, cost=plan.cost, it=tuple(ordered), arbitrary=arbitrary, topic=None)

    def _mutual(self, plan: Draft, clause: Clause) -> Iterator[Draft]:
        """Yield the plans that put several things in a relation to each other: the first one moves, or the second."""
        entity, place = clause.entity or Entity("it", plural=True), next(p for p in clause.places if is_mutual(p))
        places = tuple(each for each in clause.places if each is not place)
        if entity.other and self.recent:  # "and the rest, too": next to what was moved
            yield self._joined_to(plan, replace(clause, places=places), place)
            return
        named = entity.kind in ("list", "it") or entity.every
        phrase = entity if named else replace(entity, every=not entity.number, any=bool(entity.number))
        if place.name in ("on", "over"):
            phrase = replace(entity, parts=entity.parts[::-1]) if entity.kind == "list" else entity
            yield self._build(plan, replace(clause, verb=doing(Act.BUILD), entity=phrase, places=places))
            return
        things = self._several(plan, replace(clause, verb=doing(Act.GATHER)), phrase)
        if isinstance(things, Draft) or len(things) != 2:
            row = replace(clause, verb=doing(Act.GATHER), entity=phrase, places=places)
            yield things if isinstance(things, Draft) else self._build(plan, row)
            return
        name = "near" if place.name in ONTO else place.name  # "touch each other", "to each other"
        for cost, (index, other) in enumerate((things, things[::-1])):
            anchors = tuple(pinned(other) if a.kind == "mutual" else a for a in place.anchors)
            out = entity.kind == "list" and other in plan.world.inside
            start = self._placed_once(plan, other, ON_TABLE) if out else plan
            done = self._placed_once(start, index, (replace(place, name=name, anchors=anchors), *places))
            yield replace(done, cost=done.cost + costs.ANOTHER_OBJECT * cost, it=tuple(things), topic=None)

    def _joined_to(self, plan: Draft, clause: Clause, place: RelationPhrase) -> Draft:
        """Return the plan that puts the rest of some things next to what was moved last, where some are already."""
        entity, last = clause.entity, self.recent[0]
        assert entity is not None
        rest = self._several(plan, clause, replace(entity, every=True))
        if isinstance(rest, Draft):
            return rest
        at, width = plan.world.things[last][2:4], plan.world.things[last].width
        away = [i for i in rest if i != last and math.dist(plan.world.things[i][2:4], at) > CLOSE * width]
        if not entity.every and len(away) > 1:
            return replace(plan, failure="several", reason="several", entity=entity, candidates=tuple(away))
        parts, beside_it = tuple(pinned(i) for i in away), replace(place, anchors=(pinned(last),))
        return self._each(plan, replace(clause, entity=Entity("list", parts=parts), places=(beside_it, *clause.places)))

    def _rank(self, world: WorldModel, index: int, stacks: bool) -> tuple[float, ...]:
        """Return what sorts things whose order is not said: by the tower they are in, or from left to right."""
        thing = world.things[index]
        if not stacks:
            return -along(world, "left")(thing), thing.bottom
        column = world.column(thing.x, thing.y) if world.is_loose(index) and index not in world.inside else []
        return -len(column) if len(column) > 1 else 0, thing.x, thing.y, thing.bottom

    def _former(self, plan: Draft) -> list[int]:
        """Return the tower that is there, the lowest first, or the one that was taken apart last."""
        world = plan.world
        towers = [list(tower) for tower in towers_of(world, range(len(world.things)))]
        below = {i: under for i, (_, _, under) in self.rests.items() if under is not None and world.is_loose(under)}
        for base in set(below.values()) - set(below):  # a tower has a lowest thing, so that no cycle is followed
            towers.append([base])
            while (upper := next((i for i, under in below.items() if under == towers[-1][-1]), None)) is not None:
                towers[-1].append(upper)
        return max(towers, key=len, default=[])

    def _cleared(self, plan: Draft, index: int) -> Draft:
        """Return the plan with nothing on a thing."""
        while plan.world.above[index] is not None and not plan.failure:
            over = topmost(plan.world, index)
            plan = self._aside(plan, over, f"I put {a_name(plan.world, over)} on the table first")
        return plan

    def _stacked(self, plan: Draft, things: Sequence[int], places: tuple[RelationPhrase, ...]) -> Draft:
        """Return the plan with things on each other, the lowest first. places: where the tower stands."""
        before, base = len(plan.steps), things[0]
        plan = self._ready(plan, base)
        if places or not plan.world.is_on_ground(base):
            plan = self._cleared(plan, base)
            plan = self._placed_once(plan, base, places or ON_TABLE)
        for below, index in pairwise(things):
            if plan.world.above[below] == index or plan.failure:
                continue
            plan = self._cleared(self._cleared(plan, below), index)
            plan = self._placed_once(plan, index, (place_at(below, "on"),))
        if not plan.failure:
            plan = self._cleared(plan, things[-1])
        if len(plan.steps) == before and not plan.failure:
            return replace(plan, failure="they stand on each other like that already", reason="already")
        return plan

    def _placed_once(self, plan: Draft, index: int, places: tuple[RelationPhrase, ...]) -> Draft:
        """Return the best plan that puts a thing somewhere."""
        if plan.failure:
            return plan
        found = list(self._handled(replace(plan, mover=index), Clause(CARRY, None, places), index))
        nowhere = replace(plan, failure="no place fits", reason="nowhere")
        return min(found, key=lambda done: (bool(done.failure), done.cost), default=nowhere)

    def _tower_moved(self, plan: Draft, clause: Clause) -> Draft | None:
        """Return the plan that moves a whole tower: what stands on its lowest thing waits beside it, and follows."""
        entity, world = clause.entity, plan.world
        if clause.act is not Act.CARRY or entity is None or entity.kind != "stack" or not clause.places or world.cells:
            return None
        towers = towers_of(world, [ref.things[-1] for ref in self._refs(plan, clause, entity) if ref.things])
        if len(towers) != 1 or world.held is not None:
            return None
        if any(anchor.noun in ENCLOSING for place in clause.places for anchor in place.anchors):
            return replace(plan, failure="only one thing fits in there at a time", reason="impossible")
        sides = (RelationPhrase("at", (Entity("side", sides=(side,)),)) for side in ("left", "right", "near", "far"))
        waiting = [ON_TABLE, *((side,) for side in sides)]
        return min((self._tower_put(plan, towers[0], clause, each) for each in waiting), key=_trouble)

    def _tower_put(
        self, plan: Draft, tower: Sequence[int], clause: Clause, waiting: tuple[RelationPhrase, ...]
    ) -> Draft:
        """Return the plan that puts a tower somewhere. waiting: where its upper things are put before."""
        done = plan
        for index in tower[:0:-1]:
            done = self._placed_once(done, index, waiting)
        before = done.cost
        done = self._placed_once(done, tower[0], clause.places)
        cost = plan.cost + done.cost - before
        for lower, upper in pairwise(tower):
            done = self._placed_once(done, upper, (place_at(lower, "on"),))
        return replace(done, cost=cost, it=tuple(tower), topic=None)

    def _lined(self, plan: Draft, things: Sequence[int], places: tuple[RelationPhrase, ...]) -> Draft:
        """Return the plan of a straight row from left to right, or along a side from the front to the back."""
        first = self._placed_once(plan, things[0], places) if places else plan
        if first.failure:
            return first
        among = things[:1] if places else things
        x = sum(first.world.things[i].x for i in among) / len(among)
        y = sum(first.world.things[i].y for i in among) / len(among)
        side = _side_of(places)
        if side:
            ways = [plan.world.toward(way) for way in ("back", "right")]
            found = (row_spots(plan.world, things, (x, y), way, False, plan.world.toward(side)) for way in ways)
            spots: list[tuple[float, float]] = next(filter(None, found), [])
        else:
            spots = row_spots(plan.world, things, (x, y), plan.world.toward("right"), bool(places))
        if not spots:
            return replace(plan, failure="there is no room for a row", reason="impossible")
        for index, (x, y) in zip(things, spots, strict=True):
            if plan.world.is_on_ground(index) and math.dist(plan.world.things[index][2:4], (x, y)) < 1e-6:
                continue
            plan = self._cleared(plan, index)
            plan = self._placed_once(plan, index, (point_at(x, y),))
        return plan


def _side_of(places: Sequence[RelationPhrase]) -> str:
    """Return "left" or "right" if places are at that side of the table; otherwise ""."""
    named = {side for place in places for anchor in place.anchors for side in anchor.sides}
    named |= {place.name for place in places if [anchor.kind for anchor in place.anchors] == ["board"]}
    return next((side for side in ("left", "right") if side in named), "")


def _too_high(count: int) -> str:
    """Return why a tower of so many things is not built."""
    return f"a stack of {count} is too high: I put one cube on another, and nothing on top of that"


def _trouble(plan: Draft) -> tuple[bool, int, float]:
    """Return how much goes otherwise than was meant; for comparisons."""
    return bool(plan.failure), len(plan.notes), plan.cost


def towers_of(world: WorldModel, things: Sequence[int] | None = None) -> list[tuple[int, ...]]:
    """Return the towers, the lowest thing first, to which some things belong. None: all, in the order of their tops."""
    if things is None:
        things = [i for i, below in enumerate(world.below) if below is not None and world.above[i] is None]
    columns = [tuple(world.column(world.things[i].x, world.things[i].y)) for i in things]
    return [column for column in dict.fromkeys(columns) if len(column) > 1]


def row_spots(
    world: WorldModel,
    things: Sequence[int],
    at: tuple[float, float],
    toward: tuple[float, float],
    fixed: bool,
    half: tuple[float, float] | None = None,
) -> list[tuple[float, float]]:
    """Return x and y of things in a straight row; [] if there is no room.

    at: where it begins, if fixed, or else its middle, as near as possible. toward: unit vector from the first to the
    last. fixed: whether the row stays on the line through the place. half: unit vector from the middle of the table to
    the half where all of the row is; None: anywhere.
    """
    (x0, x1, y0, y1), (dx, dy) = world.bounds, toward
    width = max(world.things[i].width for i in things)
    step, grid = (world.pitch, 1.0) if world.cells else (SHARES[False][0] * width + GRID, GRID)
    standing = [i for i in range(len(world.things)) if world.is_on_ground(i)]
    standing = [i for i in standing if world.is_loose(i) or world.covers(*world.things[i][2:4])]
    length = step * (len(things) - 1)
    xs, ys = (np.arange(a, b + 1e-6, grid) for a, b in ((x0, x1), (y0, y1)))
    xs, ys = (xs if dx or not fixed else np.array(at[:1])), (ys if dy or not fixed else np.array(at[1:]))
    x, y = (each.reshape(-1, 1) for each in np.meshgrid(xs, ys, indexing="ij"))
    x, y = x + dx * step * np.arange(len(things)), y + dy * step * np.arange(len(things))  # (begins, things)
    start = at if fixed else (at[0] - dx * length / 2, at[1] - dy * length / 2)
    (cx, cy), (hx, hy) = world.center, half or (0.0, 0.0)
    fits = (x0 - 1e-6 <= x) & (x <= x1 + 1e-6) & (y0 - 1e-6 <= y) & (y <= y1 + 1e-6)
    fits = (fits & ((x - cx) * hx + (y - cy) * hy >= 0)).all(axis=1)
    masks = []  # (things, shares) of the begins
    for n in range(len(things)):  # those before it have left their places
        boxes = tuple((*world.things[i][2:4], world.things[i].width) for i in standing if i not in things[: n + 1])
        masks.append(clear_of(x[:, n], y[:, n], world.cells, boxes))
    for clear in zip(*masks, strict=True):
        free = fits & np.all(clear, axis=0)
        if free.any():
            row = int(np.where(free, np.hypot(x[:, 0] - start[0], y[:, 0] - start[1]), np.inf).argmin())
            return list(zip(x[row].tolist(), y[row].tolist(), strict=True))
    return []


def without_orders(clause: Clause) -> tuple[Clause, tuple[RelationPhrase, ...]]:
    """Return a clause without the order in which it is done to several things, and that order."""
    orders = tuple(place for place in clause.places if place.name == "order")
    places = tuple(place for place in clause.places if place.name != "order")
    return (replace(clause, places=places), orders) if orders else (clause, ())


def _on(place: RelationPhrase, index: int) -> RelationPhrase:
    """Return a place on something as the place on another thing: the next of several goes on top of the one before."""
    return replace(place, anchors=(pinned(index),)) if place.name in ONTO else place


def off_table(world: WorldModel, clause: Clause, things: list[int]) -> list[int]:
    """Return those that are not on the table, maybe none, of things that a clause just puts there; otherwise all."""
    onto = [place.name in ONTO and [a.kind for a in place.anchors] == ["board"] for place in clause.places]
    if clause.act is not Act.CARRY or not onto or not all(onto):
        return things
    return [i for i in things if not world.is_on_ground(i)]


def beside(clause: Clause) -> Clause:
    """Return the clause for a further thing: beside the place, where the first one lies."""
    onto = [place.name in ONTO for place in clause.places]
    places = [replace(place, name="near") if at else place for place, at in zip(clause.places, onto, strict=True)]
    return replace(clause, places=tuple(places))


def at_a_mark(plan: Draft) -> bool:
    """Return whether the last thing was put where a see-through thing marks a place, or beside it."""
    last = plan.steps[-1] if plan.steps else None
    if last is None or last.place is None or (last.goal is not None and not plan.world.things[last.goal].target):
        return False
    (x, y), world = last.place, plan.world
    return any(each.target and max(abs(each.x - x), abs(each.y - y)) < 2 * each.width for each in world.things)
