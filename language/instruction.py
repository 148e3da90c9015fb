"""What a sentence means, as data that can say itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from language.colors import COLORS
from language.errors import LanguageError, check_known
from language.lexicon import lexicon
from language.objects import NOUNS, ROLE_WORDS, SIZES
from language.relations import RELATIONS, SUPERLATIVES
from language.verbs import BASE, GOAL, HERE, IT, OBJECT, POINTING, VERBS

DETERMINERS = ("the", *POINTING, *HERE, IT)

# A category of the lexicon and a meaning to one of the phrases that say it.
Form = Callable[[str, Any], str]


@dataclass(frozen=True)
class ObjectPhrase:
    """The name of an object: "the red cube left of the sphere".

    noun: None says "object"; color, size, role: None says none; role "target" says "transparent".
    superlative: "leftmost" among all that the rest fits.
    excluded: noun, colour, size or role, or several, of what is not meant: "that is not red".
    relation, anchors: where it is, seen from one or two others, which have phrases of their own.
    determiner: one of DETERMINERS; "here", "there" and "it" stand alone.
    position: where the phrase begins in its sentence, in characters; no part of what it means.
    Raises LanguageError for words that are not in the registries.
    """

    noun: str | None = None
    color: str | None = None
    relation: str | None = None
    anchors: tuple[ObjectPhrase, ...] = ()
    size: str | None = None
    role: str | None = None
    superlative: str | None = None
    excluded: ObjectPhrase | None = None
    determiner: str = "the"
    position: int = field(default=0, compare=False, repr=False)

    def __post_init__(self) -> None:
        if self.noun is not None and self.noun not in NOUNS:
            check_known("noun", self.noun, NOUNS)
        if self.color is not None and self.color not in COLORS:
            check_known("color", self.color, COLORS)
        if self.size is not None and self.size not in SIZES:
            check_known("size", self.size, SIZES)
        if self.role is not None and self.role not in ROLE_WORDS:
            check_known("role", self.role, ROLE_WORDS)
        if self.superlative is not None and self.superlative not in SUPERLATIVES:
            check_known("superlative", self.superlative, SUPERLATIVES)
        if self.determiner not in DETERMINERS:
            check_known("determiner", self.determiner, DETERMINERS)
        if self.relation is not None or self.anchors:
            self._check_relation()
        if self.excluded is not None:
            self._check_excluded(self.excluded)
        if self.determiner in (*HERE, IT) and replace(self, determiner="the") != ObjectPhrase():
            raise LanguageError(f"{self.determiner!r} stands alone: give no other word beside it")

    def _check_relation(self) -> None:
        if self.relation is None:
            raise LanguageError(f"relation=None and {len(self.anchors)} anchors: give both or none")
        check_known("relation", self.relation, RELATIONS)
        if len(self.anchors) != RELATIONS[self.relation].anchors:
            wanted = RELATIONS[self.relation].anchors
            raise LanguageError(f"{self.relation!r} is seen from {wanted} anchors: {len(self.anchors)} are given")
        for anchor in self.anchors:
            _check_no_spot(anchor, "an anchor")

    def _check_excluded(self, excluded: ObjectPhrase) -> None:
        plain = ObjectPhrase(excluded.noun, excluded.color, size=excluded.size, role=excluded.role)
        if excluded != plain or plain == ObjectPhrase():
            raise LanguageError(f"excluded={excluded}: what is not meant has a noun, color, size or role, and no more")

    @property
    def depth(self) -> int:
        """How deep its relations are nested; 0 for none."""
        return 1 + max(anchor.depth for anchor in self.anchors) if self.anchors else 0

    @property
    def kind(self) -> str:
        """What tells the object: one of `KINDS`, "gesture", or "object" if nothing does."""
        if self.determiner != "the":
            return "gesture"
        if self.relation is not None:
            return "relation" if self.depth == 1 else "nested"
        if self.superlative is not None:
            return "superlative"
        if self.excluded is not None:
            return "negation"
        if self.size is not None:
            return "size"
        if self.color is not None:
            return "color" if self.noun is None else "color_shape"
        if self.noun is not None:
            return "shape"
        return "object" if self.role is None else "role"

    @property
    def head(self) -> ObjectPhrase:
        """The same without its relation."""
        return self if self.relation is None else replace(self, relation=None, anchors=())

    @property
    def label(self) -> str:
        """The head's words without the article and what is excluded: "largest transparent red cube"."""
        return self._label(lexicon().form)

    def _label(self, form: Form) -> str:
        adjectives = ("superlative", self.superlative), ("size", self.size), ("role", self.role), ("color", self.color)
        said = [form(category, word) for category, word in adjectives if word is not None]
        return " ".join([*said, form("noun", self.noun)])

    def parts(self) -> Iterator[ObjectPhrase]:
        """Itself and every phrase within, in the order of the words."""
        yield self
        for anchor in self.anchors:
            yield from anchor.parts()

    def words(self, form: Form) -> str:
        """The phrase with a choice of words."""
        if self.determiner in HERE:
            return form("spot", self.determiner)
        if self.determiner != "the" and self == ObjectPhrase(determiner=self.determiner):
            return self.determiner
        said = f"{self.determiner} {self._label(form)}"
        if self.excluded is not None:
            said += f" {form('excluding', 'excluding')} {_excluded_words(self.excluded, form)}"
        if self.relation is not None:
            category = "relation" if len(self.anchors) == 1 else "between"
            said += f" {form(category, self.relation)} {' and '.join(anchor.words(form) for anchor in self.anchors)}"
        return said

    def __str__(self) -> str:
        return self.words(lexicon().form)


