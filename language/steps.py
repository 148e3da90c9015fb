"""Steps of a plan: what each act does with one thing, and the steps that nobody said but that it needs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from language import costs
from language.errors import NotUnderstood
from language.lattice import BARE_PLACES
from language.meanings import Clause, Entity, Gesture, RelationPhrase
from language.objects import HAND
from language.outcomes import Step
from language.places import spots
from language.referents import Resolver
from language.spots import Point, Rest, Spot, a_name, is_operated, old_place, place_at, point_at, says_top, settle
from language.verbs import DEVICE_VERBS, KNOWN, ROOM, Act, bringing, doing
from language.wishes import SpotWish, anywhere, free_spot
from language.world import FIXED, WorldModel

KEPT = 12  # plans of the clauses so far
POINTS = 8  # points of places that are compared with a further relation for the same effort
MOST_EFFORT, MOST_ON_BOARD = 1500, 900  # after this, the sentence is refused
LOOSE = (Act.TAKE, Act.CARRY, Act.LOWER, Act.REMOVE, Act.GIVE, Act.UNSTACK, Act.STORE, Act.SWAP, Act.BUILD, Act.GATHER)
TAKING = (Act.TAKE, Act.HOLD, Act.REMOVE, Act.UNSTACK)
BOXES = (Act.OPEN, Act.SHUT, Act.EMPTY)
CARRY = bringing("goal")
ON_TABLE = (RelationPhrase("on", (Entity("board"),)),)


@dataclass(eq=False, slots=True)
class Draft:
    """The steps so far, the world after them, and their cost. It is never changed after it was made.

    mover: the thing of the current clause. it: the things that "it" means next. box: the container spoken of last.
    failure, reason: why it cannot be carried out. entity: the phrase that this is about. topic: a phrase that waits for
    its verb. anchor: what the last thing was put on or next to.
    """

    world: WorldModel
    steps: tuple[Step, ...] = ()
    cost: float = 0.0
    mover: int | None = None
    it: tuple[int, ...] = ()
    mentioned: tuple[int, ...] = ()
    box: int | None = None
    failure: str = ""
    reason: str = ""
    entity: Entity | None = None
    candidates: tuple[int, ...] = ()
    arbitrary: bool = False
    anchor: int | None = None
    topic: Clause | None = None
    last: Clause | None = None
    notes: tuple[str, ...] = ()


@dataclass
class Steps:
    """Add steps to plans in one world.

    it, mentioned: the things of the dialogue. others: what "the other one" means there. recent: all, the last first.
    carried: what was put somewhere last, one after the other, the last first.
    boxes: the container spoken of last, which is no other one. rests: where things stood before they were moved last.
    help: whether the scene helps to select. gestures: those of the sentence. box: the container spoken of last.
    effort: phrases weighed and steps tried so far.
    """

    world: WorldModel
    it: tuple[int, ...] = ()
    mentioned: tuple[int, ...] = ()
    help: bool = True
    gestures: tuple[Gesture, ...] = ()
    box: int | None = None
    effort: int = 0
    others: tuple[int, ...] = ()
    recent: tuple[int, ...] = ()
    carried: tuple[int, ...] = ()
    boxes: tuple[int, ...] = ()
    rests: dict[int, Rest] = field(default_factory=dict)
    _resolvers: dict[tuple, Resolver] = field(default_factory=dict)
    _usable: dict[tuple, Any] = field(default_factory=dict)
    _sequences: dict[tuple, list[Draft]] = field(default_factory=dict)
    _worlds: dict[tuple, tuple[WorldModel, WorldModel]] = field(default_factory=dict)

    def resolver(
        self,
        world: WorldModel,
        it: tuple[int, ...],
        origin: int | None = None,
        mentioned: tuple[int, ...] = (),
        box: int | None = None,
    ) -> Resolver:
        """Return the resolver of a world; phrases that were resolved in it before are not resolved again."""
        key = (id(world), it, origin, mentioned, box)
        if key not in self._resolvers:  # a resolver keeps its world, so that the id stays its own
            excluded = (*(mentioned or self.mentioned), *self.boxes)  # by "other"
            self._resolvers[key] = Resolver(world, it, excluded, origin, self.world)
            self._resolvers[key].box = box
            self._resolvers[key].others = tuple(i for i in self.others if i not in it)
        return self._resolvers[key]

    def _spend(self, amount: int = 1) -> None:
        """Raise NotUnderstood if a sentence takes too much effort."""
        self.effort += amount
        if self.effort > (MOST_ON_BOARD if self.world.cells else MOST_EFFORT):
            raise NotUnderstood("the sentence can be read in too many ways; say it in several shorter sentences")

    def _done(self, world: WorldModel, act: Act | None, index: int) -> bool:
        """Whether a container or device is in the state that the act leads to."""
        if act is Act.OPEN or act is Act.SHUT:
            return (index in world.open) == (act is Act.OPEN)
        return act is Act.EMPTY and not world.contents(index)

    def _is_box(self, plan: Draft, entity: Entity) -> bool:
        refs = self.resolver(plan.world, plan.it).resolve(entity) if entity.kind in ("thing", "person") else []
        return bool(refs) and all(ref.kind == "person" or ref.things[-1] in plan.world.containers for ref in refs)

    def _allowed(self, plan: Draft, forbidden: list[Clause]) -> Draft:
        """Return the plan, or why it is none: it needs a step that a clause forbids."""
        for clause in forbidden:
            entity = clause.entity
            spoken = entity is None or entity.kind == "it"
            refs = [] if spoken or entity is None else self.resolver(self.world, self.it).resolve(entity)
            things = {i for ref in refs for i in ref.things}
            for step in plan.steps:
                same = step.act is clause.act or (clause.act is Act.LOWER and step.carries)
                if same and step.implied and (spoken or step.object in things) and not plan.failure:
                    failure = f"I would have to {step.verb} {a_name(self.world, step.object)} for that"
                    return replace(plan, failure=failure, reason="impossible", entity=entity)
        return plan

    def _act(self, plan: Draft, clause: Clause) -> Iterator[Draft]:
        """Yield the plans that carry out a clause with the plan's mover."""
        assert plan.mover is not None
        self._spend()
        index, act, world = plan.mover, clause.act, plan.world
        verb = KNOWN[clause.verb or ""]
        kind = world.things[index].kind
        if kind in FIXED and not world.cells:
            act = self._on_fixed(world, index, verb, clause)
            if act is None:
                yield self._stays(plan, index, clause)
                return
        if act in BOXES and index not in world.containers:
            yield self._stays(plan, index, clause)
        elif act is Act.OPEN or act is Act.SHUT:
            yield self._opened(plan, index, act)
        elif act is Act.EMPTY:
            yield self._emptied(plan, index)
        elif act is Act.TOUCH:
            yield self._added(self._ready(plan, index), Step(doing(Act.TOUCH), index))
        elif act is Act.OPERATE:
            yield self._operated(plan, index, clause)
        else:
            yield from self._handled(plan, clause, index)

    def _on_fixed(self, world: WorldModel, index: int, verb: Any, clause: Clause) -> Act | None:
        """Return what a verb does to a device, a container or the hand; None: nothing."""
        act = verb.act
        placed = [each for each in clause.places if each.name not in ("direction", "here", *BARE_PLACES)]
        if clause.entity is not None and act is Act.CARRY:  # "move the wheel to the left of the lever"
            placed += [each for each in clause.entity.relations if any(a.kind == "thing" for a in each.anchors)]
        if act in (*BOXES, Act.TOUCH):
            return act if act is Act.TOUCH or index in world.containers else None
        if act is Act.HOLD:
            return Act.TOUCH
        if index in world.devices:
            far = any(each.measure is not None and each.measure.unit != "bit" for each in clause.places)
            return Act.OPERATE if not far and (act is Act.OPERATE or (act is Act.CARRY and not placed)) else None
        if index in world.containers:
            lid = clause.entity is not None and clause.entity.noun == "lid"
            down = any(each.value == "down" for each in clause.places)
            if lid and (
                act is Act.TAKE or (act is Act.CARRY and any(each.value in ("up", "top") for each in clause.places))
            ):
                return Act.OPEN
            if lid and (act is Act.LOWER or (act is Act.CARRY and down)):
                return Act.SHUT
            pushed = any(each.name == "into" or each.value in ("backward", "forward") for each in clause.places)
            if pushed and verb.pulls:
                return Act.SHUT if verb.pulls is Act.SHUT else Act.OPEN
            return verb.pulls if verb.pulls is not None and not placed else None
        return None

    def _stays(self, plan: Draft, index: int, clause: Clause) -> Draft:
        """Return why nothing of the kind can be done with a thing that is fixed."""
        world, name = plan.world, a_name(plan.world, index)
        if clause.act in BOXES:
            failure = f"{name} cannot be opened or closed; only a drawer or a fridge can"
        elif world.things[index].kind == HAND:
            failure = "your hand is yours; I only put something on it"
        elif clause.act in TAKING and clause.entity and clause.entity.kind == "it" and index in world.containers:
            failure = f"nothing is in {name}"
        else:
            failure = f"{name} is fixed and stays where it is"
        return replace(plan, failure=failure, reason="impossible", entity=plan.entity)

    def _added(self, plan: Draft, *steps: Step) -> Draft:
        """Return the plan with further steps and the world after them."""
        for step in steps:
            if plan.failure:
                return plan
            key = (id(plan.world), step)
            if key not in self._worlds:
                self._worlds[key] = (plan.world, plan.world.after(step))
            plan = replace(plan, steps=(*plan.steps, step), world=self._worlds[key][1])
        return plan

    def _ready(self, plan: Draft, index: int | None = None) -> Draft:
        """Return the plan with the gripper empty or holding the thing, and with the thing's container open."""
        held = plan.world.held
        if held is not None and held != index and not plan.world.cells:
            plan = self._aside(plan, held, f"I put {a_name(plan.world, held)} down first")
        if index is not None and index in plan.world.inside and not plan.failure:
            box = plan.world.inside[index]
            if box in plan.world.containers and box not in plan.world.open:
                plan = self._opened_first(plan, box)
        return plan

    def _aside(self, plan: Draft, index: int, note: str) -> Draft:
        """Return the plan with a thing at a free spot of the table."""
        thing = plan.world.things[index]
        spot = free_spot(plan.world, index, [SpotWish(thing.x, thing.y, anywhere)])
        if spot.why_not:
            return replace(plan, failure=spot.why_not, reason="impossible")
        step = Step(bringing("goal"), index, None, (spot.x, spot.y), spot.bottom, implied=True)
        take = () if index == plan.world.held else (Step(bringing("up"), index, implied=True),)
        plan = self._added(plan, *take, step)
        return replace(plan, notes=(*plan.notes, note), cost=plan.cost + costs.IMPLIED)

    def _opened_first(self, plan: Draft, box: int) -> Draft:
        note = f"I open {a_name(plan.world, box)} first"
        plan = self._with_open(plan, Step(doing(Act.OPEN), box, implied=True))
        return replace(plan, notes=(*plan.notes, note), cost=plan.cost + costs.IMPLIED / 2)

    def _with_open(self, plan: Draft, step: Step) -> Draft:
        """Return the plan with a step that opens: before the last step if that takes something, which is then held."""
        held = plan.world.held
        if held is None or not plan.steps or plan.steps[-1].object != held or plan.steps[-1].carries:
            return self._added(self._ready(plan), step)
        before = self.world
        for each in plan.steps[:-1]:
            before = before.after(each)
        return self._added(replace(plan, steps=plan.steps[:-1], world=before), step, plan.steps[-1])

    def _opened(self, plan: Draft, index: int, act: Act) -> Draft:
        if self._done(plan.world, act, index):
            if any(step.object == index and step.act is act and step.implied for step in plan.steps):
                return plan
            note = f"{a_name(plan.world, index)} is {'open' if act is Act.OPEN else 'closed'} already"
            return replace(plan, notes=(*plan.notes, note))
        step = Step(doing(act), index)
        return self._with_open(plan, step) if act is Act.OPEN else self._added(self._ready(plan), step)

    def _emptied(self, plan: Draft, index: int) -> Draft:
        inside = plan.world.contents(index)
        if not inside:
            return replace(plan, failure=f"{a_name(plan.world, index)} is empty already", reason="already")
        for thing in inside:
            found = list(self._handled(replace(plan, mover=thing), Clause(CARRY, places=ON_TABLE), thing))
            plan = found[0]
        return plan

    def _operated(self, plan: Draft, index: int, clause: Clause) -> Draft:
        world, kind = plan.world, plan.world.things[index].kind
        verb = next((name for name, noun in DEVICE_VERBS.items() if noun == kind), None)
        if verb is None:
            wanted = KNOWN[clause.verb or ""]
            if wanted.effect and world.verbs is None:  # a task that can rotate
                return self._added(plan, Step(clause.verb or "", index))
            return replace(plan, failure="unturnable", reason="never", entity=Entity(span=clause.span))
        own, pressed = KNOWN[clause.verb or ""].noun, KNOWN[verb].noun == next(iter(DEVICE_VERBS.values()))
        named = clause.entity is not None and clause.entity.noun == kind
        bare = clause.entity is not None and clause.entity.noun is None and bool(clause.entity.colors)
        if own and own != kind and pressed and bare and not world.cells:  # "turn the gray one"
            return replace(plan, failure="unturnable", reason="never", entity=Entity(span=clause.span))
        if own and own != kind and named and not world.cells:  # "turn the knob" is the wheel's
            plan = replace(plan, cost=plan.cost + costs.OF_ANOTHER_DEVICE)
        if pressed and is_operated(world, index) and any(s.object == index for s in plan.steps):
            once = f"{a_name(world, index)} is down then, so I press it once"
            return plan if once in plan.notes else replace(plan, notes=(*plan.notes, once))
        if pressed and is_operated(world, index):
            return replace(
                plan, failure=f"{a_name(world, index)} is down already", reason="already", entity=plan.entity
            )
        return self._added(self._ready(plan), Step(verb, index))

    def _handled(self, plan: Draft, clause: Clause, index: int) -> Iterator[Draft]:
        """Yield the plans that take a thing and, if the clause says where, put it there."""
        world, act = plan.world, clause.act
        held = world.held == index
        if not world.cells and not held and (box := self._other_box(plan, clause, index)) is not None:
            failure = f"{a_name(world, index)} is not in {a_name(world, box)}"
            yield replace(plan, failure=failure, reason="impossible", entity=clause.entity)
            return
        if not held:
            if act is Act.LOWER and not clause.places and world.below[index] is None and index not in world.inside:
                yield replace(plan, failure="the gripper is empty", reason="impossible")
                return
            if act is Act.UNSTACK and not clause.places and world.is_on_ground(index) and not self._moved(plan, index):
                failure = f"{a_name(world, index)} stands on no other thing"
                yield replace(plan, failure=failure, reason="already", entity=None)
                return
            plan = self._made_takeable(plan, index)
            if plan.failure:
                yield plan
                return
        places = self._places(clause, plan)
        board = places and all(anchor.kind == "board" for each in places for anchor in each.anchors or (Entity("it"),))
        if board and not world.cells and world.is_on_ground(index) and self._moved(plan, index):
            yield plan  # it was put on the table by an earlier step
            return
        under = next(
            (each for each in places if each.name == "under" and each.anchors and each.anchors[0].kind == "thing"), None
        )
        if under is not None and not world.cells and act is Act.CARRY:
            yield from self._beneath(plan, under, index)
        elif act in TAKING and not places:
            spoken = clause.entity is None or clause.entity.kind == "it"
            if held and spoken and self._moved(plan, index):
                yield plan  # "grasp it, raise it"
            elif held:
                yield replace(plan, failure=f"the gripper holds {a_name(world, index)} already", reason="impossible")
            else:
                yield self._taken(plan, index, clause.verb)
        elif (act is Act.LOWER and not places) or (
            held and places and places[0].name == "here" and not places[0].anchors
        ):
            yield from self._lowered(plan, clause, index)
        elif act is Act.STORE and not places:
            yield from self._stored(plan, clause, index)
        elif not places:
            yield replace(plan, failure="it is not said where to", reason="where", entity=clause.entity)
        else:
            yield from self._placed(plan, clause, index, places)

    def _moved(self, plan: Draft, index: int) -> bool:
        """Whether an earlier step moves a thing."""
        return any(step.object == index for step in plan.steps)

    def _other_box(self, plan: Draft, clause: Clause, index: int) -> int | None:
        """Return the container from which a clause takes a thing that is not in it; None: there is none."""
        for place in clause.places:
            if place.name == "from" and place.anchors:
                refs = self.resolver(plan.world, plan.it, None, (), plan.box).resolve(place.anchors[0])
                boxes = [ref.things[-1] for ref in refs if ref.things and ref.things[-1] in plan.world.containers]
                if boxes and len(boxes) == len(refs) and plan.world.inside.get(index) not in boxes:
                    return boxes[0]
        return None

    def _made_takeable(self, plan: Draft, index: int) -> Draft:
        """Return the plan with a thing free to be taken, or why it cannot be."""
        world = plan.world
        why = obstacle(world, index)
        over = world.above[index]
        if over is not None and not world.cells and world.is_loose(index):
            plan = self._ready(plan)
            note = f"{a_name(world, over)} stands on it, so I put that on the table first"
            return self._aside(plan, topmost(plan.world, over), note)
        if why or (world.held is not None and world.cells):
            full = "" if world.held is None else f"my gripper holds {a_name(world, world.held)} already"
            return replace(plan, failure=why or full, reason="impossible", candidates=(index,))
        return self._ready(plan, index)

    def _taken(self, plan: Draft, index: int, verb: str | None = None) -> Draft:
        """Return the plan with a thing in the gripper. verb: as it was said; None: nobody said it."""
        box = plan.world.inside.get(index)
        if box is not None and box in plan.world.containers:
            return self._added(plan, Step(bringing("out"), index, box))
        said = verb is not None and KNOWN[verb].act in (Act.TAKE, Act.HOLD)
        return self._added(plan, Step(verb if said and verb else bringing("up"), index))

    def _places(self, clause: Clause, plan: Draft) -> tuple[RelationPhrase, ...]:
        """Return where the clause says that the thing goes; without what says where it comes from."""
        places = tuple(each for each in clause.places if each.name != "from" or plan.world.cells or each.measure)
        if len(places) > 1 and places[0].name == "here" and not places[0].anchors:  # "over there, by the red one"
            places = places[1:]
        if clause.act in TAKING and not plan.world.cells:
            places = tuple(each for each in places if each.value != "up")
        if places or clause.act not in (Act.GIVE, Act.UNSTACK, Act.CARRY):
            return places
        if clause.act is Act.GIVE:
            return (RelationPhrase("at", (Entity("person"),)),)
        if clause.act is Act.UNSTACK or (clause.places and not plan.world.cells):
            return ON_TABLE
        return ()

    def _lowered(self, plan: Draft, clause: Clause, index: int) -> Iterator[Draft]:
        thing = plan.world.things[index]
        if plan.world.cells:
            yield self._put(plan, clause, index, settle(plan.world, index, Point(thing.x, thing.y, 0.0)))
            return
        down = RelationPhrase("direction", value="down")
        yield from self._placed(plan, clause, index, (down,))

    def _beneath(self, plan: Draft, under: RelationPhrase, index: int) -> Iterator[Draft]:
        """Yield the plans that put one thing under another one: the other goes on top of it."""
        for ref in self.resolver(plan.world, plan.it).resolve(under.anchors[0]):
            other = ref.things[-1] if ref.things else None
            if other is None or not plan.world.is_loose(other) or other == index:
                continue
            place = place_at(index, "on")
            yield from self._handled(
                replace(plan, mover=other, cost=plan.cost + ref.cost), Clause(CARRY, None, (place,)), other
            )

    def _stored(self, plan: Draft, clause: Clause, index: int) -> Iterator[Draft]:
        """Yield the plan that puts a thing into a container that has room, an open one first."""
        free = [box for box in plan.world.containers if not plan.world.contents(box)]
        if not free:
            full = " and ".join(a_name(plan.world, box) for box in plan.world.containers)
            failure = f"{full} are full" if full else "there is nothing here to put it into"
            yield replace(plan, failure=failure, reason="impossible", entity=clause.entity)
            return
        boxes = [box for box in free if box in plan.world.open] or free[:1]
        for box in (plan.box,) if plan.box in free else boxes:
            place = RelationPhrase("in", (Entity(noun=plan.world.things[box].kind, pointed=Gesture((box,))),))
            yield from self._placed(plan, clause, index, (place,))

    def _tower(self, plan: Draft) -> int | None:
        """Return what was put on another thing last, in this sentence or before it; None if that was put elsewhere."""
        flat = not any(below is not None for below in plan.world.below)  # then "on top" is on what was put down last
        before = [i for i in self.carried[:1] if not plan.steps and (flat or plan.world.below[i] is not None)]
        return next(iter(before), stacked_last(plan)) if not plan.world.cells else stacked_last(plan)

    def _placed(self, plan: Draft, clause: Clause, index: int, places: tuple[RelationPhrase, ...]) -> Iterator[Draft]:
        taken = plan.world if plan.world.held == index else self._taken(plan, index).world
        resolver = self.resolver(taken, plan.it, index, plan.mentioned, plan.box)
        if (tower := self._tower(plan)) not in (None, index) and says_top(places[0]):  # "and the blue one on top"
            places = (place_at(tower, "on"), *places[1:])
        resolver.rest = old_place(self.world, plan.world, index, self.rests)
        if any(anchor.any for place in places for anchor in place.anchors):
            plan = replace(plan, arbitrary=True)
        typed = clause.entity is not None and clause.entity.noun is not None
        resolver.aloft = plan.world.held == index or plan.world.below[index] is not None or index in plan.world.inside
        if places[0].name == "here" and not places[0].anchors and (vacated := self._vacated(plan, index)) is not None:
            places = (vacated, *places[1:])
        weighed = resolver.weighed
        found = spots(resolver, index, places, typed)
        self._spend((resolver.weighed - weighed) // POINTS + min(len(found), KEPT) // 3)
        if places[0].name == "here" and not places[0].anchors:
            pronoun = (RelationPhrase("at", (Entity("it"),)),)
            if plan.it and plan.world.things[plan.it[0]].target:
                found = spots(resolver, index, pronoun, typed)
            elif plan.box is not None and not plan.world.cells:
                found = spots(resolver, index, (RelationPhrase("into"),), typed)
            elif self.carried and index not in self.carried and not plan.world.cells:  # where the last one went
                found = spots(resolver, index, (place_at(self.carried[0], "near"),), typed)
            else:
                yield replace(plan, failure="no gesture shows the place", reason="where", entity=clause.entity)
                return
        anchor = places[0].anchors[0] if places[0].anchors else clause.entity
        itself = anchor is not None and anchor.kind == "it"
        others = tuple(i for i in self.recent if i != index)
        if not found and itself and others:  # "put it next to it", after both were named
            found = spots(resolver, index, (place_at(others[0], places[0].name), *places[1:]), typed)
        if not found:
            reason = ("impossible" if self.it else "where") if itself else "nowhere"
            own = itself and plan.it[:1] in ((), (index,))
            why = "nothing goes on, in or next to itself" if own else "no place fits"
            yield replace(plan, failure=why, reason=reason, entity=anchor)
        for spot in found[:KEPT]:
            yield self._put(plan, clause, index, spot)

    def _vacated(self, plan: Draft, index: int) -> RelationPhrase | None:
        """Return the place that an earlier step left: "take the red one away, put this there"."""
        moved = next((step.object for step in reversed(plan.steps) if step.object != index), None)
        if moved is None or not self.world.is_loose(moved) or moved == self.world.held:
            return None
        if moved in self.world.inside:
            from_hand = self.world.inside[moved] == self.world.hand
            return RelationPhrase("at", (Entity("person"),)) if from_hand else None
        below, thing = self.world.below[moved], self.world.things[moved]
        if below is not None:
            return place_at(below, "on")
        return point_at(thing.x, thing.y)

    def _put(self, plan: Draft, clause: Clause, index: int, spot: Spot) -> Draft:
        """Return the plan with a thing taken, unless it is held, and put at a spot."""
        moved = [done.object for done in plan.steps if done.carries and not done.implied]
        back, on = any(place.name == "home" for place in clause.places), spot.on
        stays = back and index not in (*moved, plan.world.held) and self._same_place(index, spot)
        if stays or (on is not None and plan.world.inside.get(index) == on):
            where = "where it was" if stays or on is None else f"in {a_name(plan.world, on)}"
            note = f"{a_name(plan.world, index)} is {where} already"
            idle = not stays and all(step.implied for step in plan.steps)
            return replace(plan, notes=(*plan.notes, note), cost=plan.cost + costs.NO_CHANGE * idle)
        if spot.why_not:
            return replace(plan, failure=spot.why_not, reason="impossible", cost=plan.cost + spot.cost)
        returns = index in moved and back
        cost = spot.cost + costs.NO_CHANGE * (self._same_place(index, spot) and not returns)
        cost += costs.MOVED_TWICE * (index in moved and not returns)
        cost += costs.ANOTHER_OBJECT * any(other != index for other in moved)
        if index == self.world.held and plan.world.cells:
            thing = self.world.things[index]
            away = max(abs(thing.x - spot.x), abs(thing.y - spot.y)) > 0.5 * self.world.pitch
            cost += costs.NOT_BELOW * away
        if on is not None and on in plan.world.containers and on not in plan.world.open:
            plan = self._opened_first(plan, on)
        if plan.world.held != index:
            plan = self._taken(plan, index)
        verb = self._verb(plan.world, clause, on)
        marked = spot.anchor is not None and plan.world.things[spot.anchor].target
        step = Step(verb, index, spot.anchor if on is None and marked else on, (spot.x, spot.y), spot.bottom)
        notes = tuple(dict.fromkeys((*plan.notes, spot.note))) if spot.note else plan.notes
        box = on if on in plan.world.containers else plan.box
        anchor = spot.anchor if on is None else on
        return replace(self._added(plan, step), cost=plan.cost + cost, notes=notes, box=box, anchor=anchor)

    def _verb(self, world: WorldModel, clause: Clause, goal: int | None) -> str:
        """Return the verb of a step that brings something somewhere."""
        if goal is not None and goal in world.containers:
            return bringing("in")
        if goal is not None and goal == world.hand:
            return bringing("hand")
        if goal is not None and world.is_loose(goal):
            return bringing("on")
        own = clause.verb or ""
        if clause.instruction is not None and KNOWN[own].act is Act.UNSTACK:
            return own
        if KNOWN[own].effect == "goal" and (own in world.verbs if world.verbs is not None else own not in ROOM):
            return own
        return bringing("goal")

    def _same_place(self, index: int, spot: Spot) -> bool:
        """Return whether a thing that was not held stands there at the beginning."""
        thing = self.world.things[index]
        close = 0.3 * self.world.pitch if self.world.cells else 0.004
        away = max(abs(thing.x - spot.x), abs(thing.y - spot.y), abs(thing.bottom - spot.bottom))
        return index != self.world.held and away < close


def obstacle(world: WorldModel, index: int) -> str:
    """Return why a thing cannot be taken, or ""."""
    thing, over = world.things[index], world.above[index]
    if over is not None:
        upper = world.things[over]
        return f"the {thing.color} {thing.kind} is under the {upper.color} {upper.kind}"
    if thing.kind in FIXED:
        return f"the {thing.color} {thing.kind} is fixed"
    return f"the see-through {thing.kind} only marks a place" if thing.target else ""


def topmost(world: WorldModel, index: int) -> int:
    """Return what stands above all in the tower of a thing."""
    while (over := world.above[index]) is not None:
        index = over
    return index


def stacked_last(plan: Draft) -> int | None:
    """Return what the last step put on another thing; None if it put nothing there."""
    last = plan.steps[-1] if plan.steps else None
    on = last is not None and last.carries and last.goal is not None and plan.world.is_loose(last.goal)
    return last.object if last is not None and on else None


def different(layer: list[Draft]) -> list[Draft]:
    """Return the first of the plans that differ in nothing but their cost."""
    found: dict[tuple, Draft] = {}
    for plan in layer:
        said = (plan.steps, plan.it, plan.mentioned, plan.box, plan.failure, plan.reason, plan.entity, plan.topic)
        found.setdefault((*said, plan.candidates, plan.mover if plan.failure else None), plan)
    return list(found.values())


def allows(world: WorldModel, act: Act | None, index: int) -> bool:
    """Whether a verb can act on a thing of this kind."""
    if act in BOXES:
        return index in world.containers
    if act is Act.OPERATE:
        return index in world.devices
    if act in LOOSE:
        return world.is_loose(index)
    return act is Act.TOUCH or index != world.hand


def reached(plan: Draft) -> tuple:
    """Return the effects of a plan, for comparison: where things end, what is held, and all other steps."""
    acts = tuple((each.verb, each.object) for each in plan.steps if not (each.takes or each.carries))
    ends = {each.object: (each.place, each.bottom) for each in plan.steps if each.takes or each.carries}
    rounded = tuple(
        (i, (round(p[0], 2), round(p[1], 2), round(z or 0.0, 2)) if p else None) for i, (p, z) in sorted(ends.items())
    )
    return plan.world.held, rounded, acts


def finished(plan: Draft) -> Draft:
    """Return the plan, or why it is none: a phrase still waits for its verb."""
    if not plan.failure and not plan.steps and plan.notes:
        return replace(plan, failure=plan.notes[0], reason="already")
    return plan if plan.failure or plan.topic is None else unsaid(plan, plan.topic)


def unsaid(plan: Draft, topic: Clause) -> Draft:
    """Return that it is not said what to do with a phrase."""
    return replace(plan, failure="it is not said what to do with it", reason="what", entity=topic.entity)
