"""Answers to questions about the world and about what was said and done.

A question states something of a subject: "is the drawer open?", "which cubes are not on the table?". The subject is a
phrase of the chart, and what is stated a `Predicate` that holds of a thing or not; conditions are read in the same way.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

from language.alternatives import ALTERNATIVE, Alternatives, palms
from language.comparing import Predicate
from language.lattice import Lattice
from language.normalise import questions
from language.planning import Planner
from language.scanning import COLOR, THING, Token, scan, text_of
from language.spots import is_operated
from language.talk import holds, listed, name, phrase, real, seen, state, where
from language.words import GROUPS, colors, nouns, phrases
from language.world import WorldModel

_PLAIN = "is, are, be, do, does, did, have, has, had, get, got, see, find, know, tell, show, look, want, need, like"
_PLAIN_VERBS = frozenset(phrases(_PLAIN)) | {"left", "can", "could", "put"}
_NUMBERS = ["no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve"]
_BE = r"(?:is|are|was|were|be|been|does|do|did|has|have|had|stands?|lies?|sits?|rests?|can|got)"
_ANY = r"(?:anything|something|nothing|everything|any|some|thing|things|all|there)"
_ADDING = re.compile(
    r"\b(?:not|no longer|still|already|now|currently|right(?= now| there)|at moment|at present|or not|yet|really|also"
    r"|just|directly|be|been|being|staying|standing|lying|located|placed|sitting|resting|both|either|today|happens to"
    r"|any more|anymore|actually|properly|completely|left(?= open| closed| shut| over|$)|always|maybe|hidden|stored"
    r"|there|then|in this room|in room|here|somewhere|anywhere)\b ?"
)
_STATES = {"open": True, "opened": True, "ajar": True, "closed": False, "shut": False, "close": False}
_OPERATED = dict.fromkeys(("pressed", "down", "switched", "turned", "moved", "flipped", "pushed", "on"), 1)
_OPERATED |= {"up": 0, "off": 0}
# a phrase that ends so is not whole
_GOES_ON = ("of", "and", "or", "a", "not", ",", "in", "on", "at", "to", "free", "clear")
_SEEING = r"(?:any|there|you|we|see|find|know|have|spot|got|recogni[sz]e|still|also|an?|some)"
_KNOWN = r"(?:do|can|have|did) (?:you|we|i) (?:have|see|know|got|find|own|recogni[sz]e|spot)\b|(?:is|are) there\b"
_SIDE = r"(left|right|in front|behind|above|under|next to|on|in)"
_BESIDE = r"(?:next to|near|close to|beside|left of|right of|to left of|to right of|behind|in front of|around)"
_CLOSE = r"(?:right|directly|just|immediately)"
_WORKED = re.compile(
    r"(?:(?:that|this|it|everything|all)(?: has| had| all)?|you(?: have| did| are| could| can)?)"
    r"(?P<not> (?:did |has )?not)?(?: did)? (?:work|worked|works|succeed|succeeded|went well|go well|well|managed?"
    r"|did it|do it|done|finished)(?: that| it| this)?$"
)
_BEST = r"\b(?:closest|nearest|farthest|furthest|most|\w+(?:most|g?est))\b"
_SEVERAL = re.compile(  # between two questions
    r" (?:, )?(?:and |but |, )(?:also )?(?=(?:how|where|what|which|who|why)\b"
    r"|(?:is|are|do|does|did|has|have|can) (?!in\b|on\b|at\b|next\b|under\b|behind\b|near\b|left\b|right\b|not\b))"
)
_GRIPPER = r"\b(?:gripper|your hand|claw|your fingers|you)\b"


class Questions(Alternatives):
    """Answers the questions of one sentence.

    Args:
        world: as it is.
        planner: resolves phrases in it.
        turns: what was said before and what came of it, oldest first.
        body: what the robot is.
    """

    def __init__(self, world: WorldModel, planner: Planner, turns: Sequence[Any], body: str = "a robot arm") -> None:
        self.world, self.planner, self.turns, self.body = world, planner, turns, body
        self.pointed = [i for gesture in planner.gestures for i in gesture.things]
        self.things: list[int] = []  # that were asked about
        self.excepted: list[int] = []  # that a question leaves out: "apart from the red cube"

    def answer(self, asked: str) -> str | None:
        """Return the answer in a sentence, or one for each of several questions; None if it is not known."""
        asked = self._without_excepted(asked)
        first, *other = ALTERNATIVE.split(asked, maxsplit=1)
        if other:
            return self._either_question(first, other[0])
        parts = _SEVERAL.split(asked)
        if len(parts) > 1:
            told = [self._answer_to_next(part) for part in parts]
            if None not in told:
                return " ".join(dict.fromkeys(each for each in told if each))
        return self._answer(asked)

    def _answer_to_next(self, asked: str) -> str | None:
        before = self.things
        told = self._answer(asked)
        self.planner.it = tuple(self.things) or self.planner.it
        self.things = [*self.things, *(i for i in before if i not in self.things)]
        return told

    def _answer(self, asked: str) -> str | None:
        asked = re.sub(r"\b((?:to|on|most|f[au]rthest)(?: my| your)? right) now\b", r"\1", asked)
        asked = re.sub(
            r" (?:still|currently|actually|right now|at moment|at all|presently|here(?= (?:that|which)\b))\b"
            r"(?! (?:open|closed|there))",
            "",
            asked,
        )
        asked = re.sub(
            r"^what (?:do|have) (?:you|we) (?:have|got|keep) (?=(?:in|inside|on|under) (?!your|my))", "what is ", asked
        )
        asked = re.sub(r"^((?:what|which|who|where|how|is|are)\b.*) again$", r"\1", asked)  # "where is it again?"
        asked = re.sub(r"^(what|which|who) all (?!\w+ing\b)", r"\1 ", asked)
        asked = re.sub(rf"\b(round|square) ({COLOR}) (?=(?:thing|one|object)s?\b)", r"\2 \1 ", asked)
        for kind, pattern in questions():
            if (match := pattern.search(asked)) and (text := getattr(self, kind)(match)):
                text = re.sub(r"\b(on|in) (?:palm|my hand|hand)\b", r"\1 your hand", text)
                return text[0].upper() + text[1:] + ("" if text[-1] in ".!?" else ".")
        named = palms(asked)
        return self._answer(named) if named != asked else None

    # ---- Phrases

    def refs(self, text: str) -> tuple[Any, list[int]]:
        """Return the phrase in some words and the things that it fits."""
        tokens = scan(text)
        entity, found = phrase(self.world, self.planner, tokens)
        if entity is not None and not self.world.cells and self._says_more(tokens, entity.span):
            return None, []
        things = real(self.world, found)
        kind = entity.kind if entity is not None else ""
        if entity is not None and entity.role == "target":
            things = [ref.things[-1] for ref in found if ref.things]
        if kind == "stack" and not self.world.cells:
            things = [i for i in things if self.world.below[i] is not None]  # one cube is no tower
        if entity is not None and kind == "it" and not entity.plural and self.planner.box is not None and not things:
            things = [self.planner.box]
        if entity is not None and entity.colors and not entity.plural and self._names_no_kind(tokens, entity.span):
            things = [i for i in things if self.world.is_loose(i)] or things  # "where is the red one?"
        self.things = things
        return entity, things

    def _names_no_kind(self, tokens: list[Token], span: tuple[int, int]) -> bool:
        """Whether a phrase ends with a colour or with "one"."""
        last = tokens[span[1] - 1].text if span[1] else ""
        return last == "one" or re.fullmatch(COLOR, last) is not None

    def _says_more(self, tokens: list[Token], span: tuple[int, int]) -> bool:
        """Whether words beside a phrase say something, so that the phrase alone is not what is asked about."""
        lattice = Lattice(tokens)
        for i in (*range(span[0]), *range(span[1], len(lattice))):
            named = {edge.value for edge in lattice.get(i, "noun")} - {"thing"}
            acts = [e for e in (*lattice.get(i, "verb"), *lattice.get(i, "done")) if e.cost == 0.0]
            if named or "color" in lattice.edges[i] or (acts and lattice.text(i) not in _PLAIN_VERBS):
                return True
        return False

    def names(self, things: Sequence[int]) -> str:
        """Return the names of things, as in a sentence."""
        return listed([name(self.world, i) for i in things])

    def subject(self, text: str) -> list[int] | None:
        """Return the things that a question is about; None if the words name none."""
        if re.fullmatch(rf"(?:{_ANY}|one|ones|who|cubes?|blocks?|of|else| )*", text) and not re.search(
            "cube|block", text
        ):
            return [i for i, thing in enumerate(self.world.things) if not thing.target and i != self.world.hand]
        if re.fullmatch(
            r"(?:(?:any|one|some|either) )?(?:of )?(?:two|both|them|these|those|they|these two|those two)(?: ones)?",
            text,
        ):
            loose = [i for i in range(len(self.world.things)) if self.world.is_loose(i)]
            return [*self.planner.it] if len(self.planner.it) > 1 else [*self.world.containers] or loose
        if re.fullmatch(r"(?:it|that|this|that one|this one|there|inside)", text):
            return list(self.planner.it[:1]) or ([self.planner.box] if self.planner.box is not None else None)
        if beside := re.search(rf"\b{_CLOSE} (?={_SIDE}\b(?: of)? (?P<anchor>.+))", text):
            return self._nearest(self.refs(text.replace(beside[0], ""))[1], beside["anchor"]) or None
        words = re.split(r" (?:and|or|,) (?:(?:and|or) )?", text)
        noun = re.search(rf"(?:{COLOR}) ({THING})$", words[-1])  # "the red and the blue cube"
        parts = [self.refs(f"{part} {noun[1]}" if noun and re.fullmatch(COLOR, part) else part) for part in words]
        if any(entity is None for entity, _ in parts):
            return None
        return list(dict.fromkeys(i for _, things in parts for i in things))

    # ---- What is stated

    def predicate(self, text: str) -> Predicate | None:
        """Return what some words state of things; None if they state nothing that is known."""
        negated = bool(re.search(r"\bnot\b|\bno longer\b", text)) and not text.endswith("or not")
        close = re.search(rf"\b{_CLOSE} {_SIDE}\b", text)
        plain = _ADDING.sub("", f"{text} ").strip()
        plain = re.sub(r"^(?:to be|in|on) (?=open|closed|empty|free)", "", plain)
        plain = plain.removeprefix("right ") if close else plain
        found = self._state(plain) or self._content(plain) or self._place(plain, close is not None)
        if found is None or not negated:
            return found
        return Predicate(lambda i: None if (so := found.holds(i)) is None else not so, found.about)

    def _state(self, plain: str) -> Predicate | None:
        world, word = self.world, plain.split()[-1] if plain else ""
        boxes, devices = world.containers, world.devices
        if plain in _STATES:
            return Predicate(lambda i: (i in world.open) == _STATES[plain] if i in boxes else None, "state")
        if plain in _OPERATED or (
            plain.startswith(tuple(_OPERATED)) and plain.split()[-1] in ("in", "down", "over", "on")
        ):
            wanted = bool(_OPERATED.get(plain, _OPERATED.get(plain.split()[0], 1)))
            return Predicate(lambda i: is_operated(world, i) == wanted if i in devices else None, "state")
        if re.fullmatch(r"(?:that )?(?:stacked|piled)(?: up| on top)*", plain):
            return Predicate(lambda i: world.below[i] is not None or world.above[i] is not None, "place")
        enclosing = (*boxes, world.hand)
        if plain in ("empty", "full", "occupied", "taken", "vacant", "in use"):
            full = plain in ("full", "occupied", "taken", "in use")
            return Predicate(lambda i: bool(world.contents(i)) == full if i in enclosing else None, "content")
        if re.fullmatch(r"(?:still )?(?:free|clear|uncovered|bare|unobstructed)(?: (?:on|at) \w+)?", plain):
            return Predicate(lambda i: not world.contents(i) if i in enclosing else world.above[i] is None, "under")
        if re.fullmatch(rf"(?:{COLOR})(?: (?:or|and) (?:{COLOR}))*(?: colou?red)?", plain):
            meant = {color for each in re.findall(COLOR, plain) for color in colors()[each]}
            return Predicate(lambda i: world.things[i].color in meant, "color")
        if compared := self.than(plain):
            return compared
        if kinds := _kinds(plain):
            return Predicate(lambda i: world.things[i].kind in kinds, "kind")
        held = r"^(?:held|held by you|holding|you hold|you holding)$"
        if word == "held" or re.search(rf"^(?:in|by) .*{_GRIPPER}|{held}", plain):
            return Predicate(lambda i: i == world.held, "place")
        if plain in ("blocked", "covered", "buried", "obstructed", "trapped", "in way", "accessible", "reachable"):
            shut = {i for i, box in world.inside.items() if box in boxes and box not in world.open}
            free = plain in ("accessible", "reachable")
            return Predicate(lambda i: (world.above[i] is not None or i in shut) != free, "under")
        return None

    def _content(self, plain: str) -> Predicate | None:
        """Return the predicate of what encloses something: "has a red cube in it", "contain anything"."""
        world = self.world
        match = re.fullmatch(
            r"(?:(?:have|has|hold|holds|contain|contains|got|with) )?(?P<what>.*?) ?(?:in|inside|within|on)"
            r"(?: top)?(?: of)?(?: it| them)?"
            r"|(?:have|has|hold|holds|contain|contains) (?P<only>.+)",
            plain,
        )
        if match is None:
            return None
        what = (match["what"] or match["only"] or "").strip()
        if not what:
            return None
        stacked = enumerate(world.above) if re.search(r"\bon\b", plain) else ()
        on = {i: [over] for i, over in stacked if over is not None}
        about = "under" if on else "content"
        if re.fullmatch(rf"(?:a |any |another )?(?:{_ANY}|cube|block|cubes|blocks|one|it)?(?: else)?", what):
            return Predicate(lambda i: bool(on.get(i) or world.contents(i)) != what.startswith("nothing"), about)
        things = self.subject(what)
        return Predicate(lambda i: bool({*on.get(i, ()), *world.contents(i)} & {*things}), about) if things else None

    def _place(self, plain: str, close: bool = False) -> Predicate | None:
        """Return the predicate of what is somewhere. close: only the nearest is."""
        world = self.world
        if re.fullmatch(r"(?:in|inside|in there|in it|inside it)", plain):
            boxes = [self.planner.box] if self.planner.box is not None else list(world.containers)
            return Predicate(lambda i: world.inside.get(i) in boxes, "place")
        if re.fullmatch(r"(?:on|in) my (?:hand|palm)", plain):
            return Predicate(lambda i: world.inside.get(i, -1) == world.hand, "place")
        if re.fullmatch(r"on (?:table|desk|surface|table top)", plain):
            return Predicate(lambda i: world.is_on_ground(i) if world.is_loose(i) else None, "place")
        if re.fullmatch(
            r"(?:on|at) (?:very )?(?:top|bottom)(?: of (?:something|a cube|another cube|stack|tower|pile|any cube))?",
            plain,
        ):
            on, other = (world.below, world.above) if " top" in plain else (world.above, world.below)
            whole = re.search(r"(?:top|bottom|stack|tower|pile)$", plain) is not None
            about = "place" if " top" in plain else "under"
            return Predicate(lambda i: on[i] is not None and (other[i] is None or not whole), about)
        under = re.match(r"(?:under|below|beneath|underneath) (.*)", plain)
        if under and (upper := self.subject(under[1])):
            return Predicate(lambda i: any(world.below[j] == i for j in upper), "under")
        if outside := re.match(r"(?:out of|outside(?: of)?) (.*)", plain):
            boxes = self.subject(outside[1]) or []
            return Predicate(lambda i: world.inside.get(i) not in boxes if world.is_loose(i) else None, "place")
        if part := self.part(plain):
            return part
        entity, found = self.refs(f"thing {plain}")
        if (
            entity is None
            or entity.span[1] < len(scan(f"thing {plain}"))
            or not (entity.relations or entity.superlative or entity.sides)
        ):
            return None
        found = self._nearest(found, re.sub(rf"^{_SIDE}(?: of)? ", "", plain)) if close else found
        return Predicate(lambda i: i in found, "place")

    def _nearest(self, things: list[int], anchor: str) -> list[int]:
        """Return the one of some things that is nearest to what an anchor names."""
        anchors = self.subject(anchor)
        loose = [i for i in things if self.world.is_loose(i)] or things
        if not anchors:
            return things
        x, y = self.world.things[anchors[0]].x, self.world.things[anchors[0]].y
        return sorted(loose, key=lambda i: math.hypot(self.world.things[i].x - x, self.world.things[i].y - y))[:1]

    def _told(self, index: int, about: str) -> str:
        """Return what is so of a thing."""
        world, plain = self.world, name(self.world, index).split(" in ")[0]
        if about in ("content", "under") and index in (*world.containers, world.hand):
            inside = world.contents(index)
            return f"{self.names(inside).split(' in ')[0] if inside else 'nothing'} is in {plain}"
        if about == "under" and (upper := world.above[index]) is not None:
            return f"{plain} is under {name(world, upper)}"
        if about == "under" and world.is_on_ground(index):
            return f"nothing stands on {plain}"
        if about == "kind":
            return f"{plain} is a {world.things[index].kind}"
        if about == "color":
            return f"{plain} is {world.things[index].color}"
        if about == "size":
            wide = "a cell" if world.cells else f"{100 * world.things[index].width:.0f} cm"
            return f"{plain} {'has room for one thing' if index in world.containers else f'is {wide} wide'}"
        if about == "state" or (about != "place" and not world.is_loose(index)):
            return state(world, index)
        return f"{plain} is {where(world, index)}"

    def split(self, text: str) -> tuple[list[int], Predicate, str, str] | None:
        """Return the subject and the predicate of a statement, and their words: the longest subject that leaves one."""
        words = text.split()
        its = self.planner.it
        if words[:1] == ["it"] and self.planner.box is not None and its and its[0] not in self.world.containers:
            state = self._state(_ADDING.sub("", f"{re.sub(rf'^it (?:{_BE} )?', '', text)} ").strip())
            if state is not None and state.holds(its[0]) is None and state.holds(self.planner.box) is not None:
                self.planner.it = (self.planner.box,)  # "put it in the drawer", "is it closed?"
        for cut in range(len(words) - 1, 0, -1):
            head, rest = " ".join(words[:cut]), " ".join(words[cut:])
            if re.search(r" (?:is|are|have|has|contains?|holds?)\b", head) and "that" not in head:
                continue
            joint = re.match(rf"(?:(?:{_BE}|both|not) )+", f"{rest} ")
            if words[cut] in ("of", "and", "or", ",") or words[cut - 1] in _GOES_ON:
                continue
            stated = self.predicate(
                rest[joint.end() :] if joint and "not" not in joint[0] else re.sub(rf"^{_BE} ", "", rest)
            )
            things = (
                self.subject(re.sub(r"^(?:my|your|our|any|some|a|an) (?!hand|gripper)", "", head)) if stated else None
            )
            if stated and things is not None and (not things or any(stated.holds(i) is not None for i in things)):
                self.things = things
                return things, stated, head, rest
        return None

    # ---- Yes or no, which, how many

    def is_so(self, match: re.Match[str]) -> str | None:
        """Say whether something is so."""
        text = _with_nouns(re.sub(rf"^(?:{_BE}|could|would|will) ", "", match[0]))
        if re.search(r"\b(?:your gripper|gripper|your hand|claw|you)\b.*\b(?:empty|free|full|open)\b", text):
            return f"{'yes' if (self.world.held is None) == ('full' not in text) else 'no'}: {holds(self.world)}"
        if re.match(r"table\b.*\bempty", text):
            return f"no: {seen(self.world)}"
        either = re.fullmatch(rf"(.+?) (?:to )?{_SIDE} (?:of )?or (?:to )?{_SIDE}(?: of)? (.+)", text)
        if either and (said := self._either(either)):
            return said
        one_of = re.sub(r" or (?!not\b).*$", "", text)
        inside = re.search(r"\b(?:in|inside) (?:\w+ )?\w+ or \w", text)  # "in the drawer or the fridge"
        found = (self.split(text) if inside else None) or self.split(
            (text if " , " in text else one_of).split(" , ")[0]
        )
        if found is None:
            return self.exists(match)
        things, stated, head, rest = found
        things = self._others(things, head)
        if not things:
            return f"no: there is no {_plain(re.sub(r'^there (?:an? |any |some )?', '', head))} here"
        fits = [i for i in things if stated.holds(i)]
        if re.match(rf"(?:there |any )*(?!all\b){_ANY}\b", head):
            fits = [i for i in fits if self.world.is_loose(i)] or fits
            self.things = fits or self.refs(rest)[1]
            shown = "; ".join(self._told(i, stated.about) for i in fits[:3])
            nothing = head.startswith("nothing")
            return (
                f"{'no' if nothing else 'yes'}: {shown}"
                if fits
                else f"{'yes' if nothing else 'no'}: nothing is {_plain(re.sub(rf'^{_BE} ', '', rest))}"
            )
        every = re.search(r"\b(?:both|all|every|and|each)\b", match[0]) is not None
        yes = len(fits) == len(things) if every else bool(fits)
        others = [i for i in things if i not in fits] if every and len(things) > 2 and not yes else things
        self.things = (fits if fits and not every else others)[:3]
        told = "; ".join(self._told(i, stated.about) for i in self.things)
        return told if re.search(r" or (?!not\b)", text) else f"{'yes' if yes else 'no'}: {told}"

    def _others(self, things: list[int], text: str) -> list[int]:
        """Return things without what was spoken of last, if a question is about anything else."""
        spoken = (*self.planner.it[:1], self.world.held) if re.search(r"\belse\b", text) else ()
        return [i for i in things if i not in spoken and i not in self.excepted]

    def _either(self, match: re.Match[str]) -> str | None:
        """Say which of two is so: "is the red one left or right of the yellow one?"."""
        subject, *sides, other = match.groups()
        told = None
        for side in (f"{each} of" if each in ("left", "right", "in front") else each for each in sides):
            found = self.split(f"{subject} {side} {other}")
            things = [i for i in found[0] if self.world.is_loose(i)] if found else []
            if found is None or len(things) != 1:
                return None
            if found[1].holds(things[0]):
                beside = self.names(self.subject(other) or [])
                self.things = things
                return f"{self.names(things)} is {side} {beside}"
            told = self._told(things[0], "place")
        return told

    def exists(self, match: re.Match[str]) -> str | None:
        """Say whether something of the kind is there."""
        text = re.sub(rf"^(?:{_BE} )?(?:{_SEEING} )*", "", match[0])
        text = re.sub(r"(?: still)? (?:here|there)$", "", text)
        entity, things = self.refs(re.sub(rf"\b{_ANY}\b", "thing", text))
        things = [i for i in things if i not in self.excepted]
        if entity is None and re.match(rf"{_KNOWN}|can you\b", match[0]) and len(text.split()) < 5:
            text, known = _plain(text), re.match(_KNOWN, match[0])
            return f"no: I know of no {text} here" if known else f"no, I cannot {text}"
        rest = text_of(scan(text)[entity.span[1] :]) if entity is not None else ""
        if entity is None or re.search(r"[a-z]", _ADDING.sub("", f"{rest} ")):  # "is the red cube dirty?"
            return None
        if not things:
            return f"no: there is no {_plain(text)} here"
        if entity.kind == "stack":
            return f"yes: {'; '.join(self._told(i, 'place') for i in things[:3])}"
        alone = not re.search(r"\b(?:there|any|you|we)\b", match[0]) and len(things) == 1
        return f"yes: {self._told(things[0], 'state') if alone else self.names(things)}"

    def which(self, match: re.Match[str]) -> str | None:
        """Name the things of which something is so."""
        text, _, among = match[0].partition(" , ")
        if re.fullmatch(r"(?:what|which) (?:ones?|of them|cubes?|blocks?)(?: exactly)?", text) and self.turns:
            self.things = [i for turn in reversed(self.turns) for i in turn.about if turn.about][:12]
            return f"I mean {self.names(self.things)}" if self.things else None
        text = _with_nouns(re.sub(r"^(?:what|which|who)(?: all| else)? ?(?:of )?", "", text))
        if re.search(r"\w (?:on|in|inside|under|next to|near|behind|at)$", re.sub(rf"^{_BE}", "", text)):  # "it is on"
            words = re.sub(rf"^{_BE} | (?:stand|lie|sit|rest)$", "", text.rpartition(" ")[0])
            self.things = self.subject(_ADDING.sub("", f"{words} ").strip()) or []
            return "; ".join(self._told(i, "place") for i in self.things[:3]) or None
        noun = re.match(
            r"(?:cubes?|blocks?|things?|objects?|ones?|box|boxes|containers?|devices?|doors?|items?)\b", text
        )
        joint = re.search(rf"(?:^|(?<= )){_BE}(?= )", text)
        head, rest = (text[: joint.start()].strip(), text[joint.end() :].strip()) if joint else ("", text)
        if rest.startswith("or ") or not rest:
            return None
        if re.match(_BEST, rest) and not among and (best := self.best(rest, head or (noun[0] if noun else "cube"))):
            return best
        negated = "not " if rest.startswith("not ") else ""
        stated = self.predicate(rest)
        things = self.subject(
            re.sub(r" ?\b(?:in this room|in room|here|there|on offer)\b", "", head).strip() or "thing"
        )
        if among and (named := self.subject(among)):
            things = named
        if stated is None or things is None:
            phrase_words = rest if joint and not head else text
            entity, fits = self.refs(phrase_words)
            if entity is not None and entity.span[1] < len(scan(phrase_words)):
                return None
            known = entity is not None and (noun or entity.superlative or entity.ordinal or text.startswith("was "))
            fits = [i for i in fits if self.world.is_loose(i)] or fits
            return self.names(fits) if known and fits else None
        fits = [i for i in self._others(things, match[0]) if stated.holds(i)]
        if stated.about == "place" and not negated:
            fits = [i for i in fits if self.world.is_loose(i)] or fits
        self.things = fits
        plain = _ADDING.sub("", f"{rest} ").strip() if not negated else rest
        if not fits and stated.about == "under":
            return f"nothing is {'in there' if plain == 'in' else plain}" + self._unsupported(plain.partition(" ")[2])
        if not fits and (not things or re.search(rf"{_BEST}|\b(?:is|are)\b", rest)):
            return None  # one is always the farthest: the words were not all used
        if not fits:
            kind = "nothing" if head in ("", "thing", "one", "ones") else f"none: no {_plain(head)}"
            return f"{kind} is {_plain(plain)}"
        if stated.about in ("place", "under") and len(fits) <= 3 and not re.search(rf"{_BEST}|^{_BESIDE} ", plain):
            return "; ".join(self._told(i, stated.about) for i in fits)
        return f"{self.names(fits)} {'is' if len(fits) == 1 else 'are'} {_plain(plain)}"

    def _unsupported(self, text: str) -> str:
        """Return ": " and where the thing that some words name is, if it stands on no other one."""
        things = [i for i in self.subject(text) or [] if self.world.below[i] is None]
        return "".join(f": {self._told(i, 'place')}" for i in things[:1])

    def count(self, match: re.Match[str]) -> str | None:
        """Say how many things fit a phrase, or how many there are of which something is so."""
        text = re.sub(r"\b(?:are|is) there\b|\b(?:do|can) (?:you|we|i) (?:see|have|count|find)\b", "", match[1]).strip()
        text = re.sub(r" (?:have|has|there|you have|got|exist|here|in total|altogether|overall)(?= |$)", "", text)
        if re.search(r"\b(?:would|could|if)\b", text):  # what is not so
            return None
        bare = re.match(r"(?:are|is|stand|lie|do|have)\b|$", text) is not None  # "how many are on the table?"
        text = f"things {text}" if bare else text
        found = self.split(text)
        entity, fits = (None, []) if found else self.refs(text)
        if found is None and (entity is None or Lattice(scan(text)).unknown):
            return None
        halved = self.in_half(text, found[0]) if found else None
        things = [i for i in found[0] if found[1].holds(i)] if found else fits
        things = things if halved is None else halved
        if bare:
            things = [i for i in things if self.world.is_loose(i)] or things
        over = re.fullmatch(
            rf"(?:(?:cubes|blocks|things|ones|of them|pieces) )?(?:{_BE} )*(?:on top of|on|above|over) (.*)", text
        )
        base = self.subject(over[1]) if over else None
        if base and len(base) == 1 and self.world.is_loose(base[0]):  # all of the tower above it
            x, y = self.world.things[base[0]].x, self.world.things[base[0]].y
            tower = self.world.column(x, y)
            things = tower[tower.index(base[0]) + 1 :] if base[0] in tower else []
        self.things = things = [i for i in things if i not in self.excepted]
        if not things:
            return f"none: no {_plain(f'{found[2]} {found[3]}' if found else text)}"
        noun = "is" if len(things) == 1 else "are"
        number = _NUMBERS[len(things)] if len(things) < len(_NUMBERS) else str(len(things))
        return f"there {noun} {number} ({len(things)}): {self.names(things)}"

    def listed(self, match: re.Match[str]) -> str | None:
        """Name all things of a kind: "which cubes are there?"."""
        self.things = self.subject(match[1]) or []
        if not self.things:
            return f"there is no {_plain(match[1])} here"
        return f"{'there is' if len(self.things) == 1 else 'there are'} {self.names(self.things)}"

    def where(self, match: re.Match[str]) -> str | None:
        """Say where something is."""
        things = self.subject(re.sub(r" (?:now|right now|gone to|gone|at|to|located|again|hidden)\b.*$", "", match[1]))
        if things is None:
            return None
        if not things:
            return f"there is no {_plain(match[1])} here"
        self.things = things
        return "; ".join(self._told(i, "place") for i in things[:3])

    def how(self, match: re.Match[str]) -> str | None:
        """Say how a container is and what it holds, in which position a device is, or where a loose thing is."""
        things = self.subject(match[1])
        if not things:
            return None
        self.things, boxes = things, [i for i in things if i in self.world.containers]
        told = [self._told(i, "state" if i in boxes or not self.world.is_loose(i) else "place") for i in things[:3]]
        return "; ".join([*told, *(self._told(i, "content") for i in boxes[:3])])

    def capacity(self, match: re.Match[str]) -> str | None:
        """Say how many things a container or the hand holds."""
        self.things = self.holders(match[1] or match[2] or "")
        return f"{self.names(self.things)} holds one thing at a time" if self.things else None

    def color(self, match: re.Match[str]) -> str | None:
        """Say which colour something has."""
        things = self.subject(re.sub(r" (?:have|has)$", "", match[1]))
        return "; ".join(self._told(i, "color") for i in things[:8]) if things else None

    def is_true(self, condition: str) -> bool | None:
        """Return whether a condition is so: "the drawer is open", "there is a green cube"; None if nobody can tell."""
        if worked := _WORKED.match(condition):
            done = self.done(worked)
            return done is not None and done.startswith("yes") != (worked["not"] is not None)
        negated = bool(re.search(r"\bnot\b", condition))
        plain = re.sub(r"\bnot ", "", condition)
        if re.match(r"(?:you|your gripper|gripper) .*\b(?:hold|holding|full|free|empty)\b", plain):
            return ((self.world.held is not None) != bool(re.search(r"\b(?:free|empty)\b", plain))) != negated
        if match := re.match(r"(?:there is|there are|you (?:see|find|can see|have(?! to\b))|we have) (.*)", plain):
            entity, things = self.refs(re.sub(r"\b(?:anything|something)\b", "thing", match[1]))
            self.planner.it = tuple(things[:1]) or self.planner.it
            return None if entity is None else bool(things) != negated
        found = self.split(plain)
        if found is None:
            return None
        things, stated, *_ = found
        self.things = things[:1] if len(things) < 4 else [i for i in things if stated.holds(i)][:1]
        self._described = "; ".join(self._told(i, stated.about) for i in self.things)
        if self.things and not re.match(rf"{_ANY}\b", plain):
            self.planner.it = (self.things[0],)
        return any(stated.holds(i) for i in things) != negated

    _described = ""

    def described(self) -> str:
        """Return what is so of the things of the last condition."""
        return self._described


def _kinds(plain: str) -> tuple[str, ...]:
    """Return the kinds of things that the name of a shape, or a noun with its article, means; () for other words."""
    shape = {"round": "round", "square": "cube", "cubic": "cube"}.get(plain)
    noun = plain.partition(" ")[2] if plain.startswith(("a ", "an ")) else ""
    kind = shape or next((kind for kind, names in nouns().items() if noun in names and kind != "thing"), None)
    return GROUPS.get(kind, (kind,)) if kind is not None else ()


def _with_nouns(text: str) -> str:
    """Return words with the first noun for each "one" after it: "cubes are left of the cyan one"."""
    kind = re.search(rf"\b({THING})\b", text)
    noun = kind[1].removesuffix("s") if kind else "one"
    return re.sub(rf"\b({COLOR}|\w+(?:most|est)) one\b", rf"\1 {noun}", text)


def _plain(text: str) -> str:
    """Return the words of a phrase without its article, and with those after prepositions."""
    plain = " ".join(token.text for token in scan(text) if token.text not in ("a", "an", "any", "some"))
    return re.sub(
        rf"\b(in|on|under|behind|near|to|of|inside|from) (?=(?:(?:{COLOR}) )?(?:{THING}|table|left|right|middle)\b)",
        r"\1 the ",
        plain,
    )
