"""How many different sentences the grammar can say, counted without saying them."""

from __future__ import annotations

from math import prod

from language.lexicon import Lexicon, lexicon
from language.verbs import BASE, GOAL, OBJECT


def count(depth: int, words: Lexicon | None = None) -> int:
    """The number of different sentences of one step whose phrases nest at most `depth` relations deep.

    Without polite words, "that is", marks, chains and corrections, which would multiply it further.
    """
    words = words or lexicon()
    phrases = _phrases(depth, words)
    spots = _forms(words, "spot")
    objects, goals = phrases + spots, _forms(words, "place") * phrases + spots
    cuts = [pieces for templates in words.templates.values() for pieces in templates]
    return sum(objects ** (pieces.count(OBJECT) + pieces.count(BASE)) * goals ** pieces.count(GOAL) for pieces in cuts)


def _phrases(depth: int, words: Lexicon) -> int:
    """Different phrases that nest at most `depth` relations."""
    heads = _heads(words)
    named = 0
    for _ in range(depth + 1):
        where = 1 + _forms(words, "relation") * named + _forms(words, "between") * named**2 if named else 1
        full = ((1 + _forms(words, "pointing")) * heads + _forms(words, "superlative")) * where
        named = full + _forms(words, "pointing") + _forms(words, "it")
    return named


def _heads(words: Lexicon) -> int:
    """Different heads, with what they exclude."""
    adjectives = [_forms(words, category) for category in ("size", "role", "color")]
    optional = prod(1 + forms for forms in adjectives) * (1 + _forms(words, "superlative") + _forms(words, "side"))
    nouns = _forms(words, "noun")
    any_nouns = len(words.categories["noun"].get(None, ()))
    not_nouns = _forms(words, "a") * (prod(1 + forms for forms in adjectives) * nouns - any_nouns)
    return optional * nouns * (1 + _forms(words, "excluding") * (sum(adjectives) + not_nouns))


def _forms(words: Lexicon, category: str) -> int:
    """Different phrases of a category."""
    return len({form for forms in words.categories[category].values() for form in forms})
