"""Words and marks of a text, and patterns for words that the rules of wordings name."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from functools import cache
from typing import NamedTuple

from language.verbs import KNOWN, OBJECT, Act
from language.words import TABLE, phrases

MARKS = frozenset(".,;:!?")
THING = "cubes?|blocks?|drawer|fridge|button|lever|wheel|tower|stack"
COLOR = "red|blue|yellow|orange|cyan|gray|grey|green|pink|purple|white"

_FORMS = (  # verbs whose past and participle are irregular
    "put put, take took taken, give gave given, bring brought, get got gotten, set set, lay laid, hold held, "
    "shut shut, leave left, keep kept, stand stood, slide slid, spin spun, hit hit, build built, make made, "
    "throw threw thrown, swing swung, stick stuck, let let, hang hung, find found, go went gone, send sent, "
    "draw drew drawn, catch caught, hide hid hidden"
)
_IRREGULAR = {forms.split()[0]: forms.split()[1:] for forms in _FORMS.split(", ")}
_DOUBLED = re.compile(r"^[^aeiou]*[aeiou][bdgkmnprt]$")


class Token(NamedTuple):
    """A word in lower case or a mark, and its offsets in the sentence in characters."""

    text: str
    start: int
    end: int


def text_of(tokens: Iterable[Token]) -> str:
    """Return words and marks as a text, which single spaces separate."""
    return " ".join(token.text for token in tokens)


_WORD = re.compile(
    r"[-=~]+>|[\u2190-\u21ff\u2794\u27a1]|\d+(?:[.,]\d+)?(?:st|nd|rd|th)?(?=\W|$|[a-z])"
    r"|[^\W\d_]+(?:['\u2019][^\W\d_]+)*|[.,;:!?&+/()*@>-]|_|\d+"
)
_LONG = re.compile(r"([a-z])\1{2,}")  # "nooo"
_DROPPED = frozenset({"-", '"', "*", "(", ")", "_", "the", "teh", "hte", "th", "tha"})
_SHORT = dict(pair.split(": ") for pair in phrases(TABLE["short"]))  # without an apostrophe
_SWAPPED = {  # neighbouring letters of the commonest words: "taht"
    word[:at] + word[at + 1] + word[at] + word[at + 2 :]: word
    for word in phrases(TABLE["swapped"])
    for at in range(len(word) - 1)
}
_SHORT = _SWAPPED | _SHORT
_CLITICS = {"ll": "will", "re": "are", "ve": "have", "m": "am", "d": "would"}
_BE = phrases("that, there, here, what, where, who, it, how, he, she, everything, something, nothing, when, why, this")
_HUMS = frozenset(phrases(TABLE["hums"]))


def scan(text: str) -> list[Token]:
    """Return the words and marks of a text: contractions written out; without articles, emoji and doubled words."""
    lowered = text.lower() if len(text.lower()) == len(text) else text
    found: list[Token] = []
    for match in _WORD.finditer(lowered):
        for word in _written_out(_LONG.sub(r"\1", match[0].replace("\u2019", "'"))):
            if not word or word in _DROPPED or word in _HUMS:
                continue
            if word == "to" and match[0] != "to" and _is_step(lowered[match.end() :]) and _is_step(lowered):
                word = ";"  # "open the drawer -> put it in", not "red -> blue"
            found.append(Token(word, match.start(), match.end()))
    return found


def _is_step(text: str) -> bool:
    """Whether a text begins with a verb."""
    return re.match(rf"\W*(?:{verb_words()})\b", text) is not None


def _written_out(word: str) -> list[str]:
    if word == ">":
        return [";"]
    if word[-1] in ">\u2192\u2794\u27a1":
        return ["to"]
    if word in _SHORT:
        return _SHORT[word].split()
    stem, mark, tail = word.partition("'")
    if not mark:
        return ["and"] if word in "&+" else [","] if word == "/" else ["at"] if word == "@" else [word]
    if word.endswith("n't"):
        return [{"ca": "can", "wo": "will", "sha": "shall"}.get(word[:-3], word[:-3]), "not"]
    if tail in _CLITICS:
        return [stem, _CLITICS[tail]]
    if tail == "s":
        return [stem, "us" if stem == "let" else "is"] if stem in (*_BE, "let") else [stem, "'s"]
    return [stem] if tail == "" else [word]


@cache
def verb_words() -> str:
    """Return a pattern for the first words of all verbs, as they are or inflected."""
    words = {phrase.split()[0] for verb in KNOWN.values() for phrase in said(verb)}
    return "|".join(
        sorted(words - {"i", "can", "could", "may", "we", "let", "have", "over", "show"}, key=len, reverse=True)
    )


def said(verb) -> list[str]:
    """Return the phrases of a verb: the words before the object in its templates, and its further words."""
    own = [template.removesuffix(f" {OBJECT}") for template in verb.templates if template.endswith(OBJECT)]
    own = [phrase for phrase in own if "{" not in phrase and verb.act is not Act.HOLD]
    return list(dict.fromkeys([*own, *(phrases(verb.words) if verb.words else [])]))


def inflections(name: str, phrase: str) -> Iterator[tuple[str, str, str]]:
    """Yield the gerund and the third person of a verb, and its participle, which follows its object."""
    first, _, rest = phrase.partition(" ")
    if first in ("i", "we", "can", "could", "may", "over", "gimme", "lemme", "have", "want", "need") or len(first) < 2:
        return
    stem = first[:-1] if first.endswith("e") and first != "see" else first
    stem = first + first[-1] if _DOUBLED.match(first) else stem
    third = first + ("es" if first.endswith(("s", "sh", "ch", "x", "z")) else "s")
    regular = first[:-1] + "ied" if first.endswith("ry") else stem + "ed"
    pasts = [*_IRREGULAR[first], stem + "ed"] if first in _IRREGULAR else [regular]
    for form in (stem + "ing", third):
        yield "inflected", name, f"{form} {rest}".strip()
    for form in pasts:
        yield "done", name, f"{form} {rest}".strip()
        if form not in ("left", "set", "put", "shut"):
            yield "inflected", name, f"{form} {rest}".strip()
    if first == "open":
        yield "done", name, phrase
