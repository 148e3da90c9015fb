"""Answers to questions that choose one of some things: "which of them is closer to the wheel?", "who is further left?".

The things are those that are named, or of which was spoken last: "which of the two", "which one".
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable

from language.comparing import Comparisons
from language.normalise import spelling
from language.scanning import COLOR, THING
from language.world import WorldModel

_NOUN = r"(?:cube|block|brick|thing|object|item|container|device|box)s?"
_ITEM = rf"(?:(?:{COLOR})(?: (?:{_NOUN}|{THING}|ones?))?|drawer|fridge|button|lever|wheel)"
ITEMS = rf"{_ITEM}(?:(?: ,)? (?:(?:or|and|nor)(?: rather)?|,) {_ITEM})+"
_NUMBERS = {"two": 2, "three": 3, "four": 4, "both": 2}
GROUP = (
    r"(?:(?:(?:all|these|those|them|they|both|two|three|four|others?|rest|last|first)(?: of)? ?)+"
    rf"(?:\b(?:ones?|{_NOUN}|them|these|those|spoken of|mentioned))?)"
)
_MUCH = r"(?:(?:a|bit|little|much|even|now|then|actually|really|currently|right now|still|rather) )*"
_SIDES = {"left": "left", "right": "right", "back": "far", "front": "near"}
_SIDE = re.compile(
    r"(?:(?:more|most|farther|further|farthest|furthest|rather|far)(?: over| away| out)* )?(?:(?:to|on|at|towards?) )*"
    r"(?:my |your )?(?P<side>left|right|back|front)(?: ?most| hand side| side)?(?: one)?"
)
_FAR = re.compile(
    r"(?:(?P<near>(?:more )?(?:close|near)(?:r|er|st|est)?)"
    r"|(?P<far>(?:more |most )?(?:far(?:ther|thest)?|fur(?:ther|thest)|distant|away)))"
    r"(?: one)?(?: away| off| out)*(?: (?:(?:to|from|by) )?(?P<what>.+))?"
)
_HIGH = re.compile(r"(?P<how>higher|highest|lower|lowest)(?: up| down| one)*")
_IS = r"(?:is|are|was|stands?|lies|lie|sits?|would be|'s)"
_WHICH = (
    rf"(?:which|what|who)(?: (?P<noun>ones?|{_NOUN}))?(?: (?:out )?(?:of|from|among|between)(?: all)? "
    rf"(?P<among>{GROUP}|{ITEMS}))? {_IS} {_MUCH}"
)
_NOW = r"(?: now| at moment| right now)?"
_FORMS = tuple(
    re.compile(form)
    for form in (
        rf"{_WHICH}(?P<how>[^,:]+?){_NOW} [,:] (?P<names>(?:either )?(?:{ITEMS}))",
        rf"{_WHICH}(?P<how>.+?)(?<! to)(?<! from){_NOW}(?: (?P<names>(?:either )?(?:{ITEMS})))?",
        rf"{_IS} (?P<names>(?:{_ITEM}) or (?:{_ITEM})) {_MUCH}(?P<how>.+)",
    )
)


class Rankings(Comparisons):
    """Answers that choose one of some things; `language.questions.Questions` has the phrases that they need.

    compared: the other things of the last such answer, and what all were compared with.
    """

    compared: tuple[tuple[int, ...], tuple[int, ...]] = (), ()

    def ranked(self, match: re.Match[str]) -> str | None:
        """Say which of some things is nearest to another one, the leftmost or the highest."""
        asked = " ".join(map(spelling, match.string.split()))
        said = next(filter(None, (form.fullmatch(asked) for form in _FORMS)), None)
        if said is None:
            return None
        among = self._among(said.groupdict())
        value = self._value(said["how"]) if among else None
        if value is None or not among or len(among) < 2:
            return None
        key, anchors = value
        among = [i for i in among if i not in anchors]
        best = max(among, key=key, default=None)
        if best is None:
            return None
        self.things = [best]
        self.compared = tuple(i for i in among if i != best), tuple(anchors)
        return self._distances(among, anchors[0], best) if anchors else self._told(best, "place")

    def margin(self, match: re.Match[str]) -> str | None:
        """Say how much nearer the thing of the last comparison is than the next one: "by how much?"."""
        turn = next((turn for turn in reversed(self.turns[-2:]) if turn.beside and len(turn.about) > 1), None)
        if turn is None:
            return None
        things, (*rest, best) = self.world.things, turn.about
        x, y = things[turn.beside[0]].x, things[turn.beside[0]].y
        off = {i: math.hypot(things[i].x - x, things[i].y - y) for i in turn.about}
        other = min(rest, key=lambda i: abs(off[i] - off[best]))
        self.things, self.compared = [best], (tuple(rest), turn.beside)
        gap, unit = abs(off[other] - off[best]), "cells" if self.world.cells else "cm"
        told = self._distances([best, other], turn.beside[0], best)
        return f"by {gap if self.world.cells else 100 * gap:.0f} {unit}: {told}"

    def _distances(self, among: list[int], anchor: int, best: int) -> str:
        """Return how far some things are from another one, the chosen one first."""
        things, unit = self.world.things, "cells" if self.world.cells else "cm"
        scale = 1 if self.world.cells else 100
        x, y = things[anchor].x, things[anchor].y
        off = {i: scale * math.hypot(things[i].x - x, things[i].y - y) for i in among}
        rest = [f"{self.names([i])} {off[i]:.0f} {unit}" for i in among if i != best][:2]
        return f"{self.names([best])}: it is {off[best]:.0f} {unit} from {self.names([anchor])}, {' and '.join(rest)}"

    def _among(self, said: dict[str, str | None]) -> list[int] | None:
        """Return the things of which one is asked for; None if the question names none, and none were spoken of."""
        if said.get("names") or re.fullmatch(ITEMS, said.get("among") or ""):
            words = said.get("names") or said["among"] or ""
            return self._named(words.removeprefix("either "))
        noun, group = said.get("noun") or "", said.get("among") or ""
        if not group and noun not in ("one", "ones"):
            return None
        if re.search(r"\b(?:others?|rest)\b", group):
            one = self.world.held if self.world.held is not None else next(iter(self.planner.it), None)
            return [i for i in self._all(True) if i != one]
        number = next((_NUMBERS[word] for word in group.split() if word in _NUMBERS), 0)
        kinds = re.search(r"cube|block|brick", f"{noun} {group}") is not None
        return self.spoken_of(number, kinds or None, bool(group))

    def _named(self, words: str) -> list[int]:
        """Return the things of some names, loose ones first where only a colour is said."""
        found = []
        for part in re.split(r"(?: ,)? (?:or|and|nor|,)(?: (?:or|rather))? ", words):
            things = self.subject(f"{part} one" if re.fullmatch(COLOR, part) else part) or []
            found += things[:1]
        return list(dict.fromkeys(found))

    def spoken_of(self, number: int = 0, loose: bool | None = None, named: bool = True) -> list[int]:
        """Return the things of one kind of which was spoken last: so many, or those of the last turn that named some.

        loose: whether they can be moved; None: like the last one. named: if there are none, all are meant.
        """
        world, found = self.world, []
        for turn in reversed(self.turns):
            about = [i for i in (*reversed(turn.about), *turn.beside) if not world.things[i].target and i != world.hand]
            for i in about:
                loose = world.is_loose(i) if loose is None else loose
                if world.is_loose(i) == loose and i not in found:
                    found.append(i)
            if len(found) >= max(number, 2):
                break
        if number and len(found) >= number:
            return found[:number]
        return found if len(found) > 1 and not number else self._all(loose) if named else []

    def _all(self, loose: bool | None) -> list[int]:
        world = self.world
        things = [i for i, thing in enumerate(world.things) if not thing.target and i != world.hand]
        return [i for i in things if world.is_loose(i) == (loose is not False)]

    def _value(self, how: str) -> tuple[Callable[[int], float], list[int]] | None:
        """Return what makes a thing the one that is asked for, the more the better, and what it is compared with."""
        world: WorldModel = self.world
        how = re.sub(r"^(?:a )?(?:one )?(?:that |which )?(?:is )?", "", how)
        if side := _SIDE.fullmatch(how):
            if side["side"] in ("back", "front") and not re.match(r"more|far|fur|most", how):
                return None
            ux, uy = world.toward(_SIDES[side["side"]])
            return (lambda i: ux * world.things[i].x + uy * world.things[i].y), []
        if high := _HIGH.fullmatch(how):
            sign = 1 if high["how"].startswith("high") else -1
            return (lambda i: sign * world.things[i].bottom), []
        far = _FAR.fullmatch(how)
        if far is None or not re.search(r"er\b|est\b|more|most", how):
            return None
        sign, what = -1 if far["near"] else 1, far["what"] or "you"
        if re.fullmatch(r"(?:you|me|us|robot|arm|gripper|your (?:arm|base|gripper))", what):
            who = "me" if what in ("me", "us") else "you"
            return (lambda i: sign * self._off(i, who)), []
        anchors = (self.subject(what) or [])[:1]
        if not anchors:
            return None
        x, y = world.things[anchors[0]].x, world.things[anchors[0]].y
        return (lambda i: sign * math.hypot(world.things[i].x - x, world.things[i].y - y)), anchors
