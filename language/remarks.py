"""Parts of a sentence that ask for nothing: reasons, circumstances, labels and signatures.

A part is left out only if another part is a command or a wish, and never if it may say what is to be done where.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from itertools import zip_longest
from typing import NamedTuple

from language.scanning import COLOR, MARKS, Token, text_of, verb_words
from language.words import UNRELATED

_THING = (
    rf"(?:{COLOR}|cubes?|blocks?|bricks?|box|boxes|pieces?|drawers?|fridge|refrigerator|doors?|button|lever|wheel|switch"
    r"|tower|stack|pile|left|right|table|corner|middle|side|edge|them|both|all|everything|leftmost|rightmost|one"
    r"|gripper|containers?|whatever|what|which|nothing|thing|lid|palm|hand)"
)
_PLACE = (
    r"(?:in|into|inside|on|onto|at|to|next|near|left|right|behind|between|under|beside|above|below|over|top|from"
    r"|together|closer)"
)
_PERSON = (
    r"(?:i|we|he|she|they|you|that(?= (?:leaves|makes|gives|means|keeps|saves)\b)"
    r"|someone|somebody|everyone|everybody|anyone|anybody|nobody|no one|there|this|it|something"
    r"|(?:my|his|her|our|your|their|a|an|some|another|these|those) (?:\w+ ){0,1}\w+|whoever)"
)
_IS = r"(?:'s|is|are|was|were|am|has|have|had|will|would|may|might|looks?|seems?|feels?|stands?)"
_DOES = (
    rf"(?:{_IS}|likes?|loves?|hates?|forgot|put|bought|found|saw|left|thinks?|came|comes?|went|wants?|needs?|told|said"
    r"|says|promise|hopes?|knows?|bet|keeps?|gets?|got|makes?|made|(?:do|does|did|can|could) not|can|could|did|lost"
    r"|spilt|see|cannot|play|plays|cleans?|cook|work|wipe|watch|trust|read|sleep|melts?|spoils?|trips?|ran|runs?|just"
    r"|(?<=nobody )\w+s|(?<=no one )\w+s"
    r"|arrives?|leaves?|wakes?|returns?|starts?|begins?|will|already|still|always|never|really|[a-z]{3,}ed)"
)
_REMARK = re.compile(
    r"^(?:(?:but|and|so|that|because|since|now|well|also|or|else|as|before|until|in case|otherwise|when|after) )*"
    rf"(?:{_PERSON} {_DOES}|everything [a-z]{{3,}}s|(?:all )?(?!{_THING}\b)\w+(?: (?!{_THING}\b)\w+)? {_IS}"
    rf"|{_THING}(?: {_THING})? {_IS}"
    rf"|(?!{_THING}\b)[a-z]\w+ (?:keeps?|wants?|likes?|says|said|thinks|hates|loves|arrives?|comes?|leaves?|wakes?))\b"
)
_LEAD = (
    r"(?:(?:and|then|so|no|yes|please|to|just|now|but|or|at least|better|first|second|finally|next|also|simply|only"
    r"|kindly|quickly|again|therefore|hence|thus|instead|rather|otherwise|maybe|you|either|if so|after that|,|robot) )*"
)
_OBLIGED = (
    r"\b(?:should|must|has to|have to|needs to|need to|ought to|shall|belongs?|supposed to|is to|are to|goes|go"
    r"|(?:needs?|wants?|could do with) (?:a )?\w+ing|had better|(?:can|could|may|might)(?: as well)? (?:go|stand|sit)"
    r"|(?:can|could|would|will|may) (?:you|we|it|they|someone))\b"
)
_WISH = (
    r"\b(?:i|we) (?:\w+ )?(?:want|need|like|love|prefer|wish|require|appreciate)\b|\blet (?:me|us) have (?!a )"
    r"|\b(?:i|we) will (?:have|take) (?!to\b|a\b)|\b(?:she|he|they|my \w+) (?:would like|wants?|needs?) (?!to |it\b)"
)
_CLOSING = "regards|wishes|sincerely|greetings|faithfully|truly|yours|thanks|cheers|love"
_SIGNED = re.compile(
    rf"(?:^|(?<=[.,;!?] ))(?:(?:best|kind|kindest|warm|many|with|yours|all) )*(?:{_CLOSING}) "
    r"[,.!]? ?(?P<who>[^,;!?]*?)(?: [.!])?$"
)
_SINCE = r"(?:because|cause|since|although|though|whereas|while|whilst)\b"
_AFTER = re.compile(  # where a reason or a circumstance begins within a part
    rf" (?={_SINCE}"
    r"|(?:so(?: that)?|as|before|(?<!not )until|in case|or(?: else)?|otherwise|in order (?:that|to)|when|after)"
    r" (?!(?:it|they|he|she) (?:is|are|was|were)(?:$| [.;,]))"
    rf"(?:(?:{_PERSON}|everything) (?:{_DOES}|[a-z]{{3,}}s)"
    rf"|{_THING}(?: {_THING})? {_IS}(?!.*\b(?:{_PLACE}|where|there)\b)"
    rf"|(?!{_THING}\b)\w{{3,}} {_DOES})\b"
    r"|so (?:it|he|she|they) (?:gets?|does|do|stays?|cools?|dries)\b"
    r"|and (?:i|we|he|she|they) (?!.*\bit\b.* (?:in|on|to)))"
    r"|(?<! where)(?<! after)(?<! when)(?<! that)(?<! if)(?<! until)(?<! and)(?<! but)(?<! sure)(?<! so)(?<! which)"
    r"(?<! as)"
    r" (?=(?:he|she|they) (?:is|are|was|wants?|has|likes?|looks?|feels?|gets?)\b)"
    r"|(?<=it|em|re|ck|wn|up|ay|ff|ut|in|ow|en) (?=i (?:do not|did not|can not|am|was|hate|forgot|just|will)\b)"
)
_IS_SO = re.compile(  # "the red cube is dusty | put it in the drawer"
    rf"^(?:{_THING} ){{1,2}}{_IS} (?:(?:so|too|very) )?(?!not\b)\w+"
    r"(?= (?:please )?(?:put|move|take|give|bring|open|close|shut|get) (?:it|them)\b)"
)
_STATES = re.compile(  # what a circumstance does not say
    rf"{_OBLIGED}|\b(?:next to|left of|right of|on top|closer|near|nearer|beside|further|farther|away|neighbou?r|touch"
    r"|behind|between|inside|pressed|open(?:ed)?|shut|in front)\b"
    rf"|\byou {_DOES}\b|\bwhile you\b"
)
_IDLE = re.compile(  # what is said to people, and what a look at the scene shows
    r"(?:and |then |please |so )*(?:report|notify|inform|let (?:me|us) know|tell (?:me|us) (?:when|that|once|if)"
    r"|keep me posted|as (?:discussed|agreed|mentioned|promised|usual|always|requested|planned|i said|we said|before)"
    r"|yeah|yep|come on|meanwhile|nothing else)\b"
)
_CHECK = re.compile(r"(?:and |then |please |first )*(?:verify|check|confirm|assert|see) (?:that|whether|if)\b")
_REASON = re.compile(
    rf"{_SINCE}|(?:in order )?to (?:make|have|keep|save|avoid|prevent|free|create|be|let|ensure|help|allow|prepare)\b"
    r"|(?:many )?(?:thanks|thank you) for\b"
    r"|(?:i|we) (?:need|want|use|require) (?:drawer|fridge|refrigerator|table) (?:for|to)\b"
)
_TELLS = re.compile(rf"(?:(?:and|but|so|well|oh) )*{_PERSON} (?!{_PLACE}\b)\w+|(?:do you |can you )?(?:see|remember)\b")
_UNSURE = re.compile(r"(?:i|we) (?:forgot|thought|know|said)\b")
_SUBJECT = (
    r"(?:i|we|you|he|she|they|it|that|this|these|those|there|what|too|so|such|no|not|just|my \w+|your \w+|our \w+|his"
    r" \w+|her \w+|their \w+|everyone|everybody|nobody|people|life|man|dude|boy|(?:ha)+h?|(?:he){2,}|(?:hi){2,}|lol"
    r"|lmao|rofl|xd|ugh|argh|phew|if (?:you|i|we) (?!\w+ed\b)|\w+ (?:'s|is|are) (?:\w+ing|gone|asleep|away)\b)"
)
_LIMITS = (  # words that change what is to be done
    r"(?:only|except|without|instead|unless|until|but not|rather|same|other|others|another|more|less|again|every|each"
    r"|any|first|second|third|last|twice|times|half|where|back|away|there is|slowly|gently|carefully|careful|wait|stop"
    r"|forward|forwards|backwards|sideways|up|down|by|cm|metres?|one|two|three|four|five|\d+)"
)


_LEAVING = re.compile(
    r"\b(?:i|we|he|she|they) (?:will |am |are |have to |must )?(?:go|going|goes|leave|leaving)(?: to| off)?"
    r"(?: bed| sleep| home| work| out| school| shopping)*(?: now| soon)?(?=$| and\b)"
)


_REFERS = re.compile(  # what no exclamation says
    r"\b(?:it|its|them|they|that|this|these|those|there|here|not|no|never|if|or|else|for|with|of|\w+ly|bit|little"
    r"|much|far|further|apart|also|too|whichever|choice|choose|decide|like|mind|matter|closed|empty|full|out|towards?"
    r"|yourself|me|us)\b"
)


class _Part(NamedTuple):
    """A part of a sentence: its words, as text without the mark after it, and the mark."""

    words: list[Token]
    text: str
    mark: str


def is_chat(words: Sequence[str]) -> bool:
    """Whether a part of a sentence is about people or the occasion: it names nothing, and no act, place or limit."""
    text = re.sub(r"^(?:(?:and|but|so|because|since|cause|for|well|oh|ok|okay|hey|hmm|as) )+", "", " ".join(words))
    text = _LEAVING.sub("we agree", text)
    if re.match(r"(?:i|we|he|she|they|my \w+) (?:will|would|want|wants|need|needs|shall|should|must|wish)\b", text):
        return False
    return bool(re.match(rf"{_SUBJECT}\b", text)) and not naming().search(text.removeprefix("there "))


@cache
def naming() -> re.Pattern[str]:
    """Return a pattern for words that name something, an act, a place or a limit."""
    return re.compile(rf"\b(?:{_THING}|{_PLACE}|{_LIMITS}|{verb_words()})\b")


def _is_exclamation(text: str) -> bool:
    """Whether a part names nothing and refers to nothing: "perfect, chef's kiss"."""
    if not UNRELATED.isdisjoint(text.split()):
        return False
    return not naming().search(text) and not _REFERS.search(text)


def without_remarks(found: list[Token]) -> list[Token]:
    """Return the words without parts that ask for nothing: "the light is off, press the button, I cannot see"."""
    parts = _parts(_unsigned(found))
    parts = [part for part in parts if not _is_label(part)] or parts
    asking = [part for part in parts if _asks(part.text)]
    if not asking:
        return [token for part in parts for token in part.words]
    refers = any(re.search(r"\b(?:it|its|that|them|there|inside)\b|^\S+$", part.text) for part in asking)
    kept: list[Token] = []
    for part, after in zip_longest(parts, parts[1:]):
        joined = after is not None and after.words[0].text in ("and", "then", "but")  # "whistle, then open the drawer"
        if _follows(part, kept) or (part not in asking and _is_exclamation(part.text) and not joined):
            continue
        if part in asking or not asks_nothing(part.text):
            kept += part.words
        elif (named := _NAMED.search(part.text)) and not kept and refers:  # what "it" means afterwards
            both = _BOTH.search(part.text) if re.search(r"\b(?:them|both)\b", asking[-1].text) else None
            named, last = both or named, part.words[-1]
            first = part.text[: named.start()].count(" ")
            kept += [*part.words[first : first + len(named[0].split())], Token(".", last.start, last.end)]
    return kept or found


def _parts(found: list[Token]) -> list[_Part]:
    """Return the words between marks; a reason within them is a part of its own."""
    parts: list[list[Token]] = []
    for token in found:
        if not parts or parts[-1][-1].text in MARKS:
            parts.append([])
        parts[-1].append(token)
    split: list[list[Token]] = []
    for part in parts:
        text = text_of(part)
        cut = _AFTER.search(text)
        at = text[: cut.start()].count(" ") + 1 if cut and not _STATES.search(text[cut.start() :]) else len(part)
        at = before[0].count(" ") + 1 if (before := _IS_SO.match(text)) else at
        split += [each for each in (part[:at], part[at:]) if each]
    return [_Part(each, text_of(each).rstrip(f" {''.join(MARKS)}"), each[-1].text) for each in split]


@cache
def command() -> re.Pattern[str]:
    """Return a pattern for the beginning of a command."""
    return re.compile(rf"^{_LEAD}(?:{verb_words()}|do not|never|no need)\b(?! ?:)")


def _asks(text: str) -> bool:
    """Whether a part is surely a command or a wish."""
    if _IDLE.match(text) or _CHECK.match(text):
        return False
    if command().match(text) and not _REASON.match(text):
        return True
    wish = re.search(rf"{_OBLIGED}|{_WISH}", text) and re.search(rf"\b(?:{_THING}|it|that|there)\b", text)
    return bool(wish) and not _UNSURE.match(text) and not _REASON.match(text)


def _is_label(part: _Part) -> bool:
    """Whether a part is a label: "message from reception:"."""
    told = rf"\b(?:{_THING}|it|twice|times|once|no|not|wait|sorry|if|mean)\b"
    return part.mark == ":" and not re.search(told, part.text) and not command().match(part.text)


def _follows(part: _Part, kept: list[Token]) -> bool:
    """Whether a part says what follows from a place: "behind the red cube, so that the red cube is before it"."""
    if not re.match(rf"(?:so|such) that {_THING} ", part.text):
        return False
    return any(re.fullmatch(_PLACE, token.text) for token in kept)


def asks_nothing(text: str) -> bool:
    """Whether a part is a reason, or says what is so."""
    idle = _IDLE.match(text) and not re.search(rf"\b{_THING}\b", text.replace("nothing", ""))
    if idle or _CHECK.match(text) or _REASON.match(text):
        return True
    kept = rf"\b(?:if|unless|which|any|order|should|must|only|not touch|wrong)\b|^there (?:is|are)\b.*\b{_THING}\b"
    if not _REMARK.match(text) or re.search(kept, text):
        return False
    subject = re.match(rf"(?:and |but |so )?(?:\w+ ){{0,2}}{_THING}\b", text)
    return not (subject and re.search(rf"\b{_THING} .*\b{_PLACE}\b", text))


def tells_of(text: str) -> bool:
    """Whether a part tells or asks how something is, so that it may say what "it" means: "you see the red cube"."""
    text = re.sub(r"\b(?:go|goes) (?:bad|off|wrong|cold|warm|sour)\b", "spoils", text)
    if re.search(rf"{_OBLIGED}|{_WISH}|\b(?:if|unless|not|never|only|wrong|instead|mistake)\b", text):
        return False
    return bool(_REMARK.match(text) or _TELLS.match(text))


def _unsigned(found: list[Token]) -> list[Token]:
    """Return the words without a name under them: "best regards, Hannelore"."""
    text = text_of(found)
    signed = _SIGNED.search(text)
    if not signed or not signed.start() or len(signed["who"].split()) > 4 or re.search(_THING + r"\b", signed["who"]):
        return found
    return found[: text[: signed.start()].count(" ")]


_BOTH = re.compile(rf"\b(?:{COLOR})(?: \w+)? and (?:{COLOR})\b(?: (?:cube|block|one|box|brick|piece)s?\b)?")
_NAMED = re.compile(
    rf"\b(?:{COLOR}) (?:cube|block|one|box|brick|piece)\b|\b(?:{COLOR})\b(?! drawer| fridge)"
    r"|\b(?:drawer|fridge|refrigerator|button|lever|wheel)\b"
)
