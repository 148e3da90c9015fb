"""The order that clauses of time tell: "press button once drawer is closed" is "close drawer then press button".

A clause says a deed, "after you have closed the drawer", or what is so when it is done, "once the drawer is closed".
Others say a later time, "tomorrow", "when I say so", for which nothing is done: the arm acts at once and has no clock.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import cache

from language.scanning import COLOR, MARKS, Token, inflections, said, scan
from language.verbs import KNOWN

_JOINS = (  # what begins a clause of time, as words, and whether its deed comes first
    (("as", "soon", "as"), True),
    (("after",), True),
    (("once",), True),
    (("when",), True),
    (("upon",), True),
    (("until",), True),
    (("having",), True),
    (("before",), False),
)
_ENDS = MARKS | {"then"}
_DONE = ("when", "until")  # joins after which a deed counts only where somebody is said to have done it
_SUBJECTS = frozenset(["you", "we", "having", "robot", "arm"])
_PERFECT = frozenset(
    ["have", "has", "had", "are", "did", "finished", "done", "with", "just", "already", "finally", "also", "been"]
)
_IS = frozenset(["is", "are", "was", "were", "has", "have", "been", "being", "gets", "got", "goes"])
_DEGREES = frozenset(["all", "fully", "properly", "safely", "again", "finally", "completely", "now"])
_PLACES = frozenset(["in", "inside", "into", "on", "onto", "near", "next", "behind", "under"])
_LEFT_OUT = frozenset([",", "and", "but", "only", "then", "just"])  # beside a clause of time
_SOONER = frozenset(["earlier", "before", "sooner"])  # "but not earlier"
_FIXED = frozenset(["button", "lever", "wheel", "drawer", "fridge"])
TIMES = {"twice": 2, "thrice": 3, "two": 2, "three": 3, "four": 4, "five": 5, "2": 2, "3": 3, "4": 4, "5": 5}
_WHETHER = re.compile(
    r"^(?:has|have|is|are|was) (?!you\b|i\b)(?P<what>.+?)(?: been)? (?P<done>\w+)(?: yet| already| now)?$"
)
_WHETHER_YOU = re.compile(
    r"^(?:did|have|has) you (?:already |really |also )*(?P<done>\w+) (?P<what>.+?)(?: yet| already| now)?$"
)
_JOINING = frozenset([",", ".", ";", "and", "then"])
_LONGEST = 6  # words of a thing


@cache
def _forms() -> dict[str, str]:
    """Return the first word of a verb by that of each of its other forms: "closed": "close"."""
    phrases = [(name, phrase) for name, verb in KNOWN.items() for phrase in said(verb)]
    forms = {form.split()[0]: phrase.split()[0] for name, phrase in phrases for _, _, form in inflections(name, phrase)}
    return forms | {word: word for word in ("open", "shut", "put", "set")}


@cache
def _verbs() -> frozenset[str]:
    return frozenset(phrase.split()[0] for verb in KNOWN.values() for phrase in said(verb))


def ordered(found: list[Token]) -> list[Token]:
    """Return the words with what is done first before what is done after it, joined by "then"."""
    for at, size, first in _joins([token.text for token in found]):
        told = _deed(found[at + size :], found[at].text)
        if told is None:
            continue
        deed, length = told
        join = [found[at]._replace(text="then")]
        start = max((i + 1 for i in range(at) if found[i].text in _ENDS - {","}), default=0)
        main, rest = _stripped(found[start:at]), found[at + size + length :]
        if not main:  # "after closing the drawer, press the button"
            end = next((i for i, token in enumerate(rest) if token.text in ".;!?"), len(rest))
            main, rest = _stripped(rest[:end]), rest[end:]
        if found[at].text == "until" and not (main := _forbidden(main)):
            continue
        if main:
            return found[:start] + ([*deed, *join, *main] if first else [*main, *join, *deed]) + ordered(rest)
    return found


def _joins(words: Sequence[str]) -> Iterator[tuple[int, int, bool]]:
    """Yield where a clause of time may begin, how many words join it, and whether its deed comes first."""
    for at in range(len(words)):
        for join, first in _JOINS:
            if tuple(words[at : at + len(join)]) == join:
                yield at, len(join), first
                break


def _deed(found: Sequence[Token], join: str) -> tuple[list[Token], int] | None:
    """Return the command for the deed that a clause tells, and how many words the clause has; None: it tells none."""
    words = [token.text for token in found]
    at = 0
    while at < len(words) and words[at] in (_SUBJECTS if at == 0 else _PERFECT):
        at += 1
    done = join == "having" or at > 1
    known = set(_forms()) | (_verbs() if at == 1 else set())  # "before you press"
    if at + 1 < len(words) and words[at] in known and words[at + 1] not in _ENDS:
        if not done and (join in _DONE or (at == 0 and not words[at].endswith("ing"))):
            return None
        end, of = _end(words, at + 2), words[at + 1] == "of"  # "after closing of the drawer"
        return [found[at]._replace(text=_forms().get(words[at], words[at])), *found[at + 1 + of : end]], end
    end = next((i for i, word in enumerate(words) if word in _ENDS), len(words))
    colors = all(re.fullmatch(COLOR, word) for word in words[: end - 1])
    if join == "after" and end and colors and words[end - 1] in _FIXED:  # "press the button after the wheel"
        return [*found[:end]], end
    return _done(found)


def _done(found: Sequence[Token]) -> tuple[list[Token], int] | None:
    """Return the command whose result a clause tells, "drawer is closed", and how many words the clause has."""
    words = [token.text for token in found]
    copula = next((i for i, word in enumerate(words[:_LONGEST]) if word in _IS), 0)
    if not copula or set(words[:copula]) & (MARKS | _SUBJECTS) or words[0] == "that":  # "after that red goes on"
        return None
    at = copula
    while at < len(words) and words[at] in _IS | _DEGREES:
        at += 1
    thing = found[:copula]
    if at < len(words) and words[at] in _forms():
        end = _end(words, at + 2) if _PLACES & set(words[at + 1 : at + 2]) else at + 1
        return [found[at]._replace(text=_forms()[words[at]]), *thing, *found[at + 1 : end]], end
    if at < len(words) and words[at] in _PLACES:
        end = _end(words, at + 1)
        return [found[at]._replace(text="put"), *thing, *found[at:end]], end
    return None


def asked_deed(question: str) -> str | None:
    """Return the command for the deed of which a question asks whether it is done: "has the button been pressed?"."""
    text = " ".join(token.text for token in scan(question) if token.text.isalnum())
    if mine := _WHETHER_YOU.match(text):
        return f"{_forms().get(mine['done'], mine['done'])} {mine['what']}"
    match = _WHETHER.match(text)
    deed = _forms().get(match["done"]) if match else None
    return None if match is None or deed is None else f"{deed} {match['what']}"


def _end(words: Sequence[str], start: int) -> int:
    """Return where a clause ends: at a mark, "then", or the verb of what is to be done after it."""
    for at in range(start, len(words)):
        joined = words[at - 1] in ("and", "or", "to", "of", "a")
        if words[at] in _ENDS or (words[at] in _verbs() and not joined):
            return at
    return len(words)


def _forbidden(found: list[Token]) -> list[Token]:
    """Return the words of what is not done until something else is; none if it is not said so."""
    words = [token.text for token in found]
    if words[-1:] == ["not"]:  # "press the button, but not until"
        return _stripped(found[:-1])
    return found[2:] if words[:2] == ["do", "not"] else found[1:] if words[:1] == ["never"] else []


def _stripped(found: list[Token]) -> list[Token]:
    """Return the words without what joins them to a clause of time."""
    start, end = 0, len(found)
    while start < end and found[start].text in _LEFT_OUT:
        start += 1
    words = [token.text for token in found[start:end]]
    if words[1:2] == ["which"] and "," in words:  # "the drawer, in which the cube stays, ..."
        return _stripped(found[start + words.index(",") : end])
    if words[:1] == ["not"] and set(words[1:2]) & _SOONER:
        return _stripped(found[start + 2 : end])
    while end > start and found[end - 1].text in _LEFT_OUT:
        end -= 1
    return found[start:end]


def repeated(found: list[Token]) -> list[Token]:
    """Return the words with a clause among others said as often as it is done: "press it, press it, then open it"."""
    clauses = _clauses(found)
    if len(clauses) < 2:
        return found
    kept: list[Token] = []
    for start, end, after in clauses:
        number, spent = times([token.text for token in found[start:end]])
        clause = [token for at, token in enumerate(found[start:end]) if at not in spent]
        if not clause or clause[0].text == "do":  # "do that twice" is about all
            return found
        if number > 1 and kept and clause[0].text not in _verbs():  # "touch the red one once, the blue one twice"
            clause = [kept[0], *clause]
        join = clause[-1]._replace(text="then")
        kept += [*[*clause, join] * (number - 1), *clause, *found[end:after]]
    return kept


def _clauses(found: Sequence[Token]) -> list[tuple[int, int, int]]:
    """Return where each clause starts and ends, and where the next one starts."""
    words, starts = [token.text for token in found], [0]
    for at in range(1, len(words)):
        joined = words[at - 1] in ("then", ".", ";") or (words[at - 1] in ("and", ",") and words[at] in _verbs())
        if joined and words[at] not in _JOINING:
            starts.append(at)
    ends = []
    for start, after in zip(starts, [*starts[1:], len(words)], strict=True):
        end = after
        while end > start and words[end - 1] in _JOINING:
            end -= 1
        ends.append((start, end, after))
    return ends


def times(words: Sequence[str]) -> tuple[int, list[int]]:
    """Return how often something is to be done, and the indices of the words that say so."""
    for at, word in enumerate(words):
        if word in ("twice", "thrice"):
            return TIMES[word], [at]
        if (
            word == "once"
            and words[max(at - 1, 0)] != "at"
            and (at + 1 == len(words) or words[at + 1] in (".", ",", ";", "!", "and", "then"))
        ):
            return 1, [at]
        end = at + 1 + (words[at + 1 : at + 2] == ["more"])
        if word in TIMES and words[end : end + 1] == ["times"]:
            return TIMES[word], list(range(at, end + 1 + (words[end + 1 : end + 2] == ["more"])))
    return 1, []


# ---- A later time

_UNIT = r"(?:seconds?|minutes?|hours?|days?|weeks?|months?)"
_NUMBER = r"(?:\d+|one|two|three|four|five|six|seven|eight|nine|ten|eleven|twelve|twenty|thirty)"
_MANY = rf"(?:(?:a|an|about|another|few|couple of|some|half|more|{_NUMBER}) )"
_DAY = r"(?:monday|tuesday|wednesday|thursday|friday|saturday|sunday)s?"
_MEAL = r"(?:lunch|dinner|breakfast|supper|work|school|break|meeting)"
_WHO = r"(?:i|we|he|she|they|someone|somebody|(?:my|our|his|her|your) \w+)"
_DOES = r"(?:says?|tells?|leaves?|comes?|arrives?|returns?|calls?|claps?|whistles?|nods?|snaps?|finish(?:es)?|goes|go)"
_AFTER_THAT = r"(?: (?:so|go|now|home|back|stop|it|hands?|you|out|away))*"
_LATER = re.compile(
    rf"\b(?:tomorrow(?! ?'s)|tonight|(?:this|in) (?:evening|afternoon)|next (?:{_UNIT}|year|{_DAY})|(?:on |by )?{_DAY}"
    rf"|at (?:noon|midnight|{_NUMBER} (?:am|pm|o ?'? ?clock))|(?:after|at) {_MEAL}"
    rf"|(?:in|after|within) {_MANY}+{_UNIT}|{_MANY}*{_UNIT} (?:from now|later)"
    rf"|wait (?:for )?(?!(?:a|another) {_UNIT}){_MANY}+{_UNIT}|every {_MANY}*(?:{_UNIT}|morning|evening|night|{_DAY})"
    rf"|(?:when|whenever|once|as soon as|after) {_WHO} {_DOES}{_AFTER_THAT}"
    r"|(?<!for )(?<!and )(?<!or )(?<!then )later(?: on| today)?(?= please$|$))"
)
_WANTED = re.compile(r"\bi (?:want|would like|need|hope) to (?:find|see|have)\b")  # what shall be so then is done now


def later_time(plain: str) -> str:
    """Return the words of a sentence (in plain lower case) that say when it shall be done, if that is not now; ""."""
    found = _LATER.search(plain)
    return found[0] if found is not None and not _WANTED.search(plain) else ""
