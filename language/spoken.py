"""What conversations have: a speaker who begins again, "is the, is the drawer open", or praises, "good, but ..."."""

from __future__ import annotations

import re

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
