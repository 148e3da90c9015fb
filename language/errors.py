"""Errors of the language. Each is a `LanguageError`, whose text is the whole message."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import get_close_matches

_MAX_QUOTE = 40  # characters of a user's word that a message repeats
_MAX_PHRASE = 120  # characters of a phrase that a message repeats
_MAX_LISTED = 8  # objects of a scene that a message lists


class LanguageError(ValueError):
    """Words that cannot be used. The user can correct them."""


class NotUnderstood(LanguageError):
    """A sentence outside the grammar.

    position: offset of the offending word in the sentence, in characters from 0.
    expected: the phrases that the grammar accepts there, in the vocabulary's order.
    """

    def __init__(self, message: str, position: int = 0, expected: tuple[str, ...] = ()) -> None:
        super().__init__(message)
        self.position = position
        self.expected = expected


class NothingFits(LanguageError):
    """No object of the scene fits the words.

    part: the words that fit nothing, such as "red cube".
    position: offset of their phrase in the sentence, in characters from 0.
    """

    def __init__(self, message: str, part: str = "", position: int = 0) -> None:
        super().__init__(message)
        self.part = part
        self.position = position


class SeveralFit(LanguageError):
    """Several objects of the scene fit the words.

    candidates: their indices, ascending. If the anchor of a relation is ambiguous, the candidates for the anchor.
    position: offset of the ambiguous phrase in the sentence, in characters from 0.
    question: a question to the user whose answer resolves the ambiguity.
    """

    def __init__(self, message: str, candidates: tuple[int, ...] = (), position: int = 0, question: str = "") -> None:
        super().__init__(message)
        self.candidates = candidates
        self.position = position
        self.question = question


def quote(word: str) -> str:
    """Return the word in quotes, truncated if it is long."""
    return repr(word if len(word) <= _MAX_QUOTE else word[: _MAX_QUOTE - 3] + "...")


def shorten(phrase: str) -> str:
    """Return the phrase, truncated if it is long."""
    return phrase if len(phrase) <= _MAX_PHRASE else phrase[: _MAX_PHRASE - 3] + "..."


def listed(things: Sequence[str], between: str = ", ") -> str:
    """Return the first things, joined, and how many more there are."""
    more = [f"{len(things) - _MAX_LISTED} more"] if len(things) > _MAX_LISTED else []
    return between.join((*things[:_MAX_LISTED], *more))


def closest(word: str, choices: Iterable[str]) -> str | None:
    """Return the choice whose spelling is closest to the word, or None if none is similar."""
    near = get_close_matches(word[:_MAX_QUOTE], list(choices), n=1)
    return near[0] if near else None


def check_known(what: str, word: str, choices: Iterable[str]) -> None:
    """Check that a word is one of the choices.

    Args:
        what: the kind of word: "color", "noun", ...
        word: to check.
        choices: the known words.

    Raises:
        LanguageError: it is not; the message has a suggestion.
    """
    choices = list(choices)
    if word in choices:
        return
    near = closest(str(word), choices)
    hint = f"did you mean {near!r}?" if near else f"choose from {', '.join(choices)}"
    raise LanguageError(f"{quote(str(word))} is not a known {what}; {hint}")
