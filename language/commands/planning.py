"""Plans of a reading in a world: its things and places, with every precondition checked in sequence."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from language.commands import costs
from language.commands.meanings import Entity, Gesture, Reading, Relation, Step
from language.commands.outcomes import CONTROLS, Action
from language.commands.places import Point, Spot, settle, spots
from language.commands.plans import Plan, at_a_mark, beside, for_several, implied_places, obstacle
from language.commands.referents import Ref, color_fits
from language.commands.resolving import Resolver
from language.commands.world import DEVICES, World
from language.commands.worlds import Worlds
from language.errors import NotUnderstood

KEPT = 12  # plans of the steps so far
# Effort: phrases that are weighed and actions that are tried for one sentence, of about 0.03 ms each.
ENOUGH_EFFORT = 700  # after this, no further readings are weighed if one can be carried out
POINTS = 8  # points of places that are compared with a further relation for the same effort
MOST_EFFORT = 900  # after this, the sentence is refused

Resolvers = dict[tuple, Resolver]


@dataclass
class Planner:
    """Plans readings in one world. it, mentioned: the things of the dialogue.

    help: whether the scene helps to select. gestures: those of the sentence, in order.
    effort: phrases weighed and actions tried so far.
    """

    world: World
    it: tuple[int, ...] = ()
    mentioned: tuple[int, ...] = ()
    help: bool = True
    gestures: tuple[Gesture, ...] = ()
    effort: int = 0
    _resolvers: Resolvers = field(default_factory=dict)
    _usable: dict[int, object] = field(default_factory=dict)
    _sequences: dict[tuple, list[Plan]] = field(default_factory=dict)
    _worlds: Worlds = field(default_factory=Worlds)

    def plans(self, reading: Reading) -> list[Plan]:
        """Returns the plans of a reading, the cheapest first; those that fail come last and say why."""
        steps = reading.steps
        if reading.condition is not None and not self.resolver(self.world, self.it, None).resolve(reading.condition):
            steps = reading.otherwise or (Step("nothing", span=reading.condition.span),)
        elif reading.condition is not None:
            refs = self.resolver(self.world, self.it, None).resolve(reading.condition)
            self.it = refs[0].things
        return self._sequence(steps, last=True)

    def _sequence(self, steps: tuple[Step, ...], last: bool) -> list[Plan]:
        """Returns the plans of steps, which readings share. last: whether no step follows."""
        if not steps:
            return [Plan(self.world, it=self.it, mentioned=self.mentioned)]
        key = (steps, last, self.it)
        if key not in self._sequences:
            step = steps[-1]
            if step.action == "move" and not step.places and not last:
                step = replace(step, action="take")  # "move the cube and put it there"
            layer = [after for plan in self._sequence(steps[:-1], False) for after in self._after(plan, step)]
            layer.sort(key=lambda plan: (bool(plan.failure), plan.cost))
            self._sequences[key] = layer[:KEPT]
        return self._sequences[key]

    def resolver(
        self, world: World, it: tuple[int, ...], origin: int | None, mentioned: tuple[int, ...] = ()
    ) -> Resolver:
        """Returns the resolver of a world; phrases that were resolved in it before are not resolved again."""
        key = (id(world), it, origin, mentioned)
        if key not in self._resolvers:  # a resolver keeps its world, so that the id stays its own
            self._resolvers[key] = Resolver(world, it, mentioned or self.mentioned, origin)
        return self._resolvers[key]

    def judge(self, entity: Entity) -> float:
        """Returns the cost of what a phrase denotes in the first world; for the chart."""
        self._spend()
        if entity.kind in ("it", "robot", "person", "board", "cell", "gap", "fixture", "side", "center", "edge"):
            return 0.0
        if self.world.held is not None or entity.other or isinstance(entity.pointed, int):
            return 0.0
        refs = self.resolver(self.world, self.it, None).resolve(entity)
        return refs[0].cost if refs else costs.EMPTY

    def _spend(self, amount: int = 1) -> None:
        """Raises NotUnderstood if a sentence takes too much effort."""
        self.effort += amount
        if self.effort > MOST_EFFORT:
            raise NotUnderstood("the sentence can be read in too many ways; say it in several shorter sentences")

    def _after(self, plan: Plan, step: Step) -> Iterator[Plan]:
        if plan.failure:
            yield plan
        elif step.action in CONTROLS or step.action == "nothing":
            yield replace(plan, actions=(*plan.actions, Action(step.action)))
        elif step.entity is not None and step.entity.kind == "fixture":
            yield self._fixture(plan, step)
        elif step.entity is not None and (step.entity.every or (step.entity.number or 1) > 1):
            yield self._each(plan, step)
        else:
            for mover in self._movers(plan, step):
                done = [mover] if mover.failure or mover.mover is None else self._act(mover, step)
                yield from (replace(each, it=(mover.mover,)) if mover.mover is not None else each for each in done)
            if step.entity is not None and step.entity.is_bare_plural:
                yield from self._all(plan, step, step.entity)

    def _all(self, plan: Plan, step: Step, entity: Entity) -> Iterator[Plan]:
        """Yields the plan that does the step for all things of a plural, if several fit it."""
        done = self._each(plan, replace(step, entity=replace(entity, every=True)))
        if not done.failure and len(done.it) > 1:
            one = min((ref.cost for ref in self._refs(plan, step, entity) if ref.kind == "thing"), default=0.0)
            yield replace(done, cost=plan.cost + one + costs.ALL_OF_PLURAL)

    def _fixture(self, plan: Plan, step: Step) -> Plan:
        assert step.entity is not None
        name = step.entity.noun or ""
        if name not in plan.world.fixtures or step.action not in ("open", "close"):
            unknown = name not in plan.world.fixtures
            what = f"there is no {name} here" if unknown else f"the {name} can be opened and closed"
            return replace(plan, failure=what, reason="nothing", entity=step.entity)
        return replace(plan, actions=(*plan.actions, Action(step.action, fixture=name)))

    def _each(self, plan: Plan, step: Step) -> Plan:
        """Returns the plan that does the step for every thing of the phrase, one after the other."""
        assert step.entity is not None
        refs = self.resolver(plan.world, plan.it, None, plan.mentioned).resolve(step.entity)
        things = list(dict.fromkeys(i for ref in refs for i in ref.things if ref.cost <= refs[0].cost + 0.5))
        things = [i for i in things if not plan.world.things[i].target] or things  # "all cubes" moves the real ones
        wanted = step.entity.number
        if not things or (wanted and len(things) < wanted):
            return replace(plan, failure=f"{len(things)} things fit", reason="nothing", entity=step.entity)
        if wanted and len(things) > wanted and not step.entity.every:
            return replace(
                plan,
                failure=f"{len(things)} things fit",
                reason="several",
                entity=step.entity,
                candidates=tuple(things),
            )
        if step.action == "take" and len(things) > 1:
            return replace(
                plan, failure="the gripper holds one thing at a time", reason="impossible", entity=step.entity
            )
        things.sort(key=lambda i: -plan.world.things[i].bottom)
        before = len(plan.actions)
        for index in things:
            part = beside(step) if at_a_mark(plan) else step
            found = [done for done in self._act(replace(plan, mover=index), part) if not done.failure]
            if not found:
                failed = next(iter(self._act(replace(plan, mover=index), part)), plan)
                return replace(
                    failed, failure=failed.failure or "there is no place for all of them", reason="impossible"
                )
            plan = min(found, key=lambda done: done.cost)
        return for_several(replace(plan, it=tuple(things), mentioned=tuple(things)), before)

    def _movers(self, plan: Plan, step: Step) -> Iterator[Plan]:
        """Yields the plan with each thing that the step may concern as its mover."""
        entity, held = step.entity, plan.world.held
        if held is not None and step.action in ("move", "drop", "give", "push", "remove"):
            cost = self._held_cost(plan.world, held, entity)
            yield replace(plan, mover=held, cost=plan.cost + cost, mentioned=(held,), entity=entity)
            return
        if entity is None or entity.kind == "it":
            if not plan.it:
                why = "nothing was mentioned that 'it' may mean; name it, or point at it and say 'this'"
                yield replace(plan, failure=why, reason="dialogue", entity=entity)
            else:
                yield replace(plan, mover=plan.it[0], entity=entity)
            return
        refs = self._refs(plan, step, entity)
        if not refs:
            yield replace(plan, failure="nothing fits", reason="nothing", entity=entity)
        for ref in refs:
            if not ref.things:
                yield replace(plan, failure="that is a place and no thing", reason="nothing", entity=entity)
                continue
            index, cost = ref.things[-1], plan.cost + ref.cost
            arbitrary = plan.arbitrary or entity.any
            yield replace(plan, mover=index, cost=cost, entity=entity, mentioned=(index,), arbitrary=arbitrary)

    def _refs(self, plan: Plan, step: Step, entity: Entity) -> list[Ref]:
        resolver = self.resolver(plan.world, plan.it, None, plan.mentioned)
        refs = resolver.resolve(entity)
        if self.help and step.action in ("take", "move", "push", "remove", "give"):
            usable = self._usable.setdefault(id(resolver), lambda ref: not obstacle(plan.world, ref.things[-1:]))
            free = resolver.resolve(entity, usable)  # type: ignore[arg-type]
            known = {ref.things for ref in refs}
            refs = refs + [ref._replace(cost=ref.cost + costs.ONLY_USABLE) for ref in free if ref.things not in known]
        return refs

    def _held_cost(self, world: World, held: int, entity: Entity | None) -> float:
        """Returns the cost of a phrase for the held thing: how badly it fits."""
        if entity is None or entity.kind == "it":
            return 0.0
        thing = world.things[held]
        cost = 0.0 if entity.kind == "thing" else 3.0
        cost += 3.0 * (entity.noun not in (None, thing.kind))
        cost += 3.0 * (not all(color_fits(world, held, color) for color in entity.colors))
        return cost + sum(0.7 for relation in entity.relations if relation.name != "held")

    def _act(self, plan: Plan, step: Step) -> Iterator[Plan]:
        """Yields the plans that carry out a step with the plan's mover."""
        assert plan.mover is not None
        self._spend()
        index, action = plan.mover, step.action
        device = plan.world.things[index].kind in DEVICES
        if action == "push" and not step.places and device:
            action = "press"
        if action in ("reach", "press", "switch", "turn"):
            wrong = action in ("press", "switch") and not device
            failure = f"a {plan.world.things[index].kind} cannot be {action}ed" if wrong else ""
            reason = "impossible" if failure else ""
            yield replace(plan, actions=(*plan.actions, Action(action, index)), failure=failure, reason=reason)
        elif action in ("take", "move", "push", "remove", "give", "drop", "unstack"):
            yield from self._handled(plan, step, index)
        else:
            name = plan.world.things[index].kind
            yield replace(plan, failure=f"'{action}' does not go with a {name}", reason="impossible")

    def _handled(self, plan: Plan, step: Step, index: int) -> Iterator[Plan]:
        """Yields the plans that take a thing and, if the step says where, put it there."""
        held = plan.world.held == index
        if not held:
            if step.action == "drop" and not step.places:
                yield replace(plan, failure="the gripper is empty", reason="impossible")
                return
            why = obstacle(plan.world, (index,)) or ("the gripper is full" if plan.world.held is not None else "")
            if why:
                yield replace(plan, failure=why, reason="impossible", candidates=(index,))
                return
            kind = "take" if step.action != "push" else "push"
            if kind == "take":
                plan = replace(plan, actions=(*plan.actions, Action("take", index)))
            plan = replace(plan, world=self._worlds.taken(plan.world, index))
        places = step.places or implied_places(step)
        if step.action in ("take", "remove") and not step.places:
            if held:
                yield replace(plan, failure="the gripper holds it already", reason="impossible")
            else:
                yield plan
        elif (step.action == "drop" and not places) or (
            held and places and places[0].name == "here" and not places[0].anchors
        ):
            thing = plan.world.things[index]
            yield self._put(plan, step, index, settle(plan.world, index, Point(thing.x, thing.y, 0.0)))
        elif not places:
            yield replace(plan, failure="it is not said where to", reason="where", entity=step.entity)
        else:
            yield from self._placed(plan, step, index, places)

    def _placed(self, plan: Plan, step: Step, index: int, places: tuple[Relation, ...]) -> Iterator[Plan]:
        resolver = self.resolver(plan.world, plan.it, index, plan.mentioned)
        if any(anchor.any for place in places for anchor in place.anchors):
            plan = replace(plan, arbitrary=True)
        typed = step.entity is not None and step.entity.noun is not None
        weighed = resolver.weighed
        found = spots(resolver, index, places, typed)
        self._spend((resolver.weighed - weighed) // POINTS)
        if places[0].name == "here" and not places[0].anchors:
            yield replace(plan, failure="no gesture shows the place", reason="where", entity=step.entity)
        elif not found:
            anchor = places[0].anchors[0] if places[0].anchors else step.entity
            reason = "impossible" if anchor is not None and anchor.kind == "it" else "nowhere"
            yield replace(plan, failure="no place fits", reason=reason, entity=anchor)
        for spot in found[:KEPT]:
            yield self._put(plan, step, index, spot)

    def _put(self, plan: Plan, step: Step, index: int, spot: Spot) -> Plan:
        if spot.why_not:
            return replace(plan, failure=spot.why_not, reason="impossible", cost=plan.cost + spot.cost)
        cost = spot.cost
        if self._same_place(index, spot):
            cost += costs.NO_CHANGE
        moved = [done.object for done in plan.actions if done.kind == "place"]
        cost += costs.MOVED_TWICE * (index in moved) + costs.ANOTHER_OBJECT * any(other != index for other in moved)
        if index == self.world.held:
            thing = self.world.things[index]
            away = max(abs(thing.x - spot.x), abs(thing.y - spot.y)) > 0.5 * self.world.pitch
            cost += costs.NOT_BELOW * away
        kind = "push" if step.action == "push" else "place"
        action = Action(kind, index, (spot.x, spot.y), spot.bottom, spot.on)
        return replace(
            plan,
            world=self._worlds.moved(plan.world, index, spot),
            actions=(*plan.actions, action),
            cost=plan.cost + cost,
        )

    def _same_place(self, index: int, spot: Spot) -> bool:
        """Returns whether a thing that was not held stands there at the beginning."""
        thing = self.world.things[index]
        close = 0.3 * self.world.pitch
        away = max(abs(thing.x - spot.x), abs(thing.y - spot.y), abs(thing.bottom - spot.bottom))
        return index != self.world.held and away < close
