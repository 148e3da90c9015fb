"""What a sentence means, as data that can say itself."""

from __future__ import annotations

from dataclasses import dataclass, replace

from language.colors import COLORS
from language.errors import LanguageError, check_known
from language.objects import ANY_NOUN, NOUNS
from language.relations import RELATIONS
from language.templates import SLOT, TEMPLATES


@dataclass(frozen=True)
class ObjectPhrase:
    """The name of an object: "the red cube left of the sphere".

    noun: None says "object"; color: None says none.
    relation, anchor: where it is, seen from another object, which has a phrase of its own; both or neither.
    Raises LanguageError for words that are not in the registries.
    """

    noun: str | None = None
    color: str | None = None
    relation: str | None = None
    anchor: ObjectPhrase | None = None

    def __post_init__(self) -> None:
        if self.noun is not None and self.noun not in NOUNS:
            check_known("noun", self.noun, NOUNS)
        if self.color is not None and self.color not in COLORS:
            check_known("color", self.color, COLORS)
        if (self.relation is None) != (self.anchor is None):
            raise LanguageError(f"relation={self.relation!r} and anchor={self.anchor!r}: give both or none")
        if self.relation is not None and self.relation not in RELATIONS:
            check_known("relation", self.relation, RELATIONS)

    @property
    def kind(self) -> str:
        """What tells the object: "relation", "color_shape", "color", "shape", or "object" if nothing does."""
        if self.relation is not None:
            return "relation"
        if self.color is not None:
            return "color" if self.noun is None else "color_shape"
        return "object" if self.noun is None else "shape"

    @property
    def head(self) -> ObjectPhrase:
        """The same without its relation."""
        return self if self.relation is None else replace(self, relation=None, anchor=None)

    @property
    def label(self) -> str:
        """The head's words without the article: "red cube"."""
        noun = ANY_NOUN[0] if self.noun is None else self.noun
        return noun if self.color is None else f"{self.color} {noun}"

    def __str__(self) -> str:
        if self.anchor is None:
            return f"the {self.label}"
        return f"the {self.label} {self.relation} {self.anchor}"


@dataclass(frozen=True)
class Instruction:
    """A task to do with the object that the phrase names. Raises LanguageError for an unknown task."""

    task: str
    phrase: ObjectPhrase

    def __post_init__(self) -> None:
        if self.task not in TEMPLATES:
            check_known("task", self.task, TEMPLATES)

    @property
    def kind(self) -> str:
        """The kind of its phrase."""
        return self.phrase.kind


def say(instruction: Instruction) -> str:
    """The instruction in words: "reach the object left of the blue sphere"."""
    return TEMPLATES[instruction.task][0].replace(SLOT, str(instruction.phrase))
