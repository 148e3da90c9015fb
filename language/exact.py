"""Readings of the project's own language: `language.parse` names exactly one object with each phrase."""

from __future__ import annotations

from collections.abc import Sequence

from language.errors import LanguageError
from language.instruction import Correction, ObjectPhrase
from language.meanings import Clause, Entity, Gesture, Reading, RelationPhrase
from language.understanding import parse, understand
from language.verbs import KNOWN
from language.world import WorldModel


def exact_reading(
    sentence: str, world: WorldModel, pointed: Sequence[int] = (), spoken: Sequence[int] = ()
) -> Reading | None:
    """Returns the reading of a sentence that the own language understands in the world's scene, or None.

    pointed: the thing of each gesture. spoken: the things that were spoken of before, the likeliest of "it" first.
    """
    if world.scene is None:
        return None
    try:
        meaning = parse(sentence)
        if isinstance(meaning, Correction) or any(_is_bare(step.goal) for step in meaning.steps):
            return None
        understood = understand(meaning, world.scene, pointed, spoken)
    except LanguageError:
        return None
    clauses = []
    for step, instruction in zip(understood.steps, understood.instructions, strict=True):
        thing = step.goal if step.init is None else step.init
        assert thing is not None
        goal = step.goal if step.init is not None and KNOWN[step.task].takes_goal else None
        several = len(understood.steps) > len(meaning.steps)
        clauses.append(_clause(world, step.task, thing, goal, instruction, several))
    return Reading(tuple(clauses))


def _is_bare(goal: ObjectPhrase | None) -> bool:
    """Whether a place is a superlative alone: "to the right" is a direction, not the rightmost thing."""
    return goal is not None and goal.superlative is not None and goal.noun is None and goal.color is None


def _named(world: WorldModel, index: int) -> Entity:
    thing = world.things[index]
    role = "target" if thing.target else None
    return Entity(noun=thing.kind, colors=((thing.color,),), role=role, pointed=Gesture((index,)))


def _clause(world: WorldModel, task: str, thing: int, goal: int | None, instruction: object, several: bool) -> Clause:
    entity = _named(world, thing)
    places: tuple[RelationPhrase, ...] = ()
    if goal is not None:
        effect = KNOWN[task].effect
        name = {"out": "from", "goal": "spot_of"}.get(effect, "on" if effect == "on" else "in")
        places = (RelationPhrase(name, (_named(world, goal),)),)
    return Clause(task, entity, places, instruction=None if several else instruction, several=several)
