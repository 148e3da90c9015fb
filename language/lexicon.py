"""The lexicon: all words of the registries in their current state, and the split of a sentence into words."""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import prod
from typing import Any, NamedTuple

from language.colors import COLORS
from language.errors import NotUnderstood
from language.objects import ANY_NOUN, NOUNS, ROLE_WORDS, SIZES
from language.relations import RELATIONS, SUPERLATIVES
from language.verbs import (
    AFTER,
    BASE,
    BUT,
    CLOSINGS,
    EVERY,
    GOAL,
    HERE,
    IT,
    NO,
    NOT,
    OBJECT,
    OPENINGS,
    PLACES,
    POINTING,
    THEN,
    VERBS,
    has_goal,
)

LONGEST_SENTENCE = 1000  # characters; longer input is refused before it is processed
EXCLUDING = ("that is not", "that isn't", "which is not", "which isn't")  # the first is used by `say`
WHICH_IS = ("that is", "which is")  # optional before a relation

# Meaning -> its phrases; `say` uses the first.
Forms = dict[Any, tuple[str, ...]]

WORD_OR_MARK = re.compile(r"[^\W\d_]+(?:['\u2019][^\W\d_]+)?|\w+|[^\w\s]")
SAME = {"\u2019": "'", ";": ","}  # characters that are read as others
_SAME = str.maketrans(SAME)
_SLOTS = (OBJECT, GOAL, BASE)
_SLOT = re.compile(f"({'|'.join(map(re.escape, _SLOTS))})")


class Word(NamedTuple):
    """A word in lower case, or a punctuation mark, and its offset in the sentence in characters from 0."""

    text: str
    position: int


@dataclass(frozen=True, eq=False)
class Lexicon:
    """All meanings and phrases of the language.

    categories: by category, the meanings with their phrases.
    templates: by task, each template split at its slots: ("pick", "{object}", "and place it", "{goal}").

    Compared and hashed by identity: `lexicon` returns the same object until a registry changes.
    """

    categories: dict[str, Forms]
    templates: dict[str, tuple[tuple[str, ...], ...]]

    def form(self, category: str, meaning: Any) -> str:
        """Return the standard phrase for the meaning. The meaning of a "task" is (name, whether it has a goal)."""
        return self.forms(category, meaning)[0]

    def forms(self, category: str, meaning: Any) -> tuple[str, ...]:
        """Return every phrase for the meaning, the standard one first."""
        if category != "task":
            return self.categories[category][meaning]
        task, with_goal = meaning
        return tuple(words for words in VERBS[task].templates if has_goal(words) == with_goal)

    def phrases(self) -> tuple[str, ...]:
        """Return every fixed phrase of the language once."""
        forms = [form for meanings in self.categories.values() for forms in meanings.values() for form in forms]
        pieces = [piece for cut in self.templates.values() for template in cut for piece in template]
        return tuple(dict.fromkeys(piece for piece in (*pieces, *forms) if piece not in _SLOTS))

    def words(self) -> tuple[str, ...]:
        """Return every word once, in the order of the registries."""
        return tuple(dict.fromkeys(word for phrase in self.phrases() for word in phrase.split()))


_REGISTRIES: tuple[dict[str, Any], ...] = (COLORS, NOUNS, ROLE_WORDS, SIZES, RELATIONS, SUPERLATIVES, VERBS)
_latest: tuple[tuple[dict[str, Any], ...], Lexicon] | None = None


def lexicon() -> Lexicon:
    """Return the lexicon of the registries. It is cached until one of them changes, since every parse needs it."""
    global _latest
    if _latest is None or _latest[0] != _REGISTRIES:
        _latest = tuple(dict(registry) for registry in _REGISTRIES), _read()
    return _latest[1]


def _read() -> Lexicon:
    by_anchors: list[Forms] = [
        {name: (name, *known.synonyms) for name, known in RELATIONS.items() if known.anchors == count}
        for count in (1, 2)
    ]
    return Lexicon(
        categories={
            "the": {"the": ("the",)},
            "color": {name: (name, *color.synonyms) for name, color in COLORS.items()},
            "noun": {None: ANY_NOUN} | {noun: (noun, *synonyms) for noun, synonyms in NOUNS.items()},
            "size": {name: (name, *size.synonyms) for name, size in SIZES.items()},
            "role": dict(ROLE_WORDS),
            "superlative": {name: (name, *known.synonyms) for name, known in SUPERLATIVES.items()},
            "side": {name: known.after for name, known in SUPERLATIVES.items() if known.after},
            "relation": by_anchors[0],
            "between": by_anchors[1],
            "and": {"and": ("and",)},
            "which_is": {"which_is": WHICH_IS},
            "excluding": {"excluding": EXCLUDING},
            "a": {"a": ("a",), "an": ("an",)},
            "pointing": {word: (word,) for word in POINTING},
            IT: {IT: (IT,)},
            EVERY: {EVERY: (EVERY,)},
            "spot": {HERE[0]: (HERE[0], "right here"), HERE[1]: (HERE[1], "over there", "right there")},
            "place": {"place": PLACES},
            "then": {"then": THEN},
            "after": {"after": AFTER},
            "opening": {"opening": OPENINGS},
            "closing": {"closing": CLOSINGS},
            "no": {"no": NO},
            "not": {"not": NOT},
            "but": {"but": BUT},
        },
        templates={name: tuple(split_template(words) for words in task.templates) for name, task in VERBS.items()},
    )


def split_template(template: str) -> tuple[str, ...]:
    """Split a template at its slots: "push {object} {goal}" to ("push", "{object}", "{goal}")."""
    return tuple(piece.strip() for piece in _SLOT.split(template) if piece.strip())


def split(sentence: str) -> list[Word]:
    """Return the words and marks of a sentence. Raises NotUnderstood if it is longer than LONGEST_SENTENCE."""
    if len(sentence) > LONGEST_SENTENCE:
        message = f"the sentence has {len(sentence)} characters; at most {LONGEST_SENTENCE} are read"
        raise NotUnderstood(message, LONGEST_SENTENCE)
    found = WORD_OR_MARK.finditer(sentence)
    return [Word(word.group().lower().translate(_SAME), word.start()) for word in found]


def count(depth: int, words: Lexicon | None = None) -> int:
    """Return the number of different one-step sentences whose phrases nest at most `depth` relations.

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
