"""Arrangements: towers and rows whose order people say in many ways, rewritten to one way that the chart reads.

"green at the bottom, then red, then blue on top" becomes "build tower of green one and red one and blue one": the
lowest is first, and the leftmost of a row. Of a set whose order is said in part it becomes "build tower of three cubes
beginning with red one".
"""

from __future__ import annotations

import re
from functools import cache
from typing import NamedTuple

from language.scanning import COLOR, Token, text_of, verb_words
from language.words import NUMBERS

_MAKE = (
    r"(?:(?:i |we )?(?:(?:re)?(?:build|make|create|form|construct|assemble|erect)|do|set up|put up|give|need"
    r"|want|would like)(?: me| us| up| to have| to see)?)"
)
_LITTLE = (
    r"(?:(?:a|an|one|another|second|third|further|other|different|separate|that|this|my|new|nice|neat|little|small|big"
    r"|tall|high|single|proper|whole|straight|simple) )*"
)
_BESIDE = r"side by side|(?:next to|beside) (?:each other|one another)"
_TOWER, _ROW = r"(?:tower|stack|pile|column|pillar)", r"(?:row|line)"
_KIND = r"(?:cubes|blocks|boxes|bricks|pieces|things|objects|ones|balls|spheres|cylinders)"
_NUMBER = r"(?:two|three|four|five|six|\d)"
_SET = (
    rf"(?:(?:all|every|each|both|my|your|these|those|of) ){{0,3}}(?:(?:{_NUMBER} )?(?:{COLOR} )?{_KIND}|them(?: all)?"
    rf"|{_NUMBER}|everything)|all|both"
)
_VERTICAL = {
    "first": "very bottom|bottom|bottommost|lowest|base|foundation|underneath|below|lower",
    "last": "very top|top|topmost|uppermost|highest|above|upper",
}
_LEVELS = {
    "first": "leftmost|left|first|beginning|(?:start|begin)\\w* with",
    "last": "rightmost|right|last|end|(?:end|finish)\\w* with",
    "middle": "middle|center|centre|between",
}
_SAYS_LEVEL = rf"\b(?:{'|'.join(_LEVELS.values())})\b"
_AT = r"(?:(?:at|on|in|as|for|to|far|very|a|my|its) )*"
_OF_IT = r"(?: (?:one|cube|block|layer|level|side|end|place|position|of (?:it|tower|stack|pile|row|line|all)))*"
_THAT = r"(?:it|that|this|them|those|these|each other)"
_UP, _DOWN = rf"(?:on(?: top(?: of)?)?|above|over) {_THAT}", rf"(?:under|below|beneath|underneath) {_THAT}"
_IS = r"(?:(?:should|must|shall|is|are|goes|go|comes|come|being|be|stands|lies|sits|as|too) )*"
_LEAD = re.compile(
    r"(?:(?:with|where|using|use|of|from|having|it|so that|that|which|should|must|shall|be|is|put|up|comes?|goes"
    r"|next one|next|then|now|again|and|but|by|finally|lastly|out|in|order|only) )*"
)
_NO_NAME = rf"(?:not|if|of|on|in|to|at|from|under|over|above|below|which|is|are|{_THAT})"
_OBJECT = re.compile(
    rf"(?:(?!{_NO_NAME}\b)[a-z]+ ){{0,3}}?(?:{COLOR}|cube|block|ball|sphere|cylinder|brick|one)(?: cube| block| ball"
    r"| one)?"
)
_WAY = re.compile(
    r"(?: ,| :)?(?: in (?:a |this |that )?order)?(?: from)?(?: my| your)? (bottom|top|left|right|front|back)"
    r"(?: side| end)?(?: to(?:wards)?(?: my| your)?)? (?:top|bottom|left|right|front|back|upwards?|downwards?|up|down)"
    r"(?: side| end)?(?=$| )"
)
_BACK = re.compile(
    r"(?: ,)?(?: in)?(?: a)? (?:(?:other|opposite|reverse) way(?: round| around)?|upside down|backwards|reversed"
    r"|(?:reversed?|opposite|inverse) order)(?=$| )"
)
_PLACE = re.compile(
    r" (?:along|at|on|in|near|by)(?: my| your)? ((?:front|back|far|near|left|right) (?:edge|border)|(?<=along )(?:front"
    r"|back|left|right)|(?:front|back|far|near) (?:left|right) corner)(?: of (?:table|board))?(?=$| )"
)
_SIDE = re.compile(  # of a list, at whose end it is no description of the last thing
    r"^(?P<list>.*(?:,|\band) (?:(?!with|which|that)\w+ ){1,3}?)(?:(?:over|up|somewhere) )*"
    r"(?:on|at|to|along|in) (?P<side>(?:(?:my|your) )?(?:left|right))(?: hand)?(?: side| half| part| end)?"
    r"(?: of (?:table|board))?$"
)
_ALL = re.compile(
    rf"(?:(?: ,)? (?:of|from|with|using|out of|made of)){{0,2}} ({_SET})"
    rf"(?=$| [,:]| (?:with|where|and|but|up|in|{COLOR})\b)"
)
_NEXT = re.compile(
    r"(?: ?(?:,|:|\b(?:and|then|where|so that|such that|followed by|finally)\b|\b(?<!ing )(?<!but )with\b))+ ?"
)
_RESTS = r"(?:stand|sit|sitt|rest|lie|ly|go|come|be|is|place|stack|put)(?:s|ing|d|ed)?"
_CHAIN = re.compile(rf"(?: {_RESTS})* (on top of|on|above|over|atop|under|below|beneath) (?=\w)")
_IDLE = re.compile(r"(?:(?:in|this|that|a|order|please|again|now|time|instead|up|exactly) ?)*$")
_SAYS = r"(?:start|begin|end|finish|come|go|use|have|stand|lie)\w*\b"  # verbs that say where a part is
_POLITE = re.compile(r"(?: (?:please|again|now|too|thanks|cube by cube))+(?= ?(?:,|$))")
_ORDERS = {"first": "beginning with", "last": "ending with", "middle": "with in middle"}


