"""What can go wrong with words. Each error here is a `LanguageError`; its text is the whole message."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

_LONGEST_QUOTE = 40  # characters of a stranger's word that a message repeats


class LanguageError(ValueError):
    """Words that cannot be used as they stand. A person can mend them."""


class NotUnderstood(LanguageError):
    """A sentence outside the grammar.

    position: the offset in the sentence, in characters from 0, of the word that does not belong.
    expected: the words that could have stood there, in the vocabulary's order.
    """

    def __init__(self, message: str, position: int = 0, expected: tuple[str, ...] = ()) -> None:
        super().__init__(message)
        self.position = position
        self.expected = expected


class NothingFits(LanguageError):
    """No object of the scene is what the words say. part: the words that fail, as in "red cube"."""

    def __init__(self, message: str, part: str = "") -> None:
        super().__init__(message)
        self.part = part


class SeveralFit(LanguageError):
    """The words leave open which object is meant. candidates: the indices of those that fit, ascending.

    Where the object that a relation is seen from stays open, the candidates are for that one.
    """

    def __init__(self, message: str, candidates: tuple[int, ...] = ()) -> None:
        super().__init__(message)
        self.candidates = candidates


def quote(word: str) -> str:
    """The word in quotes, cut where it is too long to repeat."""
    return repr(word if len(word) <= _LONGEST_QUOTE else word[: _LONGEST_QUOTE - 3] + "...")


def closest(word: str, choices: Iterable[str]) -> str | None:
    """The choice that is spelled most like the word, or None where none comes near."""
    near = get_close_matches(word[:_LONGEST_QUOTE], list(choices), n=1)
    return near[0] if near else None


def check_known(what: str, word: str, choices: Iterable[str]) -> None:
    """Raises LanguageError, with a suggestion, where the word is no choice. what: "color", "noun", ..."""
    choices = list(choices)
    if word in choices:
        return
    near = closest(str(word), choices)
    hint = f"did you mean {near!r}?" if near else f"choose from {', '.join(choices)}"
    raise LanguageError(f"{quote(str(word))} is not a known {what}; {hint}")
