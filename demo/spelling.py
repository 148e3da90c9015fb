"""Sentences in the words of the instruction grammar: typing errors are corrected and short forms written out."""

from __future__ import annotations

import re
from functools import cache

from rapidfuzz import process
from rapidfuzz.distance import OSA

from language import Tokenizer

SHORT = {"pls": "please", "plz": "please", "thx": "thanks", "u": "you"}
WORD = re.compile(r"[a-z]+", re.IGNORECASE)
LEAST = 3  # letters of a word that is corrected


def tidied(sentence: str) -> str:
    """The sentence with the nearest known word in place of each unknown one that is near to one only."""
    return WORD.sub(lambda match: _known(match[0].lower()), sentence)


@cache
def _known(word: str) -> str:
    words = _words()
    if word in SHORT or word in words or len(word) < LEAST:
        return SHORT.get(word, word)
    most = 1 if len(word) < 6 else 2
    found = process.extract(word, words, scorer=OSA.distance, processor=None, score_cutoff=most, limit=2)
    nearest = [known for known, distance, _ in found if distance == found[0][1]]
    return nearest[0] if len(nearest) == 1 else word


@cache
def _words() -> tuple[str, ...]:
    return tuple(word for word in Tokenizer.default().vocabulary if word.isalpha())
