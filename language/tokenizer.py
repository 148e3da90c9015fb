"""Sentences as rows of numbers, for networks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from language.errors import LanguageError, quote
from language.lexicon import lexicon, split
from language.word_order import WORD_ORDER

PAD, UNKNOWN = "<pad>", "<unk>"  # always numbers 0 and 1


@dataclass(frozen=True)
class Tokenizer:
    """Words to numbers and back.

    vocabulary: every word once, its number being its place; "<pad>" and "<unk>" come first. A checkpoint
        stores it as a list of strings, and `check_same` compares.
    length: numbers a sentence, filled up with 0.
    Raises LanguageError.
    """

    vocabulary: tuple[str, ...]
    length: int = 32

    def __post_init__(self) -> None:
        object.__setattr__(self, "vocabulary", tuple(self.vocabulary))
        if self.vocabulary[:2] != (PAD, UNKNOWN) or len(set(self.vocabulary)) != len(self.vocabulary):
            raise LanguageError(f"a vocabulary begins with {PAD}, {UNKNOWN} and holds each word once")
        if self.length < 1:
            raise LanguageError(f"length={self.length} must be at least 1")

    @classmethod
    def default(cls, length: int = 32) -> Tokenizer:
        """Returns the tokenizer of all words of the grammar: `WORD_ORDER`, then newer words in the registries' order.

        Adding a word leaves the ids of the others unchanged.
        """
        return cls(tuple(dict.fromkeys((PAD, UNKNOWN, *WORD_ORDER, *lexicon().words()))), length)

    @cached_property
    def _number(self) -> dict[str, int]:
        return {word: number for number, word in enumerate(self.vocabulary)}

    def encode(self, sentence: str) -> np.ndarray:
        """(length,) int64, read-only because remembered by sentence. Unknown words are 1, marks left out.

        Raises LanguageError where the sentence has more words than `length`.
        """
        return _encode(self, sentence)

    def decode(self, tokens: Iterable[int]) -> str:
        """The words of the numbers, without padding. Raises LanguageError for a number that is no word's."""
        numbers = [int(token) for token in tokens]
        size = len(self.vocabulary)
        for number in numbers:
            if not 0 <= number < size:
                raise LanguageError(f"token {number} is out of range: it must be in [0, {size - 1}]")
        return " ".join(self.vocabulary[number] for number in numbers if number != 0)

    def unknown_words(self, sentence: str) -> tuple[str, ...]:
        """The sentence's words that `encode` turns into "<unk>", in their order."""
        return tuple(word for word in _words(sentence) if word not in self._number)

    def check_same(self, other: Sequence[str]) -> None:
        """Raises LanguageError, which names the difference, where the other vocabulary is not just ours."""
        theirs = tuple(other)
        if theirs != self.vocabulary:
            raise LanguageError(f"the vocabularies differ: {_difference(self.vocabulary, theirs)}")


@lru_cache(maxsize=4096)
def _encode(tokenizer: Tokenizer, sentence: str) -> np.ndarray:
    words = _words(sentence)
    if len(words) > tokenizer.length:
        raise LanguageError(f"{quote(sentence)} has {len(words)} words; at most {tokenizer.length} fit")
    tokens = np.zeros(tokenizer.length, dtype=np.int64)
    tokens[: len(words)] = [tokenizer._number.get(word, 1) for word in words]
    tokens.flags.writeable = False
    return tokens


def _words(sentence: str) -> list[str]:
    return [word.text for word in split(sentence) if word.text[0].isalnum() or word.text[0] == "_"]


def _difference(ours: tuple[str, ...], theirs: tuple[str, ...]) -> str:
    missing = [word for word in ours if word not in theirs]
    extra = [word for word in theirs if word not in ours]
    if missing or extra:
        return "; ".join(
            f"only {whose} has {', '.join(map(quote, words))}"
            for whose, words in (("this one", missing), ("the other", extra))
            if words
        )
    place = next((i for i, (a, b) in enumerate(zip(ours, theirs, strict=False)) if a != b), len(ours))
    here, there = (words[place] if place < len(words) else "nothing" for words in (ours, theirs))
    return f"word {place} is {quote(here)} in this one and {quote(there)} in the other"
