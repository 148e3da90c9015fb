"""Meanings of sentences as data classes, each of which can be said: `parse(say(x)) == x`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from language.colors import COLORS
from language.errors import LanguageError, check_known
from language.lexicon import lexicon
from language.objects import NOUNS, ROLE_WORDS, SIZES
from language.relations import RELATIONS, SUPERLATIVES
from language.verbs import BASE, EVERY, GOAL, HERE, IT, OBJECT, POINTING, VERBS

DETERMINERS = ("the", EVERY, *POINTING, *HERE, IT)

# Maps a category of the lexicon and a meaning to one of its phrases.
Form = Callable[[str, Any], str]


@dataclass(frozen=True)
class ObjectPhrase:
    """A phrase that refers to an object: "the red cube left of the sphere".

    noun: None: "object".
    color, size, role: None: not mentioned; role "target" is said as "transparent".
    superlative: such as "leftmost", among all objects that the rest of the phrase fits.
    excluded: noun, colour, size or role, or several, of objects that are not meant: "that is not red".
    relation, anchors: the spatial relation to one or two anchors, which have phrases of their own.
    determiner: one of DETERMINERS; "here", "there" and "it" stand alone; "every" means each object that the rest fits.
    position: offset of the phrase in its sentence, in characters; not part of the meaning.

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
            raise LanguageError(f"{self.determiner!r} stands alone: give no other field with it")

    def _check_relation(self) -> None:
        if self.relation is None:
            raise LanguageError(f"relation=None and {len(self.anchors)} anchors: give both or none")
        check_known("relation", self.relation, RELATIONS)
        if len(self.anchors) != RELATIONS[self.relation].anchors:
            wanted = RELATIONS[self.relation].anchors
            raise LanguageError(f"{self.relation!r} needs {wanted} anchors: {len(self.anchors)} are given")
        for anchor in self.anchors:
            _check_not_here(anchor, "an anchor")
            _check_not_every(anchor, "an anchor")

    def _check_excluded(self, excluded: ObjectPhrase) -> None:
        plain = ObjectPhrase(excluded.noun, excluded.color, size=excluded.size, role=excluded.role)
        if excluded != plain or plain == ObjectPhrase():
            raise LanguageError(f"excluded={excluded}: it has a noun, color, size or role, and no more")

    @property
    def depth(self) -> int:
        """The nesting depth of its relations; 0 without a relation."""
        return 1 + max(anchor.depth for anchor in self.anchors) if self.anchors else 0

    @property
    def kind(self) -> str:
        """The kind of information that identifies the object: one of `KINDS`, "gesture", "role" or "object" (none)."""
        if self.determiner not in ("the", EVERY):
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
        """The phrase without its relation."""
        return self if self.relation is None else replace(self, relation=None, anchors=())

    @property
    def label(self) -> str:
        """The head's words without the article and the exclusion: "largest transparent red cube"."""
        return self._label(lexicon().form)

    def _label(self, form: Form) -> str:
        adjectives = ("superlative", self.superlative), ("size", self.size), ("role", self.role), ("color", self.color)
        said = [form(category, word) for category, word in adjectives if word is not None]
        return " ".join([*said, form("noun", self.noun)])

    def parts(self) -> Iterator[ObjectPhrase]:
        """Yield the phrase itself and all phrases within it, in the order of the words."""
        yield self
        for anchor in self.anchors:
            yield from anchor.parts()

    def words(self, form: Form) -> str:
        """Return the phrase in words that `form` chooses."""
        if self.determiner in HERE:
            return form("spot", self.determiner)
        if self.determiner in (*POINTING, IT) and self == ObjectPhrase(determiner=self.determiner):
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


def _check_not_here(phrase: ObjectPhrase | None, what: str) -> None:
    """Raise LanguageError: "here" and "there" are allowed only as the object or goal of a step."""
    if phrase is not None and phrase.determiner in HERE:
        raise LanguageError(f"{phrase.determiner!r} cannot be {what}: say 'this' or 'that', or give it as a goal")


def _check_not_every(phrase: ObjectPhrase | None, what: str) -> None:
    """Raise LanguageError: "every" is allowed only as the object of some tasks."""
    if phrase is not None and phrase.determiner == EVERY:
        tasks = " or ".join(repr(name) for name, verb in VERBS.items() if verb.takes_every)
        raise LanguageError(f"{str(phrase)!r} cannot be {what}, only the object of {tasks}: say 'the'")


def _excluded_words(excluded: ObjectPhrase, form: Form) -> str:
    adjectives = [("color", excluded.color), ("size", excluded.size), ("role", excluded.role)]
    said = [form(category, word) for category, word in adjectives if word is not None]
    if excluded.noun is None and len(said) == 1:
        return said[0]
    label = excluded._label(form)
    return f"{'an' if label[0] in 'aeiou' else 'a'} {label}"


@dataclass(frozen=True)
class Instruction:
    """A task for the object that the phrase refers to.

    task: a key of VERBS. phrase: the object. goal: the object at the place where it shall go, if the task has one.

    Raises LanguageError for an unknown task, for a missing goal, for a goal that the task does not take, and for
    "every" where the task is about one object.
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
        if not VERBS[self.task].takes_every:
            _check_not_every(self.phrase, f"the object of {self.task!r}")
        _check_not_every(self.goal, "a goal")

    @property
    def kind(self) -> str:
        """The kind of its phrase."""
        return self.phrase.kind

    @property
    def steps(self) -> tuple[Instruction, ...]:
        """The instruction itself, as a chain of one step."""
        return (self,)

    def words(self, form: Form) -> str:
        """Return the instruction in words that `form` chooses."""
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
    """Two or more instructions, to be executed in order. Raises LanguageError for fewer."""

    steps: tuple[Instruction, ...]

    def __post_init__(self) -> None:
        if len(self.steps) < 2:
            raise LanguageError(f"a chain of {len(self.steps)} steps: it has at least 2")

    def words(self, form: Form) -> str:
        """Return the chain in words that `form` chooses."""
        return f", {form('then', 'then')} ".join(step.words(form) for step in self.steps)

    def __str__(self) -> str:
        return self.words(lexicon().form)


@dataclass(frozen=True)
class Correction:
    """A correction of the previous instruction: "no, the blue one", "not the cube, the sphere".

    phrase: the object that is meant instead. goal: the place that is meant instead. Exactly one of them is given.
    rejected: the object that was not meant; only with `phrase`.
    """

    phrase: ObjectPhrase | None = None
    goal: ObjectPhrase | None = None
    rejected: ObjectPhrase | None = None

    def __post_init__(self) -> None:
        if (self.phrase is None) == (self.goal is None) or (self.goal is not None and self.rejected is not None):
            raise LanguageError("a correction has either a phrase, with or without a rejected phrase, or a goal")
        _check_not_here(self.phrase, "the phrase of a correction")
        _check_not_here(self.rejected, "rejected")
        for phrase in (self.phrase, self.goal, self.rejected):
            _check_not_every(phrase, "a correction")

    def words(self, form: Form) -> str:
        """Return the correction in words that `form` chooses."""
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
    """Return the standard sentence for a meaning: "reach the object left of the blue sphere"."""
    return str(meaning)
