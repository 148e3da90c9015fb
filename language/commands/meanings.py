"""Meanings of people's commands: what each phrase says, before it is compared with a scene.

Meanings are compared by identity and never changed after they were made (a frozen dataclass takes three times as long
to make); `span` is its range of tokens.
"""

from __future__ import annotations

from dataclasses import dataclass, field

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
class Relation:
    """A relation to an anchor, such as "left of the red cube".

    name: a key of `modifiers.RELATIONS`, or "between", "held", "bare", "direction", "here", "not".
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

    kind: "thing", "stack", a key of `nouns.REGIONS`, "fixture", "it" or "spot" (what a gesture shows).
    noun: the kind of thing, or None for any.
    colors: each a tuple of the colours that it may mean. sides: words such as "left" and "back".
    superlative: a key of `modifiers.SUPERLATIVES`. ordinal: a rank from 1, or -1 for the last. number: a count.
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
    relations: tuple[Relation, ...] = ()
    span: Span = (0, 0)

    @property
    def is_bare_plural(self) -> bool:
        """Whether it is a plural that may mean all things that fit: "the red cubes", "red cubes"."""
        counted = self.number or self.ordinal or self.superlative or self.any or self.single or self.every
        return self.kind == "thing" and self.plural and self.pointed is None and not counted


@dataclass(eq=False, slots=True)
class Step:
    """One action: a key of `verb_words.VERBS` or `verb_words.CONTROLS`, "fragment" (no verb) or "nothing".

    entity: the object of the action. places: conjoined relations that say where it goes.
    """

    action: str
    entity: Entity | None = None
    places: tuple[Relation, ...] = ()
    span: Span = (0, 0)


@dataclass(eq=False, slots=True)
class Reading:
    """A parse of a whole sentence with its cost, the lower the better.

    condition: an entity that must exist, or else `otherwise` is done. rejects: begins with "no" or the like.
    unused: indices of the tokens that it leaves out, other than words that add nothing.
    """

    steps: tuple[Step, ...]
    cost: float = 0.0
    condition: Entity | None = None
    otherwise: tuple[Step, ...] = ()
    rejects: bool = False
    unused: tuple[int, ...] = field(default=())
