"""What only speech has: a speaker who begins a sentence again, "is the, is the drawer open"."""

from __future__ import annotations

import re

_HUMS = r"(?:u+h+|u+m+|erm?|hm+|so|well|okay|ok|and|but|then|now|yeah|please|no)"
_BEGUN = re.compile(
    rf"(?:^|(?<=[.!?;,]))(?P<before>\s*(?:{_HUMS}\b,?\s+)*)"
    r"(?P<begun>[\w']+(?:\s+[\w']+){0,3})\s*(?:,|\.\.+|\u2026|-|\u2013|\u2014)+\s*(?=(?P=begun)\s+\w)",
    re.IGNORECASE,
)


def fluent(sentence: str) -> str:
    """Return a sentence without the words with which its speaker began a part of it before."""
    for _ in range(3):
        shorter = _BEGUN.sub(lambda match: match["before"], sentence)
        if shorter == sentence:
            break
        sentence = shorter
    return sentence
