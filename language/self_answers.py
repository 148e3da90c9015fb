"""Answers about the robot itself: what it holds, did, was told and can do, and what a gesture shows."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

from language.lattice import Lattice
from language.outcomes import Plan, Question, Refusal, Signal
from language.planning import Planner
from language.scanning import scan
from language.talk import abilities, holds, name, said, seen
from language.verbs import KNOWN, Act
from language.viewpoint import whose_left
from language.world import WorldModel


class SelfAnswers(ABC):
    """Answers of the robot about itself; `language.questions.Questions` has the phrases that they need."""

    world: WorldModel
    planner: Planner
    turns: Sequence[Any]
    things: list[int]
    pointed: list[int]

    @abstractmethod
    def refs(self, text: str) -> tuple[Any, list[int]]:
        """Return the phrase in some words and the things that it fits."""

    @abstractmethod
    def subject(self, text: str) -> list[int] | None:
        """Return the things that a question is about; None if the words name none."""

    @abstractmethod
    def names(self, things: Sequence[int]) -> str:
        """Return the names of things, as in a sentence."""

    @abstractmethod
    def _told(self, index: int, about: str) -> str:
        """Return what is so of a thing."""

    # ---- The gripper and the person's hand

    def held(self, match: re.Match[str]) -> str | None:
        """Say what the gripper or the person's hand holds."""
        world = self.world
        if (
            re.search(r"\bmy (?:hand|palm)\b|\bi (?:hold|have|holding|got)\b|am i\b|have i\b", match.string)
            and world.hand is not None
        ):
            self.things = inside = world.contents(world.hand)
            return (
                f"yes: {self.names(inside).split(' in ')[0]} is in your hand"
                if inside
                else "no: nothing is in your hand"
            )
        self.things = [] if world.held is None else [world.held]
        if re.match(r"(?:do|are|have|is|did)\b", match[0]):
            asked, things = self.refs(match[0])
            yes = world.held in things if asked is not None and (asked.colors or asked.noun) else world.held is not None
            self.things = [] if world.held is None else [world.held]
            return f"{'yes' if yes else 'no'}: {holds(world)}"
        return holds(world)

    # ---- What was said and done

    def _plans(self) -> list[tuple[Any, Plan]]:
        return [(turn, turn.outcome) for turn in self.turns if isinstance(turn.outcome, Plan) and turn.outcome.steps]

    def did(self, match: re.Match[str]) -> str | None:
        """Say what was done last or first, or whether and where something was put."""
        plans, text = self._plans(), match.string
        entity, things = self.refs(text) if re.match(r"(?:did|have) ", text) else (None, [])
        if things and entity is not None and entity.kind == "thing" and (entity.noun or entity.colors):
            done = [turn for turn, plan in plans if any(step.object in things for step in plan.steps)]
            return f"{'yes' if done else 'no, I did not'}: {self._told(things[0], 'state')}"
        into = re.search(r"\b(?:inside|in|into)\b(?: (.*))?$", text)
        if into:
            boxes = self.refs(into[1])[1] if into[1] and "there" not in into[1] else []
            for turn, plan in reversed(plans):
                for step in reversed(plan.steps):
                    if step.carries and step.goal is not None and (not boxes or step.goal in boxes):
                        thing = name(turn.world, step.object).split(" in ")[0]
                        return f"{thing}: I put it in {name(turn.world, step.goal)}"
            if boxes and (inside := self.world.contents(boxes[0])):
                return f"{self.names(inside)}"
            return None if plans else "I have done nothing yet"
        if not plans:
            return "I have done nothing yet"
        turn, plan = plans[0 if re.search(r"\bfirst\b", text) else -1]
        return f"I did this: {said(turn.world, plan.steps)}"

    def marks(self, match: re.Match[str]) -> str | None:
        """Say what see-through things are for."""
        through = [i for i, thing in enumerate(self.world.things) if thing.target]
        if not through:
            return "nothing here is see-through"
        return f"a see-through thing marks a place to put things at, and cannot be taken: {self.names(through)}"

    def told(self, match: re.Match[str]) -> str | None:
        """Say what the person said before."""
        turn = self.turns[0 if re.search(r"\bfirst\b", match.string) else -1] if self.turns else None
        return f'you said: "{turn.sentence}"' if turn is not None else "you have said nothing before"

    def why(self, match: re.Match[str]) -> str | None:
        """Say why something was done or was not done."""
        if re.search(r"\b(?:one|only|two|fit|fits)\b.*\b(?:in|inside|into|on)\b", match.string):
            return f"because there is room for one thing in {self.names(self.world.containers)}, and on your hand"
        if so := re.match(r"why (?:is|are|was|were) (?!it\b|that\b|this\b|there\b|you\b)(.*)", match.string):
            entity, things = self.refs(so[1])
            if entity is not None and things:
                return self._cause(things[0])
        if not self.turns:
            return "I have done nothing yet, because you have not asked for anything before"
        last = self.turns[-1]
        sentence = f'you said "{last.sentence}"'
        if isinstance(last.outcome, Refusal):
            return f"because I could not: {last.outcome.text}"
        if isinstance(last.outcome, Question):
            return f"because I had to ask: {last.outcome.text}"
        plans = self._plans()
        if isinstance(last.outcome, Signal) or not plans:
            return f"because {sentence}"
        turn, plan = plans[-1]
        return f'because you said "{turn.sentence}": {said(turn.world, plan.steps)}'

    def _cause(self, index: int) -> str:
        """Return why a thing is where and how it is: what was said when it was moved last."""
        told = self._told(index, "state")
        for turn, plan in reversed(self._plans()):
            if any(step.object == index for step in plan.steps):
                return f'because you said "{turn.sentence}". Now {told}'
        return f"I have not moved it: from the start, {told}"

    def options(self, match: re.Match[str]) -> str | None:
        """Say what was asked last, or what can be done."""
        asked = next((turn.outcome for turn in reversed(self.turns) if isinstance(turn.outcome, Question)), None)
        return f"I asked: {asked.text} {self.names(asked.candidates)}" if asked is not None else abilities(self.world)

    def able(self, match: re.Match[str]) -> str | None:
        """Say whether something can be done here."""
        lattice, world = Lattice(scan(match[1])), self.world
        acts = {KNOWN[edge.value].act for edge in lattice.get(0, "verb")}
        if not acts or acts <= {Act.NEVER}:
            return None
        lacking = {Act.OPEN, Act.SHUT} if not world.containers else set()
        lacking |= {Act.OPERATE} if not world.devices else set()
        can = KNOWN[world.only].act in acts if world.only else bool(acts - lacking)
        return f"{'yes' if can else 'no'}: {abilities(world)}"

    def gripper(self, match: re.Match[str]) -> str | None:
        """Say where the gripper is."""
        plans = self._plans()
        last = f"; I was at {name(self.world, plans[-1][1].steps[-1].object)} last" if plans else ""
        return f"my gripper is over the table{last}. {holds(self.world)}"

    # ---- Gestures and sizes

    def shown(self, match: re.Match[str]) -> str | None:
        """Say what a gesture shows."""
        self.things = list(self.pointed[:1])
        return "; ".join(self._told(i, "state") for i in self.things) or "you point at nothing: click a thing"

    def tall(self, match: re.Match[str]) -> str | None:
        """Say how high a stack is, or how wide a thing is."""
        world = self.world
        tops = [i for i, below in enumerate(world.below) if below is not None and world.above[i] is None]
        if re.search(r"\b(?:stack|tower|pile)\b", match[1]):
            stacks = [world.column(world.things[i].x, world.things[i].y) for i in tops]
            self.things = max(stacks, key=len, default=[])
            return f"it is {len(self.things)} high: {self.names(self.things[::-1])}" if stacks else "there is no stack"
        things = self.subject(match[1])
        if not things:
            return None
        width = world.things[things[0]].width
        return f"{self.names(things[:1])} is {'a cell' if world.cells else f'{100 * width:.0f} cm'} wide"

    # ---- The robot

    def whose(self, match: re.Match[str]) -> str | None:
        """Say whose left is meant."""
        return whose_left(self.world.viewpoint)

    def can(self, match: re.Match[str]) -> str | None:
        """Say what can be done."""
        return abilities(self.world)

    def see(self, match: re.Match[str]) -> str | None:
        """Say what there is."""
        return seen(self.world)

    def who(self, match: re.Match[str]) -> str | None:
        """Say what the robot is, or what a gesture shows."""
        if self.pointed and re.match(r"(?:who|what) (?:is|are) (?:this|that|it)\b", match.string):
            return self.shown(match)
        return f"I am a robot arm that does what you say and point at. {abilities(self.world)}"

    def fine(self, match: re.Match[str]) -> str | None:
        """Answer questions about the robot's condition."""
        return f"yes, I am ready. {holds(self.world)}"

    def language(self, match: re.Match[str]) -> str | None:
        """Say which language is understood."""
        return "I understand English: sentences about the things on the table"
