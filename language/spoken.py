"""What conversations have: a speaker who begins again, "is the, is the drawer open", or praises, "good, but ..."."""

from __future__ import annotations

import re

from language.scanning import Token
from language.words import phrases

_HUMS = r"(?:u+h+|u+m+|erm?|hm+|so|well|okay|ok|and|but|then|now|yeah|please|no)"
_BEGUN = re.compile(
    rf"(?:^|(?<=[.!?;,]))(?P<before>\s*(?:{_HUMS}\b,?\s+)*)"
    r"(?P<begun>[\w']+(?:\s+[\w']+){0,3})\s*(?:,|\.\.+|\u2026|-|\u2013|\u2014)+\s*(?=(?P=begun)\s+\w)",
    re.IGNORECASE,
)
_PRAISE = re.compile(
    r"^\s*(?:(?:that(?:'s| is)|it(?:'s| is)|looks|very|really|pretty|quite)\s+)*"
    r"(?:good|nice|great|fine|okay|ok|close|almost|nearly|not bad|better|perfect|lovely|well done)\s*,?\s+but\s+"
    r"(?!not\b|no\b|do\s?n.?t\b)",
    re.IGNORECASE,
)


def fluent(sentence: str) -> str:
    """Return a sentence without praise before "but", and without what its speaker begins again."""
    sentence = _PRAISE.sub("", sentence)
    for _ in range(3):
        shorter = _BEGUN.sub(lambda match: match["before"], sentence)
        if shorter == sentence:
            break
        sentence = shorter
    return sentence


_BEFORE_A_THING = frozenset(
    phrases("near, to, in, on, of, at, into, onto, behind, beside, between, by, from, under, with")
)
_BEGINNINGS = frozenset(
    phrases("that is, which is, it is, not, but not, i want, can you, could you, put, take, move, a")
)
_LONGEST = 3  # words that are said again within a clause


def without_restarts(found: list[Token]) -> list[Token]:
    """Return the words of a clause without those that its speaker says again: "near the, near the red cube"."""
    for size in range(_LONGEST, 0, -1):
        for at in range(len(found) - 2 * size):
            one, two = ([token.text for token in found[i : i + size]] for i in (at, at + size + 1))
            again = one == two and found[at + size].text == ","
            if again and (one[-1] in _BEFORE_A_THING or " ".join(one) in _BEGINNINGS):
                return without_restarts(found[: at + size] + found[at + 2 * size + 1 :])
    return found
