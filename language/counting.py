"""The number of different sentences of the grammar, computed without enumerating them."""

from __future__ import annotations

from math import prod

from language.lexicon import Lexicon, lexicon
from language.verbs import BASE, GOAL, OBJECT


def count(depth: int, words: Lexicon | None = None) -> int:
    """Returns the number of different one-step sentences whose phrases nest at most `depth` relations.

    Polite words, "that is", punctuation, chains and corrections are not counted; they would multiply the number.
    """
    words = words or lexicon()
    phrases = _phrases(depth, words)
    here_or_there = _forms(words, "spot")
    objects, goals = phrases + here_or_there, _forms(words, "place") * phrases + here_or_there
    cuts = [pieces for templates in words.templates.values() for pieces in templates]
    return sum(objects ** (pieces.count(OBJECT) + pieces.count(BASE)) * goals ** pieces.count(GOAL) for pieces in cuts)


def _phrases(depth: int, words: Lexicon) -> int:
    """The number of different phrases that nest at most `depth` relations."""
    heads = _heads(words)
    named = 0
    for _ in range(depth + 1):
        where = 1 + _forms(words, "relation") * named + _forms(words, "between") * named**2 if named else 1
        full = ((1 + _forms(words, "pointing")) * heads + _forms(words, "superlative")) * where
        named = full + _forms(words, "pointing") + _forms(words, "it")
    return named


def _heads(words: Lexicon) -> int:
    """The number of different heads, including their exclusions."""
    adjectives = [_forms(words, category) for category in ("size", "role", "color")]
    optional = prod(1 + forms for forms in adjectives) * (1 + _forms(words, "superlative") + _forms(words, "side"))
    nouns = _forms(words, "noun")
    any_nouns = len(words.categories["noun"].get(None, ()))
    not_nouns = _forms(words, "a") * (prod(1 + forms for forms in adjectives) * nouns - any_nouns)
    return optional * nouns * (1 + _forms(words, "excluding") * (sum(adjectives) + not_nouns))


def _forms(words: Lexicon, category: str) -> int:
    """The number of different phrases of a category."""
    return len({form for forms in words.categories[category].values() for form in forms})