class _Part(NamedTuple):
    """One thing of an arrangement, and what is said of its place: a key of `_ORDERS`, "up", "down" or ""."""

    thing: str
    level: str
    vertical: bool


@cache
def _heads() -> tuple[re.Pattern[str], ...]:
    """Return patterns of what begins an arrangement."""
    start = rf"(?:^|(?<=[.;!?,:] )|(?<=\band )|(?<=\bthen ))(?:(?!(?:{verb_words()})\b)[a-z]+ ){{0,6}}?"
    put = r"(?:put|place|lay|set|arrange|bring|line|move|order|align|stand)(?: up)?"
    heads = (
        rf"(?P<head>(?:{_MAKE} |in )?{_LITTLE}(?:(?P<tower>{_TOWER}|{_NUMBER} high)|(?P<row>{_ROW}))(?: again)?)",
        rf"(?P<head>{put} (?P<before>[^.;:]*?)(?: up)? (?P<row>(?:in|into|to) {_LITTLE}{_ROW}|{_BESIDE}))",
        r"(?P<head>(?P<row>line|align)(?= [^.;]*\bup\b)|(?P<tower>stack|pile|heap)(?: up)?)",
        rf"(?P<head>(?:(?:re)?(?:build|make|stack)|turn|flip)(?: me)? (?P<tower>it|them|{_TOWER})(?: up)?(?: again)?)",
    )
    return (
        *(re.compile(rf"{start}{head}(?=$| )") for head in heads),
        re.compile(rf"^(?P<head>)(?!(?:{verb_words()})\b)"),
    )


def arranged(found: list[Token]) -> list[Token]:
    """Return the words of a sentence, with an arrangement said in one way; the words of others as they are."""
    text = text_of(found)
    for pattern in _heads():
        match = pattern.search(text)
        plain = _plain(match, text[match.end() :]) if match else None
        if match and plain:
            words, rest = plain
            start, end = text[: match.start("head")].count(" "), len(found) - len(rest.split())
            new = [Token(word, found[start].start, found[end - 1].end) for word in words.split()]
            return [*found[:start], *new, *found[end:]]
    return found


def _plain(head: re.Match[str], tail: str) -> tuple[str, str] | None:
    """Return the one way to say an arrangement, and the words after it; None if no order is said."""
    groups = head.groupdict()
    row, said = bool(groups.get("row")), head["head"]
    tail = re.sub("^ [.!;:]", " ,", tail)
    ends = re.search(rf" ?[.;!?]| ,?(?: (?:and|then|but))*(?<=[,dnt]) (?!{_SAYS})(?:{verb_words()})\b", tail)
    tail, after = (tail[: ends.start()], tail[ends.start() :]) if ends else (tail, "")
    after = "" if re.fullmatch(rf" , {_MAKE} (?:that|this|such a|it)(?: {_TOWER}| {_ROW})?", after) else after
    tail = _POLITE.sub("", f" {groups.get('before') or ''}{tail}")
    cut = {}
    for name, pattern in (("way", _WAY), ("back", _BACK), ("place", _PLACE), ("all", _ALL)):
        cut[name] = pattern.search(tail) if said or name == "way" else None
        tail = pattern.sub(" ,", tail, count=1) if cut[name] else tail
    side = _SIDE.match(tail) if row and not cut["place"] else None
    side = side if side and not re.search(_SAYS_LEVEL, side["list"]) and not _again(side["list"]) else None
    tail = side["list"] if side else tail
    parts = _parts(tail, chained=bool(said) and not re.match("(?:stack|pile|heap)", said))
    if parts is None or (not said and not _is_tower(parts, cut["way"])):
        return None
    backward = cut["way"] is not None and cut["way"][1] in ("top", "right", "back")
    listed, placed = _in_order(parts, backward)
    old = bool(cut["back"]) or groups.get("tower") in ("it", "them") or said.endswith("again")
    every = cut["all"][1] if cut["all"] else "it" if old else "cubes" if placed else ""
    if len(listed) == 2 and re.search(_BESIDE, said):
        return None  # the first one is put next to the other
    rest = len(listed) - sum(map(len, placed.values()))  # of which it is only said that they follow
    if len(listed) > 1 and (rest or _count(every) == len(listed) or not (old or cut["all"])):
        what = " and ".join(listed)
    elif every and not rest and (placed or cut["back"] or row):
        orders = (f" {_ORDERS[end]} {' and '.join(things)}" for end, things in placed.items())
        what = every + " in reversed order" * bool(cut["back"]) + "".join(orders)
    else:
        return None
    where = f" at {cut['place'][1]}" if cut["place"] else f" at {side['side']} side" if side else ""
    return f"{'group together' if row else 'build tower of'} {what}{where}", after


