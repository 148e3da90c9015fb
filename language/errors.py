"""What can go wrong with words. Each error here is a `LanguageError`; its text is the whole message."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import get_close_matches

_LONGEST_QUOTE = 40  # characters of a stranger's word that a message repeats
_LONGEST_PHRASE = 120  # characters of a phrase of ours that it repeats
_LISTED = 8  # things of a scene that it lists


class LanguageError(ValueError):
    """Words that cannot be used as they stand. A person can mend them."""


class NotUnderstood(LanguageError):
    """A sentence outside the grammar.

    position: the offset in the sentence, in characters from 0, of the word that does not belong.
    expected: the phrases that could have stood there, in the vocabulary's order.
    """

    def __init__(self, message: str, position: int = 0, expected: tuple[str, ...] = ()) -> None:
        super().__init__(message)
        self.position = position
        self.expected = expected


class NothingFits(LanguageError):
    """No object of the scene is what the words say.

    part: the words that fail, as in "red cube". position: where their phrase begins in the sentence, in characters.
    """

    def __init__(self, message: str, part: str = "", position: int = 0) -> None:
        super().__init__(message)
        self.part = part
        self.position = position


class SeveralFit(LanguageError):
    """The words leave open which object is meant.

    candidates: the indices of those that fit, ascending. Where the object that a relation is seen from stays open,
        the candidates are for that one.
    position: where the open phrase begins in the sentence, in characters. question: what would settle it.
    """

    def __init__(self, message: str, candidates: tuple[int, ...] = (), position: int = 0, question: str = "") -> None:
        super().__init__(message)
        self.candidates = candidates
        self.position = position
        self.question = question


def quote(word: str) -> str:
    """The word in quotes, cut where it is too long to repeat."""
    return repr(word if len(word) <= _LONGEST_QUOTE else word[: _LONGEST_QUOTE - 3] + "...")


def shorten(phrase: str) -> str:
    """The phrase, cut where it is too long to repeat."""
    return phrase if len(phrase) <= _LONGEST_PHRASE else phrase[: _LONGEST_PHRASE - 3] + "..."


def listed(things: Sequence[str], between: str = ", ") -> str:
    """The first things, and how many more there are."""
    more = [f"{len(things) - _LISTED} more"] if len(things) > _LISTED else []
    return between.join((*things[:_LISTED], *more))


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
