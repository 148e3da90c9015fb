"""Answers to questions about the world and about what was said and done."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from language.normalise import questions, scan
from language.outcomes import Plan, Question, Refusal, Signal
from language.planning import Planner
from language.talk import abilities, holds, listed, name, phrase, real, said, seen, state, where
from language.world import AT_END, WorldModel

_STATES = {"open": True, "opened": True, "closed": False, "shut": False, "ajar": True}
_PLACES = (
    "in on inside under below left right behind next near between "
    "above beneath underneath to at over closest nearest within beside touching"
)
_PLACING = frozenset(_PLACES.split())
_NUMBERS = ["no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve"]


class Questions:
    """Answers the questions of one sentence.

    Args:
        world: as it is.
        planner: resolves phrases in it.
        turns: what was said before and what came of it, oldest first.
        before: the world before the last plan, or None.
    """

    def __init__(self, world: WorldModel, planner: Planner, turns: Sequence[Any], before: WorldModel | None) -> None:
        self.world, self.planner, self.turns, self.before = world, planner, turns, before
        self.things: list[int] = []  # that were asked about

    def answer(self, asked: str) -> str | None:
        """Return the answer in a sentence; None if it is not known."""
        for kind, pattern in questions():
            if match := pattern.search(asked):
                part = _OF_PART.get(kind)
                text = getattr(self, kind.removesuffix("_of"))(_Words(match[0], part(match)) if part else match)
                if text:
                    return text[0].upper() + text[1:] + ("" if text[-1] in ".!?" else ".")
        return None

    def refs(self, text: str) -> tuple[Any, list[int]]:
        """Return the phrase in some words and the things that it fits."""
        entity, found = phrase(self.world, self.planner, scan(text))
        things = real(self.world, found)
        if entity is not None and entity.role == "target":
            things = [ref.things[-1] for ref in found if ref.things]
        self.things = things
        return entity, things

    def names(self, things: Sequence[int]) -> str:
        """Return the names of things, as in a sentence."""
        return listed([name(self.world, i) for i in things])

    # ---- Where, how many, which

    def where(self, match: re.Match[str]) -> str | None:
        """Say where something is."""
        entity, things = self.refs(match[1])
        if entity is None:
            return None
        if not things:
            return f"there is no {_words(match[1], entity)} here"
        return "; ".join(f"{name(self.world, i).split(' in ')[0]} is {where(self.world, i)}" for i in things[:3])

    def count(self, match: re.Match[str]) -> str | None:
        """Say how many things fit a phrase."""
        entity, things = self.refs(
            re.sub((r"\b(?:are|is) there\b|\b(?:do|can) (?:you|we|i) (?:see|have|count|find)\b"), "", match[1])
        )
        if entity is None:
            return None
        if not things:
            return f"none: there is no {_words(match[1], entity)}"
        noun = "is" if len(things) == 1 else "are"
        number = _NUMBERS[len(things)] if len(things) < len(_NUMBERS) else str(len(things))
        return f"there {noun} {number} ({len(things)}): {self.names(things)}"

    def which(self, match: re.Match[str]) -> str | None:
        """Name the things that fit a phrase."""
        text = match[1].strip()
        if text.split()[0] in _PLACING:
            text = f"thing {text}"
        under = re.search(r"\b(?:under|below|beneath|underneath)\b (.*)", text)
        if under:
            _, upper = self.refs(under[1])
            lower = [b for i in upper if (b := self.world.below[i]) is not None]
            return (
                (f"{self.names(lower)} is under {self.names(upper)}")
                if lower
                else f"nothing is under {self.names(upper)}"
                if upper
                else None
            )
        entity, things = self.refs(text)
        if entity is None:
            return None
        rest = " ".join(text.split()[1:])
        if not things:
            return f"nothing is {rest}" if text.startswith("thing") else f"none: no {_words(text, entity)} is there"
        things = [i for i in things if self.world.is_loose(i)] or things
        return (
            (f"{self.names(things)} {'is' if len(things) == 1 else 'are'} {rest}")
            if text.startswith("thing")
            else f"{self.names(things)}"
        )

    def color(self, match: re.Match[str]) -> str | None:
        """Say which colour something has."""
        _, things = self.refs(match[1])
        return "; ".join(f"it is {self.world.things[i].color}" for i in things[:1]) if things else None

    # ---- Yes or no

    def is_state(self, match: re.Match[str]) -> str | None:
        """Say whether a container is open, or a device moved."""
        text = match[1]
        if (
            re.search((r"\b(?:anything|something|any|all|everything|they|both|containers?|doors?)\b"), text)
            and self.world.containers
        ):
            is_open = [i for i in self.world.containers if i in self.world.open]
            return f"yes: {self.names(is_open)} is open" if is_open else "no: the drawer and the fridge are closed"
        _, things = self.refs(text)
        boxes = [i for i in things if i in self.world.containers] or things
        if not boxes:
            return None
        wanted = _STATES.get(match[2].split()[-1])
        if wanted is None or boxes[0] not in self.world.containers:
            return state(self.world, boxes[0])
        right = (boxes[0] in self.world.open) == wanted
        return f"{'yes' if right else 'no'}: {state(self.world, boxes[0])}"

    def fits(self, match: re.Match[str]) -> str | None:
        """Say whether something fits into a container."""
        _, things = self.refs(match[2])
        boxes = [i for i in things if i in self.world.containers]
        if not boxes:
            return None
        inside = self.world.contents(boxes[0])
        full = f"but {self.names(inside)} is in it" if inside else "and nothing is in it"
        return f"{'no' if inside else 'yes'}: one cube fits in {name(self.world, boxes[0])}, {full}"

    def is_empty(self, match: re.Match[str]) -> str | None:
        """Say whether a container, the hand or the gripper is empty."""
        wanted = match[2] == "empty"
        if re.search(r"\b(?:gripper|your hand|claw|you)\b", match[1]):
            return f"{'yes' if (self.world.held is None) == wanted else 'no'}: {holds(self.world)}"
        if re.search(r"\bmy hand\b", match[1]) and self.world.hand is not None:
            inside = self.world.contents(self.world.hand)
            return f"{'yes' if (not inside) == wanted else 'no'}: {self.names(inside)} is in your hand"
        if re.search(r"\btable\b", match[1]):
            return f"no: {seen(self.world)}"
        _, things = self.refs(match[1])
        boxes = [i for i in things if i in self.world.containers]
        if not boxes:
            return None
        inside = self.world.contents(boxes[0])
        what = f"{self.names(inside)} is in it" if inside else "nothing is in it"
        return f"{'yes' if (not inside) == wanted else 'no'}: {what}"

    def exists(self, match: re.Match[str]) -> str | None:
        """Say whether something of the kind is there."""
        text = match[1].strip()
        mine = re.search(
            (r"\b(?:something|anything|a cube|a block|any cube|nothing|what)\b.* (?:in|on) my (?:hand|palm)"), text
        )
        if (
            mine or re.fullmatch((r"(?:something|anything|a (?:cube|block)) (?:in|on) my (?:hand|palm)"), text)
        ) and self.world.hand is not None:
            inside = self.world.contents(self.world.hand)
            return f"yes: {self.names(inside)} is in your hand" if inside else "no: nothing is in your hand"
        text = re.sub(r"\b(?:anything|something|nothing)\b", "thing", text)
        entity, things = self.refs(text)
        if entity is None:
            return None
        if not things:
            plain = _words(text, entity)
            return (
                (f"no: nothing is {' '.join(text.split()[1:])}")
                if text.startswith("thing")
                else f"no: there is no {plain} here"
            )
        things = [i for i in things if self.world.is_loose(i)] or things
        return f"yes: {self.names(things)}"

    def is_there(self, match: re.Match[str]) -> str | None:
        """Say whether a thing is where a question says."""
        text = match[1].strip()
        words = text.split()
        for cut in range(2, len(words)):
            head, rest = " ".join(words[:cut]), " ".join(words[cut:])
            if words[cut] in (
                "in",
                "on",
                "under",
                "left",
                "right",
                "behind",
                "next",
                "near",
                "between",
                "inside",
                "above",
                "to",
                "at",
                "still",
                "beside",
                "within",
            ):
                _, things = self.refs(head)
                _, placed = self.refs(f"thing {rest}")
                if not things:
                    return f"no: there is no {head} here"
                here = f"{name(self.world, things[0]).split(' in ')[0]} is {where(self.world, things[0])}"
                fits = [i for i in things if i in placed] or (rest.startswith("on table") and "on the table" in here)
                self.things = things
                return f"{'yes' if fits else 'no'}: {here}"
        _, things = self.refs(text)
        return state(self.world, things[0]) if things else None

    # ---- The gripper and the person's hand

    def held(self, match: re.Match[str]) -> str | None:
        """Say what the gripper holds."""
        world = self.world
        if re.search(r"\bmy (?:hand|palm)\b|\bi (?:hold|have|holding)\b|am i\b", match[0]) and world.hand is not None:
            inside = world.contents(world.hand)
            return f"yes: {self.names(inside)} is in your hand" if inside else "no: nothing is in your hand"
        if re.match(r"(?:do|are|have|is|did)\b", match[0]):
            asked, things = self.refs(match[0])
            if asked is not None and (asked.colors or asked.noun) and "anything" not in match[0]:
                return f"{'yes' if world.held in things else 'no'}: {holds(world)}"
            return f"{'no: my gripper is empty, I hold nothing' if world.held is None else 'yes: ' + holds(world)}"
        return holds(world)

    # ---- What was said and done

    def _plans(self) -> list[tuple[Any, Plan]]:
        return [(turn, turn.outcome) for turn in self.turns if isinstance(turn.outcome, Plan) and turn.outcome.steps]

    def did(self, match: re.Match[str]) -> str | None:
        """Say what was done last, or where something was put."""
        plans = self._plans()
        into = re.search(r"\b(?:inside|in|into)\b(?: (.*))?$", match.string)
        if into:
            boxes = self.refs(into[1])[1] if into[1] and "there" not in into[1] else []
            for turn, plan in reversed(plans):
                for step in reversed(plan.steps):
                    if step.carries and step.goal is not None and (not boxes or step.goal in boxes):
                        return (
                            f"{name(turn.world, step.object).split(' in ')[0]}: I put it in "
                            f"{name(turn.world, step.goal)}"
                        )
            if boxes and (inside := self.world.contents(boxes[0])):
                return f"{self.names(inside)}"
            return None if plans else "I have done nothing yet"
        if not plans:
            return "I have done nothing yet"
        turn, plan = plans[-1]
        return f"I did this: {said(turn.world, plan.steps)}"

    def told(self, match: re.Match[str]) -> str | None:
        """Say what the person said before."""
        return f'you said: "{self.turns[-1].sentence}"' if self.turns else "you have said nothing before"

    def why(self, match: re.Match[str]) -> str | None:
        """Say why something was done or was not done."""
        if not self.turns:
            return "I have done nothing yet, because you have not asked for anything before"
        last = self.turns[-1]
        sentence = f'you said "{last.sentence}"'
        if isinstance(last.outcome, Refusal):
            return f"because I could not: {last.outcome.text}"
        if isinstance(last.outcome, Question):
            return f"because I had to ask: {last.outcome.text}"
        if isinstance(last.outcome, Signal):
            return f"because {sentence}"
        plans = self._plans()
        if plans:
            turn, plan = plans[-1]
            return f'because you said "{turn.sentence}": {said(turn.world, plan.steps)}'
        return f"because {sentence}"

    # ---- The robot

    def can(self, match: re.Match[str]) -> str | None:
        """Say what can be done."""
        return abilities(self.world)

    def see(self, match: re.Match[str]) -> str | None:
        """Say what there is."""
        return seen(self.world)

    def who(self, match: re.Match[str]) -> str | None:
        """Say what the robot is."""
        return f"I am a robot arm that does what you say and point at. {abilities(self.world)}"

    def fine(self, match: re.Match[str]) -> str | None:
        """Answer questions about the robot's condition."""
        return f"yes, I am ready. {holds(self.world)}"

    def language(self, match: re.Match[str]) -> str | None:
        """Say which language is understood."""
        return "I understand English: sentences about the things on the table"