def _again(things: str) -> bool:
    """Whether the last thing of a list is one of those before it: "red, yellow and blue, with red"."""
    *before, last = re.findall(COLOR, things) or [""]
    return last in before


def _is_tower(parts: list[_Part], way: re.Match[str] | None) -> bool:
    """Whether parts without a word for a tower or a row are one: something is at the bottom or on top."""
    said = any(part.vertical for part in parts) or (way is not None and way[1] in ("bottom", "top"))
    return said and len(parts) > 1 and all(re.search(rf"\b{COLOR}\b", part.thing) for part in parts)


def _count(every: str) -> int:
    """Return how many things a set has; 0 if it is not said."""
    found = re.search(rf"\b(?:{_NUMBER})\b", every)
    return int(NUMBERS.get(found[0]) or found[0]) if found else 0


def _parts(tail: str, chained: bool) -> list[_Part] | None:
    """Return the things of an arrangement as they are said; None if there are words that name none."""
    found: list[_Part] = []
    for segment in _NEXT.split(tail):
        segment = segment.strip()
        if _IDLE.fullmatch(segment):
            continue
        level, vertical, thing = _level(segment)
        things = re.split(_CHAIN, thing) if chained and level not in ("up", "down") else [thing]
        for at in range(0, len(things), 2):
            if not _OBJECT.fullmatch(things[at]):
                return None
            how = level if not at else "up" if things[at - 1] in ("under", "below", "beneath") else "down"
            found.append(_Part(things[at], how, vertical or at > 0))
    return found


def _level(segment: str) -> tuple[str, bool, str]:
    """Return what a part says of its place, whether that is a height, and the thing."""
    plain = _LEAD.sub("", f"{segment} ", count=1).strip()
    levels = [("up", _UP, True), ("down", _DOWN, True)]
    levels += [
        (name, _AT + f"(?:{words})" + _OF_IT, table is _VERTICAL)
        for table in (_VERTICAL, _LEVELS)
        for name, words in table.items()
    ]
    for name, words, vertical in levels:
        if match := re.fullmatch(rf"{words}(?! of\b) {_IS}(\w.*)|(.*?\w) {_IS}{words}", plain):
            thing = _LEAD.sub("", match[1] or match[2], count=1)
            return name, vertical, re.sub(rf" {_IS.replace(') )*', '))*')}$", "", thing)
    return "", False, plain


def _same(one: str, other: str) -> bool:
    """Whether two names are of the same thing: "the blue cube" and "the blue one"."""
    (*words, noun), (*others, kind) = one.split(), other.split()
    return words == others and (noun == kind or "one" in (noun, kind))


def _in_order(parts: list[_Part], backward: bool) -> tuple[list[str], dict[str, list[str]]]:
    """Return the things from the lowest or leftmost on, and those that are said to be first, in the middle or last.

    backward: whether the parts are said from the end on.
    """
    listed: list[str] = []
    placed: dict[str, list[str]] = {}
    at, run = -1, ""
    for part in parts:
        thing = part.thing if part.thing.split()[-1] in ("cube", "block", "ball", "one") else f"{part.thing} one"
        if said := [each for each in listed if _same(each, thing)]:  # "red and blue, with red at the bottom"
            listed.remove(said[0])
            thing = said[0] if thing.endswith(" one") else thing
        backward = {"last": True, "down": True, "first": False, "up": False}.get(part.level, backward)
        at = {"first": 0, "last": len(listed)}.get(part.level, max(at, 0) if backward else at + 1)
        listed.insert(at, thing)
        run = part.level if part.level in _ORDERS else run
        if run:
            placed.setdefault(run, []).append(thing)
    return listed, placed
