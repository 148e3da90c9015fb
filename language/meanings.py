"""Meanings of people's commands before they are compared with a scene, and the gestures that go with them.

Meanings are compared by identity and never changed after they were made (a frozen dataclass takes three times as long
to make); `span` is its range of tokens.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from language.errors import LanguageError
from language.verbs import KNOWN, Act
from language.world import WorldModel

Span = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Gesture:
    """The things or the place that a person points at.

    things: indices of the things that may be meant. place: x and y of a place, in the world's unit, or None.
    """

    things: tuple[int, ...] = ()
    place: tuple[float, float] | None = None


@dataclass(eq=False, slots=True)
class Measure:
    """A length. unit: "cell", "bit" (a small step), or metres per unit as text."""

    number: float
    unit: str


@dataclass(eq=False, slots=True)
class RelationPhrase:
    """A relation to an anchor, such as "left of the red cube".

    name: a key of `words.RELATIONS`, or "between", "held", "bare", "direction", "here", "into" (the container that was
        spoken of), "home" (where the thing stood before), "not".
    anchors: none, one or two entities. value: a direction, or None. measure: the length, if one is said.
    """

    name: str
    anchors: tuple[Entity, ...] = ()
    measure: Measure | None = None
    value: str | None = None
    span: Span = (0, 0)


@dataclass(eq=False, slots=True)
class Entity:
    """A phrase for things, stacks, regions of the board or a participant.

    kind: "thing", "stack", a key of `words.REGIONS`, "it", "spot" (what a gesture shows) or "list" (all its parts).
    noun: the kind of thing, or None for any.
    colors: each a tuple of the colours that it may mean. sides: words such as "left" and "back".
    superlative: a key of `words.SUPERLATIVES`. ordinal: a rank from 1, or -1 for the last. number: a count.
    every: all that fit. any: any one that fits. single: not in a stack. other: not the one that was mentioned.
    role: one of `language.objects.ROLES`: "target" for what is see-through; None: any.
    plural: whether the noun is a plural. pointed: the gesture that shows it, or, before it is known, the index of the
    word that needs one.
    """

    kind: str = "thing"
    noun: str | None = None
    colors: tuple[tuple[str, ...], ...] = ()
    size: str | None = None
    sides: tuple[str, ...] = ()
    superlative: str | None = None
    ordinal: int | None = None
    number: int | None = None
    every: bool = False
    any: bool = False
    single: bool = False
    other: bool = False
    plural: bool = False
    exposed: bool = False
    pointed: int | Gesture | None = None
    role: str | None = None
    relations: tuple[RelationPhrase, ...] = ()
    parts: tuple[Entity, ...] = ()
    span: Span = (0, 0)

    @property
    def is_bare_plural(self) -> bool:
        """Whether it is a plural that may mean all things that fit: "the red cubes", "red cubes"."""
        counted = self.number or self.ordinal or self.superlative or self.any or self.single or self.every
        return self.kind == "thing" and self.plural and self.pointed is None and not counted


@dataclass(eq=False, slots=True)
class Clause:
    """What one clause asks for: a key of `language.verbs.KNOWN`, or None for a fragment without a verb.

    entity: the object of the verb. places: conjoined relations that say where it goes. negated: it shall not be done.
    instruction: of the project's own language, if it was read exactly. several: whether it is one of "every".
    """

    verb: str | None
    entity: Entity | None = None
    places: tuple[RelationPhrase, ...] = ()
    negated: bool = False
    span: Span = (0, 0)
    instruction: object = None
    several: bool = False

    @property
    def act(self) -> Act | None:
        """What the planner does; None for a fragment."""
        return None if self.verb is None else KNOWN[self.verb].act


@dataclass(eq=False, slots=True)
class Reading:
    """A parse of a whole sentence with its cost, the lower the better.

    condition: an entity that must exist, or else `otherwise` is done. rejects: begins with "no" or the like.
    unused: indices of the tokens that it leaves out, other than words that add nothing. arbitrary: any of the things
    that fit will do. times: how often it is done.
    """

    steps: tuple[Clause, ...]
    cost: float = 0.0
    condition: Entity | None = None
    otherwise: tuple[Clause, ...] = ()
    rejects: bool = False
    unused: tuple[int, ...] = field(default=())
    arbitrary: bool = False
    times: int = 1


Pointed = Sequence[int | Sequence[int] | Gesture]


def gestures(pointed: Pointed, world: WorldModel) -> tuple[Gesture, ...]:
    """Return gestures: an index is the thing that one shows, several are those that it may show.

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
    """Return the tokens of a reading's words that need a gesture, in the order of the sentence."""
    phrases = [phrase for step in (*reading.steps, *reading.otherwise) for phrase in _phrases(step)]
    phrases += [reading.condition] if reading.condition is not None else []
    return sorted({token for phrase in phrases for token in _tokens(phrase)})


def needs_gesture(phrase: Entity) -> bool:
    """Return whether a word of the phrase needs a gesture that is not known yet."""
    return next(_tokens(phrase), None) is not None


def _phrases(step: Clause) -> list[Entity]:
    return [*([step.entity] if step.entity else []), *(anchor for place in step.places for anchor in place.anchors)]


def _tokens(phrase: Entity) -> Iterator[int]:
    if isinstance(phrase.pointed, int):
        yield phrase.pointed
    for relation in phrase.relations:
        for anchor in relation.anchors:
            yield from _tokens(anchor)


def bound(reading: Reading, made: Sequence[Gesture]) -> Reading:
    """Return the reading with each gesture in the place of its word; the last one serves for all further words."""
    words = pointing_words(reading)
    if not words or not made:
        return reading
    meant = {word: made[min(number, len(made) - 1)] for number, word in enumerate(words)}
    condition = reading.condition and _entity(reading.condition, meant)
    steps = tuple(_step(step, meant) for step in reading.steps)
    otherwise = tuple(_step(step, meant) for step in reading.otherwise)
    return replace(reading, steps=steps, condition=condition, otherwise=otherwise)


def _step(step: Clause, meant: dict[int, Gesture]) -> Clause:
    entity = step.entity and _entity(step.entity, meant)
    return replace(step, entity=entity, places=tuple(_relation(place, meant) for place in step.places))


def _relation(relation: RelationPhrase, meant: dict[int, Gesture]) -> RelationPhrase:
    return replace(relation, anchors=tuple(_entity(anchor, meant) for anchor in relation.anchors))


def _entity(entity: Entity, meant: dict[int, Gesture]) -> Entity:
    pointed = meant[entity.pointed] if isinstance(entity.pointed, int) else entity.pointed
    return replace(entity, pointed=pointed, relations=tuple(_relation(each, meant) for each in entity.relations))
