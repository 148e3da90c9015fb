"""The conversation of the page: what was said and understood, the steps with their states, and what came of it."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from demo.view_state import ViewState, ViewStep
from language import Answer, Outcome, Plan, Question, Refusal, Signal

MOST_ENTRIES = 100  # that are kept; older ones leave the page
MOST_OFFERS = 4  # answers or suggestions that can be clicked
Part = tuple[str, str]  # some characters of a sentence, and how they are marked: "", used, unused or problem


@dataclass
class Entry:
    """One turn.

    kind: plan, answer, question, refusal, or note for what the page says by itself. said: the sentence, in parts.
    understood: in words. steps: of the plan. text: of the answer, question, refusal or note. result: what came of it.
    offers: sentences that can be said by a click.
    """

    kind: str
    said: list[Part] = field(default_factory=list)
    understood: str = ""
    steps: list[ViewStep] = field(default_factory=list)
    text: str = ""
    result: str = ""
    offers: list[str] = field(default_factory=list)


class Conversation:
    """The entries, oldest first.

    Args:
        put: shows a section of the page.
        drop: shows sections no longer.
    """

    def __init__(self, put: Callable[[str, Any], None], drop: Callable[..., None]) -> None:
        self._put, self._drop = put, drop
        self._entries: dict[int, Entry] = {}
        self._next = 0
        self._active: int | None = None  # the entry whose plan is carried out

    def answer(self, entry: Entry, view: ViewState) -> None:
        """Add the entry of a sentence that has just been said. A plan goes on to be shown until it has ended."""
        self._take_back_offers()
        if entry.kind == "plan":
            self._start(entry, view)
        else:
            self._add(entry)

    def start(self, said: str, view: ViewState) -> None:
        """Add a plan that began without a sentence, such as by a button."""
        self._take_back_offers()
        self._start(Entry("plan", [(said, "")]), view)

    def note(self, text: str, said: str = "") -> None:
        """Add what the page says by itself. It is not said twice in a row."""
        last = self._entries.get(self._next - 1)
        if text and not (last is not None and last.kind == "note" and last.text == text and not said):
            self._add(Entry("note", [(said, "")] if said else [], text=text))

    def leave_scene(self) -> None:
        """Take back what can be clicked: its scene is gone."""
        self._active = None
        self._take_back_offers()

    def update(self, view: ViewState, busy: bool) -> None:
        """Show how far the plan is that is carried out. To be called after each control step."""
        if self._active is None:
            return
        entry = self._entries[self._active]
        if not busy or view.steps is not entry.steps:
            entry.result = view.status if view.steps is entry.steps else "Stopped: something else was asked for."
            self._show(self._active)
            self._active = None
        else:
            self._show(self._active)

    def _start(self, entry: Entry, view: ViewState) -> None:
        if self._active is not None:  # what was being done ends here
            self.update(view, True)
        entry.steps = view.steps
        self._active = self._add(entry)

    def _add(self, entry: Entry) -> int:
        number, self._next = self._next, self._next + 1
        self._entries[number] = entry
        self._show(number)
        if len(self._entries) > MOST_ENTRIES:
            oldest = next(iter(self._entries))
            del self._entries[oldest]
            self._drop(_section(oldest))
        return number

    def _take_back_offers(self) -> None:
        for number, entry in self._entries.items():
            if entry.offers:
                entry.offers = []
                self._show(number)

    def _show(self, number: int) -> None:
        self._put(_section(number), asdict(self._entries[number]))


def _section(number: int) -> str:
    return f"entry {number}"


def entry_of(said: str, outcome: Outcome, understood: str, names: Sequence[str]) -> Entry:
    """The entry of a sentence.

    Args:
        said: the sentence.
        outcome: of the sentence.
        understood: the steps in words, or "".
        names: of the objects.
    """
    parts = marked(said, outcome)
    if isinstance(outcome, Plan):
        return Entry("plan", parts, understood, text=_sentence("; ".join(outcome.notes)))
    if isinstance(outcome, Signal):
        text = outcome.text or DONE.get(outcome.control, "")
        return Entry("plan" if outcome.steps else "answer", parts, understood, text=_sentence(text))
    if isinstance(outcome, Question):
        choices = [names[each] for each in outcome.candidates]
        return Entry("question", parts, text=_sentence(outcome.text), offers=choices[:MOST_OFFERS])
    if isinstance(outcome, Refusal):
        suggestions = list(outcome.suggestions[:2])
        if outcome.reason == "already":  # nothing is left to do
            return Entry("answer", parts, text=_sentence(outcome.text), offers=suggestions)
        return Entry("refusal", parts, text=_sentence(outcome.text), offers=suggestions)
    assert isinstance(outcome, Answer)
    return Entry("answer", parts, text=_sentence(outcome.text))


DONE = {  # what is done for a signal that has no words of its own
    "stop": "I stop.",
    "wait": "I wait.",
    "home": "I stop, and stay where I am.",
}


def _sentence(text: str) -> str:
    """A text with a capital and a full stop."""
    return text[:1].upper() + text[1:] + ("" if text[-1:] in (*".!?:", "") else ".")


def marked(said: str, outcome: Outcome) -> list[Part]:
    """The sentence in parts: words that counted, words that did not, and those that a question or refusal is about."""
    start, end = outcome.span
    whole = end - start >= len(said.strip()) or end <= start
    if isinstance(outcome, Question | Refusal) and not whole:
        parts = [(said[:start], "used"), (said[start:end], "problem"), (said[end:], "")]
        return [part for part in parts if part[0]]
    if isinstance(outcome, Question | Refusal):
        return [(said, "")]
    left = [word.lower() for word in outcome.unused]
    parts = []
    for piece in re.findall(r"\w[\w'-]*|\W+", said):
        unused = piece.lower() in left
        if unused:
            left.remove(piece.lower())
        parts.append((piece, "" if not piece[0].isalnum() else "unused" if unused else "used"))
    return _joined(parts)


def _joined(parts: Sequence[Part]) -> list[Part]:
    """The parts, with neighbours of one kind in one; what stands between two words of a kind is of their kind."""
    joined: list[Part] = []
    for at, (text, kind) in enumerate(parts):
        after = parts[at + 1][1] if at + 1 < len(parts) else ""
        if joined and (kind or after) == joined[-1][1] and (kind or text.isspace()):
            joined[-1] = (joined[-1][0] + text, joined[-1][1])
        else:
            joined.append((text, kind))
    return joined
