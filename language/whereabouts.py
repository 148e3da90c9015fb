"""Places said in any order of words, or twice, in the one way that the chart reads.

"the corner that is far away, on the left" becomes "far left corner of table", "to the left and outwards, away from you"
becomes "away from you and to left", and "in front of it, on your side" becomes "in front of it".
"""

from __future__ import annotations

import re
from collections.abc import Callable

from language.scanning import COLOR, Token, text_of

_YOU = r"(?:you|robot|yourself|your (?:base|body|arm)|where you (?:are|stand|sit)|arm)"
_TABLE = r"(?:(?:table|desk|board|counter|bench|worktop)(?: top)?)"
_END = rf"(?=$| [.;,!?:]| (?:and|then|please|is|for|one|it|should|must|goes|belongs)\b| (?:of|on) {_TABLE}\b)"

# Side -> how it is said beside "corner" and "edge"; the longer phrases first.
_SIDES = {
    "far": (
        rf"(?:far(?:ther|ther away|thest)?|further|furthest|most distant|distant|opposite)(?: away)?(?: from {_YOU})?"
        rf"|(?:pointing |facing )?away from {_YOU}|opposite {_YOU}"
    ),
    "near": (
        rf"(?:nearest|closest|near|nearer|closer|close)(?: to)? {_YOU}|nearest|closest|near|nearer|closer"
        rf"|(?:facing|towards?|next to|beside|by|in front of) {_YOU}|your (?:side|end)"
    ),
    "left": r"(?:your )?left(?: hand)?(?: side)?",
    "right": r"(?:your )?right(?: hand)?(?: side)?",
    "front": r"front",
    "back": r"back|rear",
}
_ACROSS = frozenset({"left", "right"})
_SIDE = "|".join(f"(?:{words})" for words in _SIDES.values())
_BEFORE = rf"(?:(?:{_SIDE})(?: and| ,)? )*"
_AFTER = (
    r"(?:(?:(?: ,)?(?: and)?(?: one| corner| edge)?(?: (?:that|which)(?: is| 's)?)?(?: on| at| to| in)? "
    rf"(?:{_SIDE}))+(?: one\b)?{_END})?"
)
_REGION = re.compile(
    rf"\b(?P<beside>(?:up )?(?:along|against|by|beside|next to) )?(?P<table>{_TABLE} (?:'s )?)?(?P<before>{_BEFORE})"
    rf"(?P<inner>{_TABLE} (?:'s )?)?(?P<head>corner|edge|border|rim|end)"
    rf"(?P<of>(?: of| on) {_TABLE})?(?P<after>{_AFTER})(?P<last>(?: of| on) {_TABLE})?(?!\w)"
)
_CENTER = re.compile(rf"\b{_TABLE} 's (?:very |exact )?(center|centre|middle)\b")
_QUARTER = re.compile(  # "to the back left of the table"; "far left" is rather the extreme left
    r"\b(?P<before>to|at|in|on|into|towards?) (?:very )?(?P<sides>(?:front|back|rear) (?:left|right))(?: hand)?"
    rf"(?: (?:side|part|area|region|section|quarter))?(?: (?:of|on) {_TABLE})?(?=$| [.;,!?]| (?:and|then|please)\b)"
)
_ONE_SIDE = re.compile("|".join(f"(?P<{side}>{words})" for side, words in _SIDES.items()))

