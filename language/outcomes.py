"""Outcomes of a sentence: a `Plan`, a `Question`, an `Answer`, a `Refusal` or a `Signal`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from language.verbs import KNOWN, Act
from language.world import WorldModel


@dataclass(frozen=True)
class Step:
    """One step that can be carried out.

    verb: a key of `language.verbs.VERBS`. object: index of the thing that it concerns.
    goal: index of the thing that the object goes on or into or is taken from; None: it goes to a place, or nowhere.
    place: where the object's centre goes, x and y in the world's unit (metres or cells). bottom: the height of its
        underside there. implied: whether nobody said it. several: whether the words name several objects.
    instruction: in the project's own language, of the sentence that it was read from.
    """

    verb: str
    object: int
    goal: int | None = None
    place: tuple[float, float] | None = None
    bottom: float | None = None
    implied: bool = False
    several: bool = False
    instruction: Any = field(default=None, compare=False)

    @property
    def act(self) -> Act:
        """What the step does."""
        return KNOWN[self.verb].act

    @property
    def takes(self) -> bool:
        """Whether the object is in the gripper afterwards."""
        return self.act in (Act.TAKE, Act.HOLD, Act.REMOVE, Act.UNSTACK)

    @property
    def carries(self) -> bool:
        """Whether the object is brought to a place."""
        return self.place is not None


@dataclass(frozen=True)
class Outcome:
    """The outcome of a sentence.

    confidence: 0 to 1. unused: the words that were not used. span: characters of the sentence that it is about.
    about: indices of the things that it is about, in the order in which they are named.
    """

    sentence: str
    confidence: float = 0.0
    unused: tuple[str, ...] = ()
    span: tuple[int, int] = (0, 0)
    about: tuple[int, ...] = field(default=(), kw_only=True, compare=False)

    @property
    def message(self) -> str:
        """What the person reads."""
        return str(getattr(self, "text", "")) or "; ".join(getattr(self, "notes", ()))


@dataclass(frozen=True)
class Plan(Outcome):
    """A sentence whose steps can be carried out in order.

    steps: checked one after the other. result: the world after them. reading: the parse that was chosen.
    notes: what the person should know: choices that the scene settled, and steps that nobody asked for.
    """

    steps: tuple[Step, ...] = ()
    result: WorldModel | None = None
    reading: Any = field(default=None, compare=False)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Question(Outcome):
    """A sentence with several outcomes that are about as likely, or that leaves something open.

    text: the question. candidates: indices of the things that may be meant. choices: the plan of each answer.
    reading: of a sentence that leaves something open.
    """

    text: str = ""
    candidates: tuple[int, ...] = ()
    choices: tuple[Plan, ...] = ()
    reading: Any = field(default=None, compare=False)


@dataclass(frozen=True)
class Answer(Outcome):
    """An answer in words."""

    text: str = ""


@dataclass(frozen=True)
class Refusal(Outcome):
    """A sentence that is not carried out.

    reason: "syntax", "nothing" (no thing fits), "impossible" (a precondition fails), "dialogue" (nothing to refer to)
        or "language" (not English).
    text: the reason in words. suggestions: sentences that can be carried out. reading: of what cannot be done.
    """

    reason: str = "syntax"
    text: str = ""
    suggestions: tuple[str, ...] = ()
    reading: Any = field(default=None, compare=False, kw_only=True)

    @property
    def message(self) -> str:
        """The reason and what can be said instead, as the person reads it."""
        text = self.text[:1].upper() + self.text[1:]
        return (
            f"{text}. Try {' or '.join(repr(each) for each in self.suggestions[:2])}."
            if self.suggestions
            else f"{text}."
        )


@dataclass(frozen=True)
class Signal(Outcome):
    """A sentence about the motion itself. control: a key of `language.talk.CONTROLS`. steps: of "undo" and "again"."""

    control: str = ""
    text: str = ""
    steps: tuple[Step, ...] = ()
    result: WorldModel | None = None
