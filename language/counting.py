"""The number of different sentences of the grammar, computed without enumerating them."""

from __future__ import annotations

from math import prod

from language.lexicon import Lexicon, lexicon
from language.verbs import BASE, EVERY, GOAL, OBJECT, VERBS


def count(depth: int, words: Lexicon | None = None) -> int:
    """Returns the number of different one-step sentences whose phrases nest at most `depth` relations.

    Polite words, "that is", punctuation, chains and corrections are not counted; they would multiply the number.
    """
    words = words or lexicon()
    phrases, each = _phrases(depth, words)
    here_or_there = _forms(words, "spot")
    objects, goals = phrases + here_or_there, _forms(words, "place") * phrases + here_or_there
    total = 0
    for task, templates in words.templates.items():
        moved = objects + (each * _forms(words, EVERY) if task in VERBS and VERBS[task].takes_every else 0)
        for pieces in templates:
            total += moved ** pieces.count(OBJECT) * objects ** pieces.count(BASE) * goals ** pieces.count(GOAL)
    return total


def _phrases(depth: int, words: Lexicon) -> tuple[int, int]:
    """The numbers of different phrases for one object, and of those after "every", with `depth` relations at most."""
    heads = _heads(words)
    named = each = 0
    for _ in range(depth + 1):
        where = 1 + _forms(words, "relation") * named + _forms(words, "between") * named**2 if named else 1
        each = heads * where
        full = (1 + _forms(words, "pointing")) * each + _forms(words, "superlative") * where
        named = full + _forms(words, "pointing") + _forms(words, "it")
    return named, each


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