# Direction -> how it is said; several that follow each other are one direction, across the two.
_DIRECTIONS = {
    "away from you": (
        rf"(?:(?:more |further |farther )?(?:away|distant|far)|further|farther)(?: off| out)?(?: from {_YOU})|outwards?"
        r"|(?:further |farther )away|away"
    ),
    "towards you": rf"(?:(?:back )?towards?|(?:closer|nearer|closer in) to|nearer) {_YOU}|inwards?|closer in",
    "to left": r"(?:more |further |farther |over )*(?:(?:to|towards?) )?(?:your )?left(?:wards?)?",
    "to right": r"(?:more |further |farther |over )*(?:(?:to|towards?) )?(?:your )?right(?:wards?)?",
}
_DIRECTION = "|".join(f"(?:{words})" for words in _DIRECTIONS.values())
_JOIN = r"(?: ,)?(?: and| plus| as well as| but)?(?: also| then| both| like| a bit| slightly| a little)?"
_RUN = re.compile(
    rf"\b(?P<lead>(?:both |diagonally )*)(?P<run>(?:{_DIRECTION})(?:{_JOIN} (?:{_DIRECTION}))+)"
    r"(?=$| [.;,!?:]| (?:and|then|please|now)\b)"
)
_HEADS = r"(?:cube|block|brick|box|one|thing|button|lever|wheel|drawer|fridge)"
_THING = rf"(?:(?:this|that|my|other) )?(?:(?:{COLOR})(?: {_HEADS})?|{_HEADS}|it)"
_NOT_TABLE = rf"(?!{_TABLE}\b|corner|edge)"
_IN_FRONT = re.compile(
    rf"(?:\b(?:on|to|at|from) )?\b(?:your|(?:near|nearer|nearest|closer|front)(?: to you)?) side of {_NOT_TABLE}(?=\w)"
    rf"|\b(?:on|to|at) side (?:(?:nearest|closest|nearer|closer|near|close)(?: to)?|towards|facing) {_YOU} of (?=\w)"
)
_BEHIND = re.compile(
    rf"(?:\b(?:on|to|at|from) )?\b(?:far|farther|farthest|back) side of {_NOT_TABLE}(?=\w)"
    rf"|\b(?:on|to|at) side (?:away|farthest|furthest|farther|further) from {_YOU} of (?=\w)"
)
_TWICE = re.compile(  # "in front of it, on your side", "behind it, away from you", "next to it, on the left"
    rf"\b(?P<said>(?P<near>(?:just |right )?(?:in front of|ahead of|before))|(?P<far>(?:just |right )?behind)"
    rf"|next to|near|beside|close to|by) (?P<thing>{_THING})(?: ,| and| so| just)*"
    r"(?: on| at| to)?(?: its| it 's| a)?(?: side)?(?: (?:that|which)(?: is)?)? (?:"
    rf"(?P<to_near>your (?:own )?(?:side|end)|near side|(?:nearest|closest|nearer|closer|near|close)(?: to)? {_YOU}"
    rf"|(?:towards?|facing|faces|looking at) {_YOU}|between (?:it|that) and {_YOU})"
    rf"|(?P<to_far>far side|(?:far|farther|further|farthest|furthest)?(?: ?away)? ?from {_YOU})"
    r"|(?<=on )(?P<left>left)(?: hand)?(?: side)?|(?<=on )(?P<right>right)(?: hand)?(?: side)?"
    r"|(?<=its )(?P<its_left>left)(?: hand)?(?: side)?|(?<=its )(?P<its_right>right)(?: hand)?(?: side)?)"
    rf"(?: of {_THING}| than {_THING})?(?=$| [.;,!?]| (?:and|then|please)\b)"
)
_BESIDE = {
    "to_near": "in front of",
    "to_far": "behind",
    "left": "to left of",
    "right": "to right of",
    "its_left": "to left of",
    "its_right": "to right of",
}
_VIEW = r"(?:point of view|viewpoint|perspective|view|position|angle)"
_SEEN = re.compile(
    rf"(?:(?:^|(?<= ))(?:, )?(?:(?:as|when) )?(?:(?:seen|viewed|looked at|looking) )?from "
    rf"(?:where you (?:are|stand|sit)(?: standing)?|your (?:own )?{_VIEW})(?! or\b)"
    rf"|(?:^|(?<= ))(?:, )?(?:as|when) (?:seen|viewed|you see it)(?: from (?:{_YOU}|your side))?)(?: ,|(?= |$))"
)
_AT_ONCE = re.compile(r"(?<=\w )(?:right|straight) away\b(?! from)")  # no direction
_ONE_DIRECTION = re.compile(
    "|".join(f"(?P<{name.replace(' ', '_')}>{words})" for name, words in _DIRECTIONS.items()) + r"|(?P<bit>a bit)"
)


