"""Paraphrases: random sentences for a meaning, drawn from everything that the grammar understands."""

from __future__ import annotations

from typing import Any

from numpy.random import Generator

from language.errors import LanguageError
from language.instruction import Meaning, ObjectPhrase
from language.lexicon import lexicon
from language.splits import Split
from language.tokenizer import count_words

POLITE_SHARE = 0.15  # share of sentences with a polite opening, and share with a polite closing
TRIES = 100


class Wording:
    """Draws every word and template uniformly among its synonyms, within a split.

    "train", "test_composition" and "test_length" never use a held-out phrase; "test_paraphrase" uses at least one in
    each sentence.

    max_words: of a sentence, as `Tokenizer` counts them; None: any number.
    """

    def __init__(self, split: Split | None = None, max_words: int | None = None) -> None:
        split = split or Split()
        self._max_words = max_words
        self._held = frozenset(split.held_out.phrases)
        self._wants_held, self._all = split.name == "test_paraphrase", split.name == "all"

    def say(self, meaning: Meaning | ObjectPhrase, rng: Generator) -> str:
        """Return a random sentence for the meaning.

        Raises:
            LanguageError: no sentence has a required held-out phrase, or few enough words.
        """
        for _ in range(TRIES):
            used: list[str] = []
            sentence = meaning.words(lambda category, means: self._form(category, means, rng, used))  # noqa: B023
            if self._wants_held and not self._held.intersection(used):
                continue
            if not isinstance(meaning, ObjectPhrase):
                sentence = self._politely(sentence, rng)
            if self._max_words is None or count_words(sentence) <= self._max_words:
                return sentence
        limit = "" if self._max_words is None else f" in at most {self._max_words} words"
        raise LanguageError(f"'{meaning}' cannot be said with a held-out phrase{limit}")

    def _form(self, category: str, meaning: Any, rng: Generator, used: list[str]) -> str:
        forms = lexicon().forms(category, meaning)
        if not (self._all or self._wants_held):
            forms = tuple(form for form in forms if form not in self._held)
        form = forms[rng.integers(len(forms))] if len(forms) > 1 else forms[0]
        used.append(form)
        return form

    def _politely(self, sentence: str, rng: Generator) -> str:
        opens, closes = rng.random(2) < POLITE_SHARE
        if opens:
            sentence = f"{self._form('opening', 'opening', rng, [])} {sentence}"
        return f"{sentence}, {self._form('closing', 'closing', rng, [])}" if closes else sentence
