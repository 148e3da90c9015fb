"""A plan: the actions of a reading and the world after them, or why it cannot be carried out."""

from __future__ import annotations

from dataclasses import dataclass, replace

from language.commands.meanings import Entity, Relation, Step
from language.commands.outcomes import Action
from language.commands.places import ONTO
from language.commands.world import DEVICES, World


@dataclass(frozen=True)
class Plan:
    """The actions so far, the world after them, and their cost.

    mover: the thing of the current step. it: the things that "it" means next.
    failure, reason: why the plan cannot be carried out. entity: the phrase that it is about.
    """

    world: World
    actions: tuple[Action, ...] = ()
    cost: float = 0.0
    mover: int | None = None
    it: tuple[int, ...] = ()
    mentioned: tuple[int, ...] = ()
    failure: str = ""
    reason: str = ""
    entity: Entity | None = None
    candidates: tuple[int, ...] = ()
    arbitrary: bool = False


def obstacle(world: World, things: tuple[int, ...]) -> str:
    """Returns why a thing cannot be taken, or ""."""
    if not things:
        return "that is no thing"
    thing = world.things[things[0]]
    over = world.above[things[0]]
    if over is not None:
        upper = world.things[over]
        return f"the {thing.color} {thing.kind} is under the {upper.color} {upper.kind}"
    if thing.kind in DEVICES:
        return f"a {thing.kind} is fixed to the table"
    return "a see-through object only marks a place" if thing.target else ""


def at_a_mark(plan: Plan) -> bool:
    """Returns whether the last thing was put where a see-through thing marks a place, or beside it."""
    last = plan.actions[-1] if plan.actions else None
    if last is None or last.kind != "place" or last.position is None or last.on is not None:
        return False
    (x, y), world = last.position, plan.world
    return any(each.target and max(abs(each.x - x), abs(each.y - y)) < 2 * each.width for each in world.things)


def beside(step: Step) -> Step:
    """Returns the step for a further thing: beside the place, where the first one lies."""
    onto = [place.name in ONTO for place in step.places]
    places = [replace(place, name="near") if at else place for place, at in zip(step.places, onto, strict=True)]
    return replace(step, places=tuple(places))


def for_several(plan: Plan, first: int) -> Plan:
    """Returns the plan with its actions from the first on marked as those for several things."""
    actions = *plan.actions[:first], *(replace(each, several=True) for each in plan.actions[first:])
    return replace(plan, actions=actions)


def implied_places(step: Step) -> tuple[Relation, ...]:
    """Returns the place that a verb implies."""
    if step.action == "give":
        return (Relation("at", (Entity("person"),)),)
    if step.action == "unstack":
        return (Relation("on", (Entity("board"),)),)
    return ()