def plain_regions(found: list[Token]) -> list[Token]:
    """Return the words with corners, edges and compound directions in the order that the chart reads."""
    forms = (
        (_AT_ONCE, lambda match: ""),
        (_SEEN, lambda match: ""),
        (_TWICE, _once),
        (_IN_FRONT, lambda match: "in front of"),
        (_BEHIND, lambda match: "behind"),
        (_REGION, _region),
        (_QUARTER, _quarter),
        (_CENTER, lambda match: f"{match[1]} of table"),
        (_RUN, _direction),
    )
    for pattern, said in forms:
        found = _rewritten(found, pattern, said)
    return found


def _rewritten(
    found: list[Token], pattern: re.Pattern[str], said: Callable[[re.Match[str]], str | None]
) -> list[Token]:
    """Return the words with each match said in another way; one for which that is None stays."""
    text = text_of(found)
    for match in reversed(list(pattern.finditer(text))):
        words = said(match)
        spoken = match[0].split()
        if words is None or words.split() == spoken:
            continue
        first = len(text[: match.start()].split())
        last = first + len(spoken) - 1
        start, end = found[first].start, found[last].end
        found = [*found[:first], *(Token(word, start, end) for word in words.split()), *found[last + 1 :]]
    return found


def _region(match: re.Match[str]) -> str | None:
    """Return a corner or an edge with its sides before it; None if none are said, or more than it can have."""
    said = f"{match['before'] or ''} {match['after'] or ''}"
    sides = list(dict.fromkeys(str(each.lastgroup) for each in _ONE_SIDE.finditer(said)))
    across, along = [each for each in sides if each in _ACROSS], [each for each in sides if each not in _ACROSS]
    corner = match["head"] == "corner" or (match["head"] == "end" and len(sides) == 2)  # "far end on left"
    if match["head"] == "end" and not (corner and (match["of"] or match["last"] or match["table"] or match["inner"])):
        return None  # of something else, or a side as it is
    if match["after"] and match.string[: match.start()].endswith("from "):  # "away from edge, towards you"
        return None
    if not sides or len(across) > 1 or len(along) > 1 or (len(sides) > 1 and not corner):
        return None
    at = "at " if match["beside"] else ""
    return f"{at}{' '.join([*along, *across])} {'corner' if corner else 'edge'} of table"


def _quarter(match: re.Match[str]) -> str | None:
    """Return two sides as a corner; None if they may say which thing is meant: "hand me the cube at the front left"."""
    goes = match["before"] in ("to", "into", "toward", "towards")
    moved = re.search(r"\b(?:put|place|set|lay|leave|stand|drop|move|goes|go|belongs)\b", match.string[: match.start()])
    return f"{match['before']} {match['sides']} corner of table" if goes or moved else None


def _once(match: re.Match[str]) -> str | None:
    """Return the place beside a thing said once; None if the words after it say another one."""
    side = next(name for name in _BESIDE if match[name])
    if match["thing"] == "it" and side in ("left", "right"):
        return None  # rather of the table
    said = "to_near" if match["near"] else "to_far" if match["far"] else side
    return f"{_BESIDE[side]} {match['thing']}" if side == said else None


def _direction(match: re.Match[str]) -> str | None:
    """Return two directions, one along and one across, joined by "and"; None if others are said."""
    named = [str(each.lastgroup).replace("_", " ") for each in _ONE_DIRECTION.finditer(match["run"])]
    across = dict.fromkeys(each for each in named if each.startswith("to "))
    along = dict.fromkeys(each for each in named if each.endswith(" you"))
    if len(across) != 1 or len(along) != 1:
        return None
    return " ".join([*(["a bit"] if "bit" in named else []), *along, "and", *across])
