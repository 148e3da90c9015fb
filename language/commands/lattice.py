"""The lattice of a sentence.

For each word, it has the phrases of the lexicon that begin there, with the cost of misspellings.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple

from rapidfuzz import process
from rapidfuzz.distance import OSA

from language.commands import modifiers, nouns, verb_words
from language.errors import NotUnderstood, check_known

LONGEST_SENTENCE = 400  # characters
MOST_WORDS = 60
MOST_RELATIONS = 9  # tokens where a relation begins; commands that people wrote have up to 8
DROPPED = frozenset(
    {"the", "teh", "hte", "th", "tha", "-", '"', "\u201c", "\u201d", "*", "(", ")", "/", "_"}
)  # these are left out before parsing
TABLES: dict[str, dict[str, str]] = {  # category -> meaning -> phrases
    "fixture": nouns.FIXTURES,
    "region": nouns.REGIONS,
    "role": nouns.ROLES,
    "relation": modifiers.RELATIONS,
    "direction": modifiers.DIRECTIONS,
    "side": modifiers.SIDES,
    "superlative": modifiers.SUPERLATIVES,
    "unit": modifiers.UNITS,
    "verb": verb_words.VERBS,
    "control": verb_words.CONTROLS,
}
SPELLING_COST = 1.2  # of one wrong letter
_WORD = re.compile(r"\d+(?:[.,]\d+)?(?:st|nd|rd|th)?|[^\W\d_]+(?:['\u2019][^\W\d_]+)*|[^\w\s]|_")


class Token(NamedTuple):
    """A word in lower case or a mark, and its offsets in the sentence in characters."""

    text: str
    start: int
    end: int


class Edge(NamedTuple):
    """A phrase of the lexicon: the index of the token after it, its category and meaning, and its cost."""

    end: int
    category: str
    value: Any
    cost: float


class Lattice:
    """The tokens of a sentence and, for each, the edges that begin there, by category.

    unknown: indices of tokens that are no words of the lexicon, however spelt.
    gestures: how many accompany the sentence; if there are none, no word needs one.
    """

    def __init__(self, sentence: str, gestures: int = 0) -> None:
        """Raises NotUnderstood if the sentence is too long."""
        if len(sentence) > LONGEST_SENTENCE:
            raise NotUnderstood(f"the sentence has {len(sentence)} characters; use at most {LONGEST_SENTENCE}")
        self.gestures = gestures
        self.tokens = tokens(sentence)
        if len(self.tokens) > MOST_WORDS:
            raise NotUnderstood(f"the sentence has {len(self.tokens)} words; use at most {MOST_WORDS}")
        self.variants = [spellings(token.text) for token in self.tokens]
        self.unknown = {i for i, variants in enumerate(self.variants) if not variants}
        self.edges: list[dict[str, list[Edge]]] = [self._edges(i) for i in range(len(self.tokens))]

        if sum("relation" in edges for edges in self.edges) > MOST_RELATIONS:
            raise NotUnderstood(f"the sentence has more than {MOST_RELATIONS} relations; say it in several sentences")

    def __len__(self) -> int:
        return len(self.tokens)

    def get(self, index: int, category: str) -> list[Edge]:
        """Returns the edges of a category that begin at the token with this index."""
        return self.edges[index].get(category, []) if index < len(self.tokens) else []

    def _edges(self, start: int) -> dict[str, list[Edge]]:
        found: dict[str, list[Edge]] = {}
        open_nodes = [(start, trie(), 0.0)]
        while open_nodes:
            at, node, cost = open_nodes.pop()
            for category, value in node.get(None, ()):
                found.setdefault(category, []).append(Edge(at, category, value, cost))
            if at < len(self.tokens):
                for word, extra in self.variants[at]:
                    if word in node:
                        open_nodes.append((at + 1, node[word], cost + extra))
        if not self.gestures:
            found.pop("pointing", None)
        elif "pointing" in found:
            found.pop("control", None)  # "that one", otherwise for "yes"
        number = _number(self.tokens[start].text)
        if number is not None:
            found.setdefault("number", []).append(Edge(start + 1, "number", number, 0.0))
        return found


def tokens(sentence: str) -> list[Token]:
    """Returns the words and marks of the sentence, without articles and quotation marks."""
    lowered = sentence.lower() if len(sentence.lower()) == len(sentence) else sentence
    found = (Token(m[0].replace("\u2019", "'"), m.start(), m.end()) for m in _WORD.finditer(lowered))
    return [token for token in found if token.text not in DROPPED]


def spellings(word: str) -> tuple[tuple[str, float], ...]:
    """Returns the known words that a word may be, with their costs; () if it is similar to none."""
    if word in vocabulary() or _number(word) is not None:
        return ((word, 0.0),)
    if len(word) < 3 or len(word) > 20 or not word.isalpha():
        return ()
    return _corrected(word)


@cache
def _corrected(word: str) -> tuple[tuple[str, float], ...]:
    most = 1 if len(word) < 6 else 2
    found = process.extract(word, _choices(), scorer=OSA.distance, processor=None, score_cutoff=most, limit=None)
    near = [(known, cost + 0.3 * (known[0] != word[0])) for known, cost, _ in found if cost < len(known) - 1]
    best = min((cost for _, cost in near), default=0.0)
    return tuple((known, SPELLING_COST * cost) for known, cost in near if cost <= best + 0.3)[:8]


@cache
def _choices() -> tuple[str, ...]:
    return tuple(sorted(word for word in vocabulary() if len(word) > 2))


def _number(word: str) -> float | None:
    try:
        return float(word.replace(",", ".")) if word[0].isdecimal() else None
    except ValueError:
        return None


@cache
def vocabulary() -> frozenset[str]:
    """Returns every single word of the lexicon."""
    found: set[str] = set(verb_words.FILLERS)
    nodes = [trie()]
    while nodes:
        node = nodes.pop()
        for word, below in node.items():
            if word is not None:
                found.add(word)
                nodes.append(below)
    return frozenset(found)


@cache
def trie() -> dict:
    """Returns the phrases as nested dicts; under None, the categories and meanings of the phrase that ends there."""
    root: dict = {}
    for category, value, phrase in _entries():
        node = root
        for token in tokens(phrase):
            node = node.setdefault(token.text, {})
        ends = node.setdefault(None, [])
        if node is not root and (category, value) not in ends:
            ends.append((category, value))
    root.pop(None, None)
    return root


def _entries() -> Iterator[tuple[str, Any, str]]:
    """Yields (category, meaning, phrase) for every phrase of the lexicon."""
    for phrase, names in nouns.colors().items():
        yield "color", names, phrase
    for kind, words in nouns.nouns().items():
        yield from (("noun", kind, phrase) for phrase in words)
    for phrase, size in nouns.sizes().items():
        yield "size", size, phrase
    for category, table in TABLES.items():
        for value, text in table.items():
            yield from ((category, value, phrase) for phrase in nouns.phrases(text))
    for category, text in {**modifiers.SINGLES, **verb_words.SINGLES, "stack": nouns.STACKS}.items():
        yield from ((category, phrase, phrase) for phrase in nouns.phrases(text))
    for number, phrase in enumerate(modifiers.NUMBERS):
        yield "number", float(number), phrase
    for phrase, rank in modifiers.ORDINALS.items():
        yield "ordinal", rank, phrase


def teach(category: str, meaning: str, phrase: str) -> None:
    """Adds a phrase to the lexicon: `teach("verb", "take", "snatch")`.

    Args:
        category: a key of TABLES.
        meaning: a key of that table.
        phrase: one or more words.

    Raises:
        LanguageError: an unknown category or meaning.
    """
    check_known("category", category, TABLES)
    check_known(category, meaning, TABLES[category])
    TABLES[category][meaning] += f", {phrase}"
    forget_caches()


def forget_caches() -> None:
    """Clears the caches of the lexicon after its tables were changed."""
    for cached in (trie, vocabulary, _choices, _corrected):
        cached.cache_clear()
