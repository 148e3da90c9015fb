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
    """Return a sentence without praise before "but", and without what its speaker begins again or takes back."""
    sentence = _PRAISE.sub("", sentence)
    sentence = _DID_MEAN.sub(r"\1 meant", _SHOULD.sub(r"\1 would ", sentence))
    sentence = _AGAIN.sub("", _HALTED.sub("", sentence))
    for _ in range(3):
        shorter = _BEGUN.sub(lambda match: match["before"], sentence)
        if shorter == sentence:
            break
        sentence = shorter
    return sentence


_ER = r"(?:u+h*m+|u+h+|e+r+m*|e+h+m*|h+m+|\u00e4h+m?|no|sorry|wait|i mean)"
_JOIN = (
    r"(?:on top of|next to|in front of|(?:to the )?(?:left|right) of|on|onto|in|into|inside|behind|under|near|beside|to"
    r"|at|by)"
)
_PHRASE = r"(?:(?!(?:and|or|then|but)\b)[\w']+\s+){0,3}?(?:(?!(?:and|or|then|but)\b)[\w']+)"
_HALTED = re.compile(  # "on the yellow, ehm, on the cyan one"
    rf"\b(?P<wrong>(?P<join>{_JOIN})\s+(?:the\s+)?{_PHRASE})\s*(?:,|\.\.+|\u2026|-|\u2013|\u2014)*\s*"
    rf"\b(?:{_ER}\b\s*(?:,|\.\.+|\u2026|-|\u2013|\u2014)*\s*)+(?=(?P=join)\s+\w)",
    re.IGNORECASE,
)
_AGAIN = re.compile(  # "on the, um, the yellow one"
    r"\b(?P<word>[\w']+)\s*[,.\u2026\u2013\u2014-]*\s*"
    r"\b(?:u+h*m+|u+h+|e+r+m*|e+h+m+|h+m+)\b\s*[,.\u2026\u2013\u2014-]*\s*"
    r"(?=(?P=word)\b)",
    re.IGNORECASE,
)
_SHOULD = re.compile(
    r"\b(I|we) should (?=(?:(?:now|also|just|really|still|then|very much|rather) )*"
    r"(?:like|love|prefer|be (?:glad|happy|grateful|obliged|pleased|delighted))\b)",
    re.IGNORECASE,
)
_DID_MEAN = re.compile(r"\b(I) (?:did|do) (?:really |actually |in fact )?mean\b", re.IGNORECASE)


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