def _check_no_spot(phrase: ObjectPhrase | None, what: str) -> None:
    """The grammar has "here" and "there" only where a step or a goal names its object."""
    if phrase is not None and phrase.determiner in HERE:
        raise LanguageError(f"{phrase.determiner!r} cannot be {what}: say 'this' or 'that', or give it as a goal")


def _excluded_words(excluded: ObjectPhrase, form: Form) -> str:
    adjectives = [("color", excluded.color), ("size", excluded.size), ("role", excluded.role)]
    said = [form(category, word) for category, word in adjectives if word is not None]
    if excluded.noun is None and len(said) == 1:
        return said[0]
    label = excluded._label(form)
    return f"{'an' if label[0] in 'aeiou' else 'a'} {label}"


@dataclass(frozen=True)
class Instruction:
    """A task to do with the object that the phrase names. goal: what stands where it shall go, if anywhere.

    Raises LanguageError for an unknown task, and for a goal where the task takes none or needs one.
    """

    task: str
    phrase: ObjectPhrase
    goal: ObjectPhrase | None = None

    def __post_init__(self) -> None:
        if self.task not in VERBS:
            check_known("task", self.task, VERBS)
        if self.goal is None and VERBS[self.task].needs_goal:
            raise LanguageError(f"{self.task!r} needs a goal: say where")
        if self.goal is not None and not VERBS[self.task].takes_goal:
            raise LanguageError(f"{self.task!r} takes no goal: {str(self.goal)!r} is given")

    @property
    def kind(self) -> str:
        """The kind of its phrase."""
        return self.phrase.kind

    @property
    def steps(self) -> tuple[Instruction, ...]:
        """Itself: so that an instruction reads like a chain of one."""
        return (self,)

    def words(self, form: Form) -> str:
        """The instruction with a choice of words."""
        said = form("task", (self.task, self.goal is not None)).replace(OBJECT, self.phrase.words(form))
        if self.goal is None:
            return said
        return said.replace(BASE, self.goal.words(form)).replace(GOAL, _place_words(self.goal, form))

    def __str__(self) -> str:
        return self.words(lexicon().form)


def _place_words(goal: ObjectPhrase, form: Form) -> str:
    said = goal.words(form)
    return said if goal.determiner in HERE else f"{form('place', 'place')} {said}"


@dataclass(frozen=True)
class Chain:
    """Two instructions or more, to be done one after another. Raises LanguageError for fewer."""

    steps: tuple[Instruction, ...]

    def __post_init__(self) -> None:
        if len(self.steps) < 2:
            raise LanguageError(f"a chain of {len(self.steps)} steps: it has at least 2")

    def words(self, form: Form) -> str:
        """The chain with a choice of words."""
        return f", {form('then', 'then')} ".join(step.words(form) for step in self.steps)

    def __str__(self) -> str:
        return self.words(lexicon().form)


@dataclass(frozen=True)
class Correction:
    """What is to be changed in the instruction before: "no, the blue one", "not the cube, the sphere".

    phrase: what is meant instead, or goal: where instead; one of them. rejected: what was not meant.
    """

    phrase: ObjectPhrase | None = None
    goal: ObjectPhrase | None = None
    rejected: ObjectPhrase | None = None

    def __post_init__(self) -> None:
        if (self.phrase is None) == (self.goal is None) or (self.goal is not None and self.rejected is not None):
            raise LanguageError("a correction has either a phrase, with or without what is rejected, or a goal")
        _check_no_spot(self.phrase, "the phrase of a correction")
        _check_no_spot(self.rejected, "rejected")

    def words(self, form: Form) -> str:
        """The correction with a choice of words."""
        if self.goal is not None:
            return f"{form('no', 'no')}, {_place_words(self.goal, form)}"
        assert self.phrase is not None
        if self.rejected is not None:
            return f"{form('not', 'not')} {self.rejected.words(form)}, {self.phrase.words(form)}"
        return f"{form('no', 'no')}, {self.phrase.words(form)}"

    def __str__(self) -> str:
        return self.words(lexicon().form)


Command = Instruction | Chain
Meaning = Instruction | Chain | Correction


def say(meaning: Meaning | ObjectPhrase) -> str:
    """What it means in words: "reach the object left of the blue sphere"."""
    return str(meaning)