def _words(text: str, entity: Any) -> str:
    """Return the words of a phrase."""
    tokens = [token.text for token in scan(text)]
    part = tokens[slice(*entity.span)] or tokens
    return " ".join(word for word in part if word not in ("a", "an", "any", "some"))


class _Words:
    """What a rule's function reads of its match: the whole and one part."""

    def __init__(self, whole: str, part: str) -> None:
        self._parts = whole, part

    def __getitem__(self, index: int) -> str:
        return self._parts[index]


_OF_PART = {  # kind of answer -> what it reads of a match
    "exists": lambda match: next(group for group in match.groups() if group is not None),
    "which": lambda match: f"{_noun(match[0])} {match[1]}".strip(),
    "which_of": lambda match: re.sub(r"\b(?:is|are|stands|lies|stand|lie|sits)\b ", "", match[1]),
}


def _noun(text: str) -> str:
    found = re.match(r"(?:what|which|who)(?: (cubes?|blocks?|things?|objects?|box|boxes|container|device))?", text)
    return (found and found[1]) or ""


def holds_true(condition: str, world: WorldModel, planner: Planner) -> bool | None:
    """Return whether a condition is so: "the drawer is open", "there is a green cube"; None if nobody can tell."""
    questions = Questions(world, planner, (), None)
    negated = bool(re.search(r"\bnot\b|\bn't\b", condition))
    plain = re.sub(r"\b(?:not|still|already|now|currently|happens to be|also)\b ?", "", condition).strip()
    if match := re.match(r"(?:there is|there are|you (?:see|find|can see|have(?! to\b))|we have) (.*)", plain):
        _, things = questions.refs(re.sub(r"\b(?:anything|something)\b", "thing", match[1]))
        planner.it = tuple(things[:1]) or planner.it
        return bool(things) != negated
    if match := re.match(
        (r"(.*?) (?:is|are|stands|was|has been) (open|opened|closed|shut|empty|full|pressed|up|down)\b"), plain
    ):
        boxes = list(planner.it) if re.fullmatch(r"it|that|this|they", match[1]) else questions.refs(match[1])[1]
        boxes = boxes or ([planner.box] if planner.box is not None else [])
        if not boxes:
            return None
        box, word = boxes[0], match[2]
        planner.it = (box,)
        if word in ("empty", "full"):
            return (bool(world.contents(box)) == (word == "full")) != negated
        if box in world.containers and word in _STATES:
            return ((box in world.open) == _STATES[word]) != negated
        return ((abs(world.moved.get(box, 0.0)) > AT_END) == (word in ("pressed", "down"))) != negated
    if match := re.match(r"you (?:hold|are holding) (.*)", plain):
        return (world.held is not None) != negated
    if match := re.match(r"(.*?) is ((?:in|on|under|next|left|right|behind|near)\b.*)", plain):
        return (set(questions.refs(match[1])[1]) & set(questions.refs(f"thing {match[2]}")[1]) != set()) != negated
    return None
