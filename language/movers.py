"""The things that one clause may concern: those that its phrase names, what "it" means, or what is held."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from language import costs
from language.meanings import Clause, Entity
from language.referents import Ref, color_fits
from language.steps import BOXES, LOOSE, Draft, Steps, allows, obstacle
from language.verbs import Act
from language.world import WorldModel


class Movers(Steps):
    """Find what a clause concerns."""

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
        if act in LOOSE and not named and not plan.steps:  # "put the cube in and close it", "put it back"
            named = [i for i in self.recent[:3] if allows(world, act, i)][:1]
        if act is Act.UNSTACK and world.held is not None:  # that stands on nothing
            named = [i for i in (*self.recent, *self._unnamed(plan, act)) if world.below[i] is not None][:1] or named
        if (
            act in (Act.UNSTACK, Act.REMOVE) and named and world.is_on_ground(named[0])
        ):  # "take it off" of the lower one
            named = [named[0] if (upper := world.above[named[0]]) is None else upper]
        if act in BOXES and plan.box is not None and not named:
            named = [plan.box]
        if act is Act.OPERATE and not named and clause.entity is not None and world.held in plan.it[:1]:  # "flip it"
            yield replace(plan, mover=world.held, failure="unturnable", reason="never")
            return
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
            yield replace(plan, failure="which thing is meant", reason="which", entity=named_by)
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
        if entity.superlative == "high" and not any(below is not None for below in world.below):
            refs = [ref._replace(cost=ref.cost + 2 * costs.UPPER_SIDE) for ref in refs]  # no tower has a top
        if act is None or not self.help:
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
        named = plan.box is not None and bool(plan.steps)  # "open the fridge, give me the cube"
        if named and len(usable) > 1 and not entity.any:
            inside = [ref for ref in usable if world.inside.get(ref.things[-1]) == plan.box]
            usable = inside if len(inside) == 1 else usable
        if len(usable) > 1 and act is Act.REMOVE:  # "take the other one out"
            usable = [ref for ref in usable if world.inside.get(ref.things[-1]) in world.containers] or usable
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
        return not obstacle(world, index)

    def _fits_held(self, plan: Draft, entity: Entity | None) -> bool:
        """Whether a phrase may mean the held thing."""
        held = plan.world.held
        if plan.world.cells and held is not None:
            return entity is None or all(color_fits(plan.world, held, color) for color in entity.colors)
        if entity is None or held is None or entity.kind == "it":
            return True
        if entity.kind != "thing" or entity.other or entity.every or (entity.number or 1) > 1:
            return False
        thing = plan.world.things[held]
        if entity.noun not in (None, thing.kind) or not all(color_fits(plan.world, held, c) for c in entity.colors):
            return False
        if entity.relations or entity.superlative or entity.sides or entity.ordinal or entity.role == "target":
            return any(ref.things[-1:] == (held,) for ref in self.resolver(plan.world, plan.it).resolve(entity))
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
