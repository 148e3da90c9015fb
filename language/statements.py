"""Statements that ask for nothing: "you are good at this", "it fell down".

They are opinions, or tell what has happened. Whatever names a thing of the scene, a place or a duty may be a wish and
is left to the grammar, but for what is told of a fall or of what the robot did.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache

from language.acts import Part
from language.scanning import COLOR, verb_words
from language.words import TABLE, phrases

_LEADS = re.compile(
    r"^(?:(?:and|but|so(?= (?:you|it|that|this|i|they)\b)|oh|well|hey|no|wow|yes|okay|because|now|then|really|wait"
    r"|sorry|actually|honestly|phew|haha|ha|see|hmm|man|damn|i (?:must|have to|would) say"
    r"|(?:i|we) (?:see|guess|believe|find|think)|,|that(?= (?:you|it|that|this|i)\b)) )+"
)
_VERY = (
    r"(?:(?:so|too|very|pretty|really|quite|just|all|all of|a bit|kind of|rather|not|indeed|even|always|still|again"
    r"|actually|certainly|truly|totally|almost|never|ever|only|already|sure|surely) )*"
)
_ASKS = (
    r"(?:that|what|how|where|why|who|when|do|is|are|can|could|if|many|much|far|high|tall|long|old|big|large|close|near"
    r"|wide|come|about|to|does|did|would|was|should|heavy|fast|often)\b"
)
_OPINION = re.compile(
    rf"^(?:(?:you|this robot|robot) {_VERY}(?:are|were|look|looked|seem|sound|rock|work|learn|have (?:a|an|such|very"
    r"|good|nice|great|steady)|get it|got (?:it|that) (?:right|done)|do (?:it|that|this|so)?|did (?:it|that|this|so|a"
    r"|great|good|nicely|fine|well|very|really)|made my (?:day|evening|morning)|make me|know (?:how|what))\b"
    rf"|my \w+ {_VERY}(?:is|are) {_VERY}(?:getting|becoming|starting to)\b"
    rf"|(?:i|we|my \w+) {_VERY}(?:am|are|was|were|feel|felt|like|love|enjoy|enjoyed|hate|hated|liked|loved|admire"
    r"|appreciate|could not|can not|do not understand|do not know (?:what|how)|will (?:love|like|enjoy)"
    r"|would (?:never|not)|never (?:saw|thought|seen|knew)|did not (?:know|expect|think))\b"
    rf"|(?:that|this|it|these|they|all this|everything) {_VERY}(?:(?:will|might|could|may) \w+$"
    r"|is|was|were|are|looks|looked|seems|seemed|feels|felt"
    r"|works|worked|went|sounds|makes me|made me)\b"
    r"|what an? (?!.*\b(?<!you )(?:is|are|was|does|do|can|should)\b).*$"
    rf"|how (?!{_ASKS})\w+(?: (?:it|that|this|you) (?:is|are|was|looks?))?$"
    rf"|(?:not (?:too )?bad|so (?!{_ASKS})\w+|such an? \w+|very \w+|exactly what|look at (?:it|that|this|you))\b)"
)
_ACTED = (  # what people and the robot did to a thing
    r"dropped|lost|knocked|tipped|grabbed|picked|moved|pushed|opened|closed|pressed|turned|touched|placed|stacked"
    r"|switched|flipped"
)
_PAST = (
    rf"(?:{_ACTED}|drop|missed|fell|fallen|slipped|slip|broke|broken|crashed|failed|bumped|hit|collapsed|toppled|rolled"
    r"|let (?:it|that|go)|took|taken|did|put|reached|gave|brought|made|threw)"
)
_EVENT = re.compile(
    rf"^(?:you {_VERY}(?:have |had )?{_VERY}{_PAST}\b"
    r"|(?:it|that|this|they|one|cubes?|blocks?|tower|stack|"
    rf"(?:{COLOR}|whole)(?: one| cube| block| ball| thing| tower)?|top one) {_VERY}(?:has |have |is )?{_VERY}"
    r"(?:fell|fallen|slipped|dropped|tipped|broke|broken|crashed|collapsed|toppled|rolled|fell down|falling|gone|stuck"
    r"|did not (?:work|move|happen|succeed|go|open|close)|does not (?:work|move)|failed|moved by itself)\b"
    rf"|(?:nothing|something|not much) (?:has |is )?{_VERY}(?:happened|happening|moved|moving|changed|works|worked)\b)"
)
_NOT_EVENT = re.compile(
    r"\b(?:wanted|needed|forgot|left|should|must|have to|has to|need|said|asked|instead|please|not what|not where"
    r"|wrong|next time|i meant|where i|back|over again)\b"
)
_REPORT = re.compile(  # "I have already pressed the button", "my brother opened the drawer yesterday"
    rf"^(?:(?:i|we|he|she|they|someone|somebody|nobody|(?:my|our|your|a) \w+) {_VERY}"
    rf"(?:(?:have|has|had|'ve|'d) )?{_VERY}"
    rf"(?:{_ACTED}|pulled|built|filled|emptied|checked|lifted)"
    rf"|you {_VERY}(?:have |had )?{_VERY}(?:nearly |almost )(?:dropped|knocked|tipped|hit|broke)"
    r")\b(?! me\b)"
)
_HABIT = re.compile(r"^(?:they|people|some|he|she|we|i)\b.*\bused to\b")  # "they say it used to turn easily"
_LONG_AGO = re.compile(r"\b(?:used to|yesterday|(?:last|this) (?:week|month|year|night|morning)|last time|ago)\b")
_TAG = re.compile(
    r"^(?:you know|you see|i mean|is|are|was|were|did|do|does|have|has|right|or)(?: not)?"
    r"(?: (?:it|you|that|i|this|they|not))*$"
)


_BUSY = re.compile(  # "you look funny holding that"
    r"^(you (?:look|looked|are|were|seem) (?:\w+ ){1,3}?)"
    r"(?:(?:while|when|with|doing|holding|carrying|lifting|moving)\b ?)+"
    r"(?:it|that|this|them|(?:it|that|this|them|those|these) \w+)?(?: (?:there|like that|up there))*$"
)


@cache
def _asking() -> re.Pattern[str]:
    """Return a pattern for what may ask for something: a thing of the scene, a place, a duty, a verb after "and"."""
    return re.compile(
        rf"\b(?:{COLOR}|cubes?|blocks?|bricks?|box|boxes|pieces?|drawers?|fridge|refrigerator|doors?|button|lever|wheel"
        r"|switch|tower|stack|pile|corner|middle|edge|side|table|spheres?|balls?|cylinders?|gripper|container"
        r"|should|must|shall|have to|has to|had to|needs?|supposed|want|wants|wanted|belongs?|meant|mean|said"
        r"|asked|instead|please|wrong|left|next to|on top|on it|in it|in there|closer|farther|further|behind|between"
        r"|under|inside|(?:better|nicer|more) (?:on|in|at|next|near|beside|by|over|towards|to)"
        r"|too (?:far|much|high|low|close|fast|slow)|slow|quick|fast|slower|faster|open|closed|shut|empty"
        r"|full|if|to (?:have|see|get) (?:it|that|them|this)|(?:like|love) (?:you )?to|how about|other|another|one"
        rf"|(?:and|then|now|but|or|so) (?:{verb_words()})|waiting for|holding|carrying"
        r"|(?<!you )(?:take|give|put|get|bring|help|move|open|close|hold) (?:it|me|that|this))\b"
        r"|^(?:that|it|this) (?:is|was) (?:it|all|enough|not|no)\b"
    )


def stated(parts: Sequence[Part]) -> str:
    """Return what a sentence states that asks for nothing: "opinion", "event"; "" for another one."""
    kinds = [_kind(part) for part in parts]
    if "" in kinds:
        return ""
    chat = "opinion" in kinds or any(part.act == "social" for part in parts)
    return "event" if "event" in kinds else "opinion" if chat else ""


def _kind(part: Part) -> str:
    """Return "opinion", "event" or "idle" for a part of a sentence; "" for one that may ask for something."""
    text = " ".join(part.words)
    if part.act is not None:
        return "idle" if part.act in ("social", "yes", "no", "sorry") else ""
    if _TAG.match(text) or all(word in _polite() for word in part.words):
        return "idle"
    text = _BUSY.sub(r"\1", _LEADS.sub("", text))
    if _EVENT.match(text) and (_LONG_AGO.search(text) or not _NOT_EVENT.search(text)):
        return "event"
    told = _REPORT.match(text) and not _NOT_EVENT.search(text.replace("before you", ""))
    if part.mark != "?" and (told or _HABIT.match(text)):
        return "opinion"
    return "opinion" if part.mark != "?" and _OPINION.match(text) and not _asking().search(text) else ""


@cache
def _polite() -> frozenset[str]:
    """Return the words that alone say nothing."""
    return frozenset(each for table in ("polite", "social") for each in phrases(TABLE[table]) if " " not in each)
