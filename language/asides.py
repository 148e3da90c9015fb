"""Asides: what is said beside a command and asks for nothing: "it is too cold", "for later", "if I asked you to".

An aside is a phrase of the table `asides` in `words.yaml`, or a clause whose verb is none of the robot's. It holds no
word that names a thing, a colour, a place or a number of things, so that leaving it out changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set

from language.scanning import MARKS
from language.words import TABLE, phrases

PHRASE, CLAUSE, WORD = 0.1, 0.5, 0.06  # costs: of a phrase; of a clause, and of each of its words
MOST_WORDS = 10
_CONTENT = frozenset(
    phrases("noun, color, stack, both, every, superlative, side, direction, role, ordinal, held, done")
)
_WORDS = {name: frozenset(text.split()) for name, text in TABLE["clauses"].items()}


def clause_ends(words: Sequence[str], start: int, content: Callable[[int], bool]) -> list[int]:
    """Return where an aside that begins at a word may end: after its verb or any later word that names nothing.

    content: whether the word with an index names something.
    """
    at, count = start, len(words)
    reason = at < count and words[at] in _WORDS["reasons"]
    while at < count and words[at] in _WORDS["leads"] | _WORDS["reasons"]:
        at += 1
    subject = _subject_end(words, at, content)
    if subject is None or subject >= count:
        return []
    first = words[at]
    at = subject
    while at < count and words[at] in _WORDS["adverbs"]:
        at += 1
    if at >= count or not _is_verb(first, words, at, reason):
        return []
    found = []
    if words[at] in _WORDS["helping"] and words[at + 1 : at + 2] == ["not"]:
        at = min(at + 2, count - 1)  # what somebody cannot or does not do
    while at + 1 < count and words[at + 1] in _WORDS["adverbs"] | _WORDS["wishes"] | _WORDS["verbs"]:
        at += 1  # "do not really need"
    for end in range(at + 1, min(count, at + MOST_WORDS) + 1):
        if words[end - 1] not in _WORDS["negations"]:  # what follows belongs to it
            found.append(end)
        if end < count and (words[end] in MARKS or words[end] in _WORDS["obliged"] or content(end)):
            break
    return found


def _subject_end(words: Sequence[str], at: int, content: Callable[[int], bool]) -> int | None:
    """Return the word after the subject of a clause: a pronoun, or a noun that names nothing of the scene."""
    if at >= len(words):
        return None
    if words[at] in _WORDS["subjects"]:
        relative = words[at] == "that" and at and words[at - 1] not in MARKS | _WORDS["leads"] | _WORDS["reasons"]
        return None if relative else at + 1  # "everything that is open"
    if words[at] in _WORDS["owners"]:
        ends = [end for end in (at + 2, at + 3) if not any(content(i) for i in range(at + 1, min(end, len(words))))]
        return next((end for end in ends if end < len(words) and words[end] in _WORDS["verbs"]), None)
    return None


def _is_verb(subject: str, words: Sequence[str], at: int, reason: bool) -> bool:
    word, after = words[at], words[at + 1] if at + 1 < len(words) else ""
    negated = after in _WORDS["negations"] or (at and words[at - 1] == "not")
    if subject == "you":
        return word in _WORDS["yours"] and after not in _WORDS["obliged"]
    if word in _WORDS["wishes"]:
        return reason or negated or subject not in ("i", "we")
    return word in _WORDS["verbs"] and after not in _WORDS["obliged"]


def is_content(categories: Set[str], word: str, nouns: set[str], acts: bool) -> bool:
    """Return whether a word with these categories of the lexicon names something of the scene, a place or an act."""
    named = categories & _CONTENT
    if named - {"noun"} or nouns - {"thing"} or word in _WORDS["places"]:
        return True
    return acts and word not in _WORDS["verbs"]
