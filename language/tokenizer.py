"""Tokenizer: sentences as arrays of token ids."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from language.errors import LanguageError, quote
from language.lexicon import lexicon, split

_WORDS = """
    reach touch go to move for push shove pick and place it up put take rotate swipe along the line drag throw toss
    poke nudge press down on turn twist switch flip toggle grasp grab hold of get lift raise red green blue yellow
    orange purple violet cyan turquoise pink gray grey object one thing cube block box sphere ball cylinder tube tin
    button knob lever handle wheel dial small little tiny large big huge solid opaque transparent translucent
    leftmost left rightmost right nearest closest farthest furthest most distant highest topmost top lowest bottom
    largest biggest smallest littlest at in front before behind back above over below under underneath beneath near
    close next beside by from between that is which not isn't a an this here there same position as then after you
    once please first could can would now robot hey i want thanks thank no meant mean sorry actually but
    stack drawer fridge door open pull shut unstack off into out remove
    hand palm me give pass bring my
    sort gather collect every
    """

WORD_ORDER: tuple[str, ...] = tuple(_WORDS.split())

MAX_WORDS = 32  # of a sentence, where nothing else is given
PAD, UNKNOWN = "<pad>", "<unk>"  # always ids 0 and 1


@dataclass(frozen=True)
class Tokenizer:
    """Maps words to token ids and back.

    vocabulary: every word once, at the index of its id; "<pad>" and "<unk>" come first. Checkpoints store it as a list
        of strings.
    length: token ids per sentence, padded with 0.

    Raises LanguageError for a vocabulary or length that is not of this form.
    """

    vocabulary: tuple[str, ...]
    length: int = MAX_WORDS

    def __post_init__(self) -> None:
        object.__setattr__(self, "vocabulary", tuple(self.vocabulary))
        if self.vocabulary[:2] != (PAD, UNKNOWN) or len(set(self.vocabulary)) != len(self.vocabulary):
            raise LanguageError(f"a vocabulary must begin with {PAD}, {UNKNOWN} and contain each word once")
        if self.length < 1:
            raise LanguageError(f"length={self.length} must be at least 1")

    @classmethod
    def default(cls, length: int = MAX_WORDS) -> Tokenizer:
        """Return the tokenizer of all words of the grammar: `WORD_ORDER`, then newer words in the registries' order.

        Adding a word leaves the ids of the others unchanged.
        """
        return cls(tuple(dict.fromkeys((PAD, UNKNOWN, *WORD_ORDER, *lexicon().words()))), length)

    @cached_property
    def _ids(self) -> dict[str, int]:
        return {word: number for number, word in enumerate(self.vocabulary)}

    def encode(self, sentence: str) -> np.ndarray:
        """Return (length,) int64 token ids. Unknown words have id 1; punctuation is left out.

        The array is read-only, since results are cached. Raises LanguageError for more words than `length`.
        """
        return _encode(self, sentence)

    def decode(self, tokens: Iterable[int]) -> str:
        """Return the words of token ids, without padding. Raises LanguageError for an id outside the vocabulary."""
        numbers = [int(token) for token in tokens]
        size = len(self.vocabulary)
        for number in numbers:
            if not 0 <= number < size:
                raise LanguageError(f"token {number} is out of range: it must be in [0, {size - 1}]")
        return " ".join(self.vocabulary[number] for number in numbers if number != 0)

    def unknown_words(self, sentence: str) -> tuple[str, ...]:
        """Return the words of the sentence that are not in the vocabulary, in order."""
        return tuple(word for word in _words(sentence) if word not in self._ids)

    def check_same(self, other: Sequence[str]) -> None:
        """Raise LanguageError, which names the difference, if another vocabulary is not equal to this one."""
        theirs = tuple(other)
        if theirs != self.vocabulary:
            raise LanguageError(f"the vocabularies differ: {_difference(self.vocabulary, theirs)}")


@lru_cache(maxsize=4096)
def _encode(tokenizer: Tokenizer, sentence: str) -> np.ndarray:
    words = _words(sentence)
    if len(words) > tokenizer.length:
        raise LanguageError(f"{quote(sentence)} has {len(words)} words; at most {tokenizer.length} fit")
    tokens = np.zeros(tokenizer.length, dtype=np.int64)
    tokens[: len(words)] = [tokenizer._ids.get(word, 1) for word in words]
    tokens.flags.writeable = False
    return tokens


def count_words(sentence: str) -> int:
    """Return how many numbers `Tokenizer.encode` needs for the sentence."""
    return len(_words(sentence))


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
