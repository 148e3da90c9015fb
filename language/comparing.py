"""Answers to questions that compare things: distances, sizes, likeness and numbers."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import NamedTuple

from language.referents import thing_ref
from language.scanning import THING
from language.self_answers import SelfAnswers
from language.several import towers_of
from language.spots import extent, half_of, middle_of
from language.talk import sides_of

_HALF = r"(left|right)(?: hand)?(?: side| half| part)?(?: of table)?"
_LARGER = {
    **dict.fromkeys(("bigger", "larger", "wider", "taller", "longer", "biggest", "largest", "widest", "longest"), 1),
    **dict.fromkeys(("smaller", "littler", "narrower", "shorter", "smallest", "littlest", "tiniest", "narrowest"), -1),
}
_SIZE = "|".join(_LARGER)
_EQUAL = "big|large|small|wide|tall|high"
_ALIKE = {"color": "color", "colour": "color", "shape": "kind", "kind": "kind", "type": "kind", "thing": "kind"}
_SUPERLATIVE = re.compile(rf"(?P<how>(?:most )?\w+)(?: (?P<noun>{THING}|things?|objects?|devices?))?(?: (?P<of>.+))?")
_ALONE = re.compile(  # of what is in no stack
    r"(?:standing |lying |sitting |left |all )*(?:on (?:their|its) own|(?:all )?alone|by (?:itself|themselves)|single"
    r"|separate|unstacked|un ?stacked|nothing (?:on|on top|above)(?: of)?(?: (?:it|them))?"
    r" (?:and|or|nor) (?:nothing )?(?:under|below|underneath|beneath)(?: (?:it|them))?)"
)
_EVERYWHERE = r" (?:here|there|of all|of them|in room|on table|you (?:see|have)|one|ones)$"


class Predicate(NamedTuple):
    """What is stated of things.

    about: what an answer tells of each thing: "state", "content", "place", "color", "kind", "size", "under".
    holds: whether it is so of a thing; None: it is not the like of which this can be said.
    """

    holds: Callable[[int], bool | None]
    about: str


class Comparisons(SelfAnswers):
    """Answers that compare; `language.questions.Questions` has the phrases that they need."""

    def than(self, plain: str) -> Predicate | None:
        """Return the predicate of a comparison: "closer to the drawer than the red cube", "as big as the wheel"."""
        world = self.world
        if match := re.fullmatch(
            r"(nearer|closer|farther|further)(?: away)?(?: (?:to|from) (.*?))? than (.*?)(?: is)?", plain
        ):
            other, anchor = self.subject(match[3]), self.subject(match[2] or "")
            x, y = (world.things[anchor[0]].x, world.things[anchor[0]].y) if anchor else (0.0, 0.0)
            far = [math.hypot(thing.x - x, thing.y - y) for thing in world.things]
            sign = 1 if match[1] in ("nearer", "closer") else -1
            return Predicate(lambda i: sign * far[i] < sign * far[other[0]], "place") if other else None
        match = re.fullmatch(rf"(?:(?P<more>{_SIZE}) than|as (?:{_EQUAL}) as) (?P<what>.*)", plain)
        others = self.subject(match["what"]) if match else None
        if match is None or not others:
            return None
        size, sign = extent(world, others[0]), _LARGER.get(match["more"], 0)
        return Predicate(lambda i: (extent(world, i) > size) - (extent(world, i) < size) == sign, "size")

    def part(self, plain: str) -> Predicate | None:
        """Return the predicate of what is in a part of the table, or in one of several containers."""
        world = self.world
        if _ALONE.fullmatch(plain):
            standing = [i for i in range(len(world.things)) if world.is_on_ground(i) and world.above[i] is None]
            return Predicate(lambda i: i in standing if world.is_loose(i) else None, "place")
        if within := re.fullmatch(r"(?:in|inside)(?: of)? (.+? (?:and|or) .+)", plain):
            boxes = self.subject(re.sub(r"\b(and|or) (?:in|inside) ", r"\1 ", within[1])) or []
            if boxes and all(i in world.containers for i in boxes):
                return Predicate(lambda i: world.inside.get(i) in boxes if world.is_loose(i) else None, "place")
        side = re.fullmatch(rf"(?:on|at|to|in) (?:{_HALF}|(middle))", plain)
        if side is None or world.cells:
            return None
        across = side[1] or side[2]
        return Predicate(lambda i: sides_of(world, i)[0] == across if world.is_on_ground(i) else None, "place")

    def in_half(self, text: str, things: list[int]) -> list[int] | None:
        """Return those of some things that are in the half of the table that words end with; None for other words."""
        side = re.search(rf"\b(?:on|at|to|in) {_HALF}(?: now)?$", text)
        if side is None or self.world.cells:
            return None
        standing = [i for i in things if self.world.is_on_ground(i)]
        return [i for i in standing if half_of(self.world, [self.world.things[i]], (side[1],))]

    def nearer(self, match: re.Match[str]) -> str | None:
        """Say which of two a thing is nearer to, or farther from."""
        what, how, *others = match.groups()
        things, ends = self.subject(what), [self.subject(each) for each in others]
        if not things or not all(ends):
            return None
        thing, anchors = self.world.things[things[0]], [each[0] for each in ends if each]
        off = [math.dist((thing.x, thing.y), (self.world.things[i].x, self.world.things[i].y)) for i in anchors]
        best = off.index(min(off) if how in ("nearer", "closer") else max(off))
        near = [f"{each:.0f} cells" if self.world.cells else f"{100 * each:.0f} cm" for each in off]
        self.things = [anchors[best]]
        return (
            f"{'to' if how in ('nearer', 'closer') else 'from'} {self.names([anchors[best]])}: {near[best]} from "
            f"{self.names(things[:1])}, and {self.names([anchors[1 - best]])} is {near[1 - best]} from it"
        )

    def best(self, rest: str, noun: str) -> str | None:
        """Say which thing is the closest to something, the leftmost, the largest: "which cube is farthest from it?"."""
        match = _SUPERLATIVE.fullmatch(re.sub(_EVERYWHERE, "", rest))
        if match is None:
            return None
        noun = match["noun"] or ("thing" if noun in ("one", "ones") else noun)
        words = f"{noun} {match['how']} {match['of']}" if match["of"] else f"{match['how']} {noun}"
        entity, fits = self.refs(words)
        if entity is None or not (entity.superlative or entity.sides or entity.relations):
            return None
        if who := re.search(r"\b(me|us|you|robot)\b", rest):
            fits.sort(key=lambda i: self._off(i, who[1]), reverse="far" in rest or "fur" in rest)
        if not fits:
            return None
        if entity.superlative in ("largest", "smallest"):
            self.things = fits
            told = self._told(fits[0], "size")
            return told if len(fits) == 1 else f"{self.names(fits)} are equally large"
        self.things = fits = fits if noun.endswith("s") else fits[:1]
        return "; ".join(self._told(i, "place") for i in fits[:3])

    def middle(self, match: re.Match[str]) -> str | None:
        """Say which of an odd number of things is in the middle from left to right."""
        loose = [i for i in range(len(self.world.things)) if self.world.is_loose(i) and i not in self.world.inside]
        spoken = [i for i in self.planner.it if i in loose]
        things = spoken if len(spoken) > 2 else loose
        if len(things) % 2 == 0:
            return None
        self.things = [middle_of(self.world, [thing_ref(self.world, i) for i in things]).things[0]]
        return self._told(self.things[0], "place")

    def stacked(self, match: re.Match[str]) -> str:
        """Say which stacks there are."""
        stacks = towers_of(self.world)
        self.things = [i for stack in stacks for i in stack[::-1]]
        told = "; ".join(self.names(stack[::-1]) for stack in stacks)
        return f"yes: {told}, the upper first" if stacks else "no: nothing stands on another thing"

    def level(self, match: re.Match[str]) -> str | None:
        """Say which thing of the only stack is the lowest or the highest."""
        stacks = towers_of(self.world)
        if len(stacks) != 1:
            return None
        lowest = match[1] in ("lower", "lowest")
        self.things = [stacks[0][0 if lowest else -1]]
        return self._told(self.things[0], "under" if lowest else "place")

    def highest(self, match: re.Match[str]) -> str | None:
        """Say which stack is the highest, or the lowest."""
        stacks = towers_of(self.world)
        if not stacks:
            return "there is no stack"
        most = (min if re.search(r"lowest|smallest", match[0]) else max)(map(len, stacks))
        found = [stack for stack in stacks if len(stack) == most]
        self.things = [found[0][-1]]
        return "; ".join(f"that of {self.names(stack[::-1])}, which is {most} high" for stack in found)

    def larger(self, match: re.Match[str]) -> str | None:
        """Say which of some things is the larger or the smaller one."""
        things, sign = self.subject(match[2]), _LARGER[match[1]]
        if not things or len(things) < 2:
            return None
        sizes = [sign * extent(self.world, i) for i in things]
        self.things = best = [i for i, size in zip(things, sizes, strict=True) if size == max(sizes)]
        if len(best) == len(things):
            return f"{self.names(things)} are equally large"
        return f"{self.names(best)}: " + "; ".join(self._told(i, "size") for i in things[:3])

    def same(self, match: re.Match[str]) -> str | None:
        """Say whether things are alike in colour, size or kind."""
        things = self.subject(f"{match[1]} and {match[3]}" if match[3] else match[1])
        if not things or len(things) < 2:
            return None
        about = _ALIKE.get(match[2].rstrip("s"), "size")
        values = [extent(self.world, i) if about == "size" else getattr(self.world.things[i], about) for i in things]
        first = dict(zip(values[::-1], things[::-1], strict=True))
        self.things = list(first.values())[::-1][:3]
        if len(first) == 1:
            return f"yes: {self._told(things[0], about).replace(self.names(things[:1]), 'each')}"
        return "no: " + "; ".join(self._told(i, about) for i in self.things)

    def alike(self, match: re.Match[str]) -> str | None:
        """Say which things have the same colour, size or shape as another one: "are two cubes of the same colour?"."""
        things = self.subject(match[1]) or []
        about = _ALIKE.get(match[2].rstrip("s"), "size")
        value = lambda i: extent(self.world, i) if about == "size" else getattr(self.world.things[i], about)  # noqa: E731
        values = [value(i) for i in things]
        groups = [[i for i in things if value(i) == each] for each in dict.fromkeys(values) if values.count(each) > 1]
        self.things = [i for group in groups for i in group]
        told = "; ".join(f"{self.names(group)} are" for group in groups[:3])
        return f"yes: {told}" if groups else f"no: no two have the same {match[2]}"

    def palette(self, match: re.Match[str]) -> str | None:
        """Name the colours of the things that can be moved."""
        world = self.world
        self.things = [i for i, thing in enumerate(world.things) if world.is_loose(i) and not thing.target]
        return f"there are {self.names(self.things)}" if self.things else None

    def more(self, match: re.Match[str]) -> str | None:
        """Say whether there are more things of one kind than of another."""
        (one, few), (two, many) = (self.refs(match[i]) for i in (2, 3))
        if one is None or two is None:
            return None
        self.things = few
        yes = len(few) > len(many) if match[1] == "more" else len(few) < len(many)
        return f"{'yes' if yes else 'no'}: {len(few)} and {len(many)}"

    def far(self, match: re.Match[str]) -> str | None:
        """Say how far something is from something else, or from the robot."""
        one, _, other = re.sub(r" (?:away|apart|now)\b", "", match[1]).partition(" from ")
        one, other = one.partition(" and ")[::2] if " and " in one else (one, other)
        things = self.subject(one)
        rest = [] if re.search(r"\b(?:you|robot|gripper)\b", other) else self.subject(other)
        if not things or rest is None:
            return None
        x, y = (self.world.things[rest[0]].x, self.world.things[rest[0]].y) if rest else (0.0, 0.0)
        thing, unit = self.world.things[things[0]], " cells" if self.world.cells else " cm"
        away = math.hypot(thing.x - x, thing.y - y) * (1 if self.world.cells else 100)
        self.things = [things[0]]
        return f"{self.names(things[:1])} is {away:.0f}{unit} from {self.names(rest[:1]) if rest else 'my base'}"
