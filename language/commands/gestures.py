"""Gestures: what a person points at while saying "this", "that", "here" or "there"."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from language.commands.meanings import Entity, Gesture, Reading, Relation, Step
from language.commands.world import World
from language.errors import LanguageError

Pointed = Sequence[int | Sequence[int] | Gesture]


def gestures(pointed: Pointed, world: World) -> tuple[Gesture, ...]:
    """Returns gestures: an index is the thing that one shows, several are those that it may show.

    Raises LanguageError for indices that the world does not have.
    """
    found = []
    for each in pointed:
        gesture = each if isinstance(each, Gesture) else Gesture(_indices(each))
        if not all(0 <= index < len(world.things) for index in gesture.things):
            raise LanguageError(f"pointed={list(pointed)} is out of range: the scene has {len(world.things)} objects")
        found.append(gesture)
    return tuple(found)


def _indices(things: int | Sequence[int]) -> tuple[int, ...]:
    return tuple(things) if isinstance(things, Sequence) else (int(things),)


def pointing_words(reading: Reading) -> list[int]:
    """Returns the tokens of a reading's words that need a gesture, in the order of the sentence."""
    phrases = [phrase for step in (*reading.steps, *reading.otherwise) for phrase in _phrases(step)]
    phrases += [reading.condition] if reading.condition is not None else []
    return sorted({token for phrase in phrases for token in _tokens(phrase)})


def needs_gesture(phrase: Entity) -> bool:
    """Returns whether a word of the phrase needs a gesture that is not known yet."""
    return next(_tokens(phrase), None) is not None


def _phrases(step: Step) -> list[Entity]:
    return [*([step.entity] if step.entity else []), *(anchor for place in step.places for anchor in place.anchors)]


def _tokens(phrase: Entity) -> Iterator[int]:
    if isinstance(phrase.pointed, int):
        yield phrase.pointed
    for relation in phrase.relations:
        for anchor in relation.anchors:
            yield from _tokens(anchor)


def bound(reading: Reading, made: Sequence[Gesture]) -> Reading:
    """Returns the reading with each gesture in the place of its word; the last one serves for all further words."""
    words = pointing_words(reading)
    if not words or not made:
        return reading
    meant = {word: made[min(number, len(made) - 1)] for number, word in enumerate(words)}
    condition = reading.condition and _entity(reading.condition, meant)
    steps = tuple(_step(step, meant) for step in reading.steps)
    otherwise = tuple(_step(step, meant) for step in reading.otherwise)
    return replace(reading, steps=steps, condition=condition, otherwise=otherwise)


def _step(step: Step, meant: dict[int, Gesture]) -> Step:
    entity = step.entity and _entity(step.entity, meant)
    return replace(step, entity=entity, places=tuple(_relation(place, meant) for place in step.places))


def _relation(relation: Relation, meant: dict[int, Gesture]) -> Relation:
    return replace(relation, anchors=tuple(_entity(anchor, meant) for anchor in relation.anchors))


def _entity(entity: Entity, meant: dict[int, Gesture]) -> Entity:
    pointed = meant[entity.pointed] if isinstance(entity.pointed, int) else entity.pointed
    return replace(entity, pointed=pointed, relations=tuple(_relation(each, meant) for each in entity.relations))
