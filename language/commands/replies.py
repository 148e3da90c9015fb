"""Revised readings: the last reading with the changes of an answer or a correction."""

from __future__ import annotations

from dataclasses import replace

from language.commands.meanings import Entity, Reading, Relation, Step


def revised(last: Reading, reply: Reading) -> list[Reading]:
    """Returns the readings that a reply may mean, the likeliest first.

    A phrase replaces the object of the last step that names one; it keeps the noun and colour that it does not say.
    A place replaces the place; "it" and "that" in it mean the former anchor.
    """
    step = reply.steps[0]
    if step.entity is not None:
        steps = [_with_object(last.steps, phrase) for phrase in _completed(last.steps, step.entity)]
        return [Reading(each) for each in steps if each is not None]
    old = last.steps[-1]
    places = tuple(_anchored(place, old.places) for place in step.places)
    placed = Step("move" if old.action in ("take", "fragment") else old.action, old.entity, places, old.span)
    return [Reading((*last.steps[:-1], placed))]


def _object_step(steps: tuple[Step, ...]) -> int | None:
    """Returns the index of the last step that names its object."""
    for at in range(len(steps) - 1, -1, -1):
        entity = steps[at].entity
        if entity is not None and entity.kind != "it":
            return at
    return None


def _with_object(steps: tuple[Step, ...], entity: Entity) -> tuple[Step, ...] | None:
    at = _object_step(steps)
    return None if at is None else (*steps[:at], replace(steps[at], entity=entity), *steps[at + 1 :])


def _completed(steps: tuple[Step, ...], new: Entity) -> list[Entity]:
    """Returns the new phrase with the words of the old one that it lacks: noun and colour, noun, or nothing."""
    at = _object_step(steps)
    old = None if at is None else steps[at].entity
    if old is None or new.noun is not None or new.kind != "thing":
        return [new]
    noun = replace(new, noun=old.noun)
    if new.colors:
        return [noun, new]
    return [replace(noun, colors=old.colors), noun, new]


def _anchored(place: Relation, old: tuple[Relation, ...]) -> Relation:
    """Returns a place whose "it" is the anchor of the former place."""
    anchors = old[0].anchors if old else ()
    if anchors and any(anchor.kind == "it" for anchor in place.anchors):
        return replace(place, anchors=tuple(anchors[0] if a.kind == "it" else a for a in place.anchors))
    return place
