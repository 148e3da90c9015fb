"""Outcomes of a sentence: `Understood` with executable steps, a `Question`, or a `Refusal`."""

from __future__ import annotations

from dataclasses import dataclass, field

from language.commands.meanings import Reading
from language.commands.world import World

CONTROLS = ("stop", "wait", "home", "faster", "slower")


@dataclass(frozen=True)
class Action:
    """One executable step.

    kind: "take", "place", "push", "reach", "press", "switch", "turn", "open", "close", "nothing", or one of CONTROLS.
    object: index of the thing that it concerns, or None.
    position: of "place" and "push": where the thing's centre goes, x and y in the world's unit (metres or cells).
    bottom: the height of the thing's underside there. on: index of what it then stands on; None: table or board.
    fixture: of "open" and "close". several: whether the words for the object name several things.
    """

    kind: str
    object: int | None = None
    position: tuple[float, float] | None = None
    bottom: float | None = None
    on: int | None = None
    fixture: str | None = None
    several: bool = False


@dataclass(frozen=True)
class Outcome:
    """The outcome of a sentence.

    confidence: 0 to 1. unused: the words that were not used. span: characters of the sentence that it is about.
    """

    sentence: str
    confidence: float = 0.0
    unused: tuple[str, ...] = ()
    span: tuple[int, int] = (0, 0)


@dataclass(frozen=True)
class Understood(Outcome):
    """A sentence whose steps can be carried out in order.

    steps: checked one after the other. result: the world after them. reading: the parse that was chosen.
    notes: choices that the scene settled, such as "purple is taken for magenta".
    """

    steps: tuple[Action, ...] = ()
    result: World | None = None
    reading: Reading | None = field(default=None, compare=False)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Question(Outcome):
    """A sentence with several outcomes that are about as likely, or that leaves something open.

    text: the question. candidates: indices of the things that may be meant. choices: the outcome of each answer.
    reading: of a sentence that leaves something open.
    """

    text: str = ""
    candidates: tuple[int, ...] = ()
    choices: tuple[Understood, ...] = ()
    reading: Reading | None = field(default=None, compare=False)


@dataclass(frozen=True)
class Refusal(Outcome):
    """A sentence that is not carried out.

    reason: "syntax", "nothing" (no thing fits), "impossible" (a precondition fails) or "dialogue" (nothing to refer
        to).
    text: the reason in words. suggestions: for example sentences that can be carried out.
    """

    reason: str = "syntax"
    text: str = ""
    suggestions: tuple[str, ...] = ()
