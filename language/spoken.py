"""What conversations have: a speaker who begins again, "is the, is the drawer open", or praises, "good, but ..."."""

from __future__ import annotations

import re

from language.scanning import Token
from language.words import phrases

_SOUND = r"(?:u+h*m+|u+h+|e+r+m*|e+h+m*|h+m+|\u00e4h+m?)"
_PAUSE = r"\s*[,.\u2026\u2013\u2014-]*\s*"
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
_ER = rf"(?:{_SOUND}|no|sorry|wait|i mean)"
_JOIN = (
    r"(?:on top of|next to|in front of|(?:to the )?(?:left|right) of|on|onto|in|into|inside|behind|under|near|beside|to"
    r"|at|by)"
)
_PHRASE = r"(?:(?!(?:and|or|then|but)\b)[\w']+\s+){0,3}?(?:(?!(?:and|or|then|but)\b)[\w']+)"
_HALTED = re.compile(  # "on the yellow, ehm, on the cyan one"
    rf"\b(?P<wrong>(?P<join>{_JOIN})\s+(?:the\s+)?{_PHRASE}){_PAUSE}\b(?:{_ER}\b{_PAUSE})+(?=(?P=join)\s+\w)",
    re.IGNORECASE,
)
_AGAIN = re.compile(  # "on the, um, the yellow one"
    rf"\b(?P<word>[\w']+){_PAUSE}\b{_SOUND}\b{_PAUSE}(?=(?P=word)\b)",
    re.IGNORECASE,
)
_SHOULD = re.compile(
    r"\b(I|we) should (?=(?:(?:now|also|just|really|still|then|very much|rather) )*"
    r"(?:like|love|prefer|be (?:glad|happy|grateful|obliged|pleased|delighted))\b)",
    re.IGNORECASE,
)
_DID_MEAN = re.compile(r"\b(I) (?:did|do) (?:really |actually |in fact )?mean\b", re.IGNORECASE)
_ITS = re.compile(  # "its my turn"
    r"\b(it)s (?=(?:my|your|our|a|an|the|too|not|time|been|getting|still|going|ok|okay|fine|good|nice|already)\b)",
    re.IGNORECASE,
)
_RHETORICAL = re.compile(  # what is said before a command or a question and asks for nothing
    rf"^\s*(?:{_HUMS}\b,?\s+)*(?:how (?:many times|often) (?:do|must|should|have) i (?:have to |need to |got to )?"
    r"(?:say|tell|ask|repeat)\b[^,.;:!?]*[,.;:!?]+"
    r"|what was i (?:going to say|about to say|saying|just saying)"
    r"(?:[,.?!\s]+(?:oh|right|yes|ah|well|again|hm+|u+h+|u+m+)\b)*"
    r"|without \w+ing (?:anything|any \w+),?)[,.?!\s]*(?=\w)",
    re.IGNORECASE,
)
_NOT_BUT = re.compile(  # "don't put it in the drawer put it in the other one"
    r"\b(?P<not>(?:do not|don['\u2019]?t) (?P<verb>put|place|set|drop|stack|lay|move|take|give|open|close|touch)\b"
    r"[^,.;:!?]+?)"
    r" (?=(?P=verb) (?:it|that|the)\b)",
    re.IGNORECASE,
)
_IF_SO = re.compile(  # "check whether it is empty, and if so put ..."
    r"\b(?:check|see|look|test|find out) (?:if|whether) (?P<so>.+?),?"
    r"(?:(?: and)? if (?:so|yes|it is|that is so)\b,?(?: then\b)?"
    r"|(?: and| then)+(?= (?:put|take|give|bring|move|hand|get) (?:it|that|them)\b))",
    re.IGNORECASE,
)
_DICTATED = tuple(  # marks that a speaker says to a recogniser
    (re.compile(rf"(?:^|(?<=\w))\s*\b(?:{said})\b\s*{end}", re.IGNORECASE), mark)
    for said, end, mark in (
        ("full stop|period", r"\W*$", "."),
        ("question mark", "", "? "),
        ("exclamation mark|exclamation point", "", "! "),
        ("comma", "", ", "),
        ("new line|new paragraph", "", " "),
    )
)
_TO_A_DEAR = re.compile(
    r"\s*,\s*(?:my )?(?:dear|love|darling|honey|sweetie|pal|mate|buddy|sir|madam)(?=\s*[.!?]?\s*$)", re.IGNORECASE
)
_TO_A_MAN = re.compile(r"^\s*(?:young|old|good|my) (?:man|lady|fellow|boy|girl)\s*,\s*", re.IGNORECASE)
_BEFORE_A_THING = frozenset(
    phrases("near, to, in, on, of, at, into, onto, behind, beside, between, by, from, under, with")
)
_BEGINNINGS = frozenset(
    phrases("that is, which is, it is, not, but not, i want, can you, could you, put, take, move, a")
)
_LONGEST = 3  # words that are said again within a clause


def fluent(sentence: str) -> str:
    """Return a sentence without praise before "but", and without what its speaker begins again or takes back."""
    for said, mark in _DICTATED:
        sentence = said.sub(mark, sentence)
    sentence = _TO_A_MAN.sub("", _TO_A_DEAR.sub("", sentence)) or sentence
    sentence = _IF_SO.sub(r"if \g<so>,", _ITS.sub(r"\1's ", sentence))
    sentence = _NOT_BUT.sub(r"\g<not>, ", _RHETORICAL.sub("", _PRAISE.sub("", sentence)))
    sentence = _DID_MEAN.sub(r"\1 meant", _SHOULD.sub(r"\1 would ", sentence))
    sentence = _AGAIN.sub("", _HALTED.sub("", sentence))
    for _ in range(3):
        shorter = _BEGUN.sub(lambda match: match["before"], sentence)
        if shorter == sentence:
            break
        sentence = shorter
    return sentence


def without_restarts(found: list[Token]) -> list[Token]:
    """Return the words of a clause without those that its speaker says again: "near the, near the red cube"."""
    for size in range(_LONGEST, 0, -1):
        for at in range(len(found) - 2 * size):
            one, two = ([token.text for token in found[i : i + size]] for i in (at, at + size + 1))
            again = one == two and found[at + size].text == ","
            if again and (one[-1] in _BEFORE_A_THING or " ".join(one) in _BEGINNINGS):
                return without_restarts(found[: at + size] + found[at + 2 * size + 1 :])
    return found
