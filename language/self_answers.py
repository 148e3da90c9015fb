"""Answers about the robot itself: what it holds, did, was told and can do, and what a gesture shows."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

from language.lattice import Lattice
from language.objects import DEVICES
from language.outcomes import Answer, Plan, Question, Refusal, Signal
from language.planning import Planner
from language.recalling import acts_of, is_done
from language.revising import tells
from language.scanning import scan
from language.several import towers_of
from language.spots import is_elsewhere, is_operated, on_ground
from language.steps import allows
from language.talk import abilities, holds, name, said, seen, where
from language.verbs import DEVICE_VERBS, KNOWN, Act
from language.viewpoint import whose_left
from language.words import GROUPS, NUMBERS
from language.world import WorldModel

_DEED = re.compile(
    r"(?:did|have) (?:you|we|i) (?:already |just |ever |really |even )*(?P<verb>\w+(?: (?:up|down|out|off))?)"
    r"(?P<given> (?:me|us))? (?P<what>.+?)(?: yet| already| before| again| up| down| away| back)*$"
)
_CHOICES = re.compile(  # after a question that offers some things
    r"(?:what|which)(?: ones?| cubes?| blocks?| things?| colou?rs?| choices?| options?)?(?: else)?"
    r" (?:do|have|did|can) (?:you|we|i)(?: have| got| offer| choose(?: from)?| mean| pick(?: from)?)*"
    r"(?: there| here| then)*"
)
_MORE = re.compile(
    r"\b(?:doing|made|worth|used|standing|sitting|lying|resting|\w+(?:est|most))\b| (?:on|in|under|to|of|at|for)$"
)


class SelfAnswers(ABC):
    """Answers of the robot about itself; `language.questions.Questions` has the phrases that they need."""

    world: WorldModel
    planner: Planner
    turns: Sequence[Any]
    things: list[int]
    pointed: list[int]
    excepted: list[int]
    body: str

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
        asked = next((turn.outcome for turn in self.turns[-1:] if isinstance(turn.outcome, Question)), None)
        if asked is not None and asked.candidates and _CHOICES.fullmatch(match.string):
            self.things = list(asked.candidates)
            return f"I asked about {self.names(self.things)}"
        mine = re.search(r"\bmy (?:hand|palm)\b|\bi (?:hold|have|holding|got)\b|am i\b|have i\b", match.string)
        if mine and world.hand is not None:
            self.things = inside = world.contents(world.hand)
            told = f"{self.names(inside).split(' in ')[0] if inside else 'nothing'} is in your hand"
            asked_what = re.match(r"(?:what|which|who)\b", match[0])
            return told if asked_what else f"{'yes' if inside else 'no'}: {told}"
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

    def account(self) -> str:
        """Return what was done last, how far that came, and how the thing is now that it was done with."""
        plans = self._plans()
        if not plans:
            return "I have done nothing yet"
        turn, plan = plans[-1]
        asked = [step for step in plan.steps if not step.implied] or plan.steps
        self.things = [asked[-1].object]
        told = turn.ending or f"I did this: {said(turn.world, plan.steps)}"
        if asked[-1].act is Act.TOUCH:
            return told
        held = self.world.held is not None
        now = holds(self.world) if held else self._told(self.things[0], "state")
        return f"{told}. {'' if held else 'Now '}{now}"

    def origin(self, match: re.Match[str]) -> str | None:
        """Say where something was before it was moved last."""
        things = self.refs(next(filter(None, match.groups())))[1][:1]
        for turn, plan in reversed(self._plans()):
            if any(step.object in things for step in plan.steps):
                self.things = things
                return f"{name(turn.world, things[0]).split(' in ')[0]} was {where(turn.world, things[0])}"
        return self._told(things[0], "place") if things else None

    def shifted(self, match: re.Match[str]) -> str | None:
        """Say how far something is from where it was before it was moved last."""
        things = self.refs(match[1])[1][:1]
        turn = next(
            (turn for turn, plan in reversed(self._plans()) if any(s.object in things for s in plan.steps)), None
        )
        if turn is None:
            return f"I have not moved {self.names(things)}" if things else None
        self.things, (old, new) = things, (world.things[things[0]] for world in (turn.world, self.world))
        moved = math.hypot(new.x - old.x, new.y - old.y)
        return f"by {moved:.0f} cells" if self.world.cells else f"by {100 * moved:.0f} cm"

    def holders(self, text: str) -> list[int]:
        """Return the containers and the person's hand that words name; all of them if the words name none."""
        boxes = [i for i in (*self.world.containers, self.world.hand) if i is not None]
        return [i for i in self.refs(text)[1] if i in boxes] or boxes

    def vacancy(self, match: re.Match[str]) -> str | None:
        """Say whether there is room for a thing in a container or in the person's hand."""
        self.things = self.holders(match[1] or "it")
        full = [i for i in self.things if self.world.contents(i)]
        if not self.things or not full:
            return f"yes: nothing is in {self.names(self.things)}" if self.things else None
        return f"no: {self.names([i for box in full for i in self.world.contents(box)])}, and one thing fits"

    def bears(self, match: re.Match[str]) -> str | None:
        """Say whether another thing can stand on one."""
        self.things = things = [i for i in self.refs(match[1])[1] if self.world.is_loose(i)][:1]
        if not things or self.world.cells:
            return None
        upper, below = self.world.above[things[0]], self.world.below[things[0]]
        if upper is None and below is None:
            return f"yes: nothing stands on {name(self.world, things[0])}"
        stands = (upper, things[0]) if upper is not None else (things[0], below)
        told = " stands on ".join(name(self.world, i) for i in stands if i is not None)
        return f"no: {told}, and nothing goes on two"

    def did(self, match: re.Match[str]) -> str | None:
        """Say what was done last or first, how often, or whether and where something was put."""
        plans, text = self._plans(), match.string
        if not plans and self.world.held is not None and re.search(r"\b(?:pick|lift|grab|take|took|got|taken)", text):
            return holds(self.world)
        asked = _DEED.match(text)
        entity, things = self.refs(asked["what"]) if asked else (None, [])
        if asked and things and entity is not None and (entity.kind == "it" or entity.noun or entity.colors):
            acts = acts_of(asked["verb"])
            if not {Act.OPEN, Act.SHUT, Act.OPERATE, Act.TOUCH} & set(acts):
                things = [i for i in things if self.world.is_loose(i)] or things  # "did you put the red one away?"
            steps = [step for _, plan in plans for step in plan.steps if step.object in things]
            steps = [step for step in steps if not asked["given"] or step.goal == self.world.hand]
            done = any(is_done(step, acts) for step in steps) if acts else bool(steps)
            return f"{'yes' if done else 'no, I did not'}: {self._told(things[0], 'state')}"
        told = "; then ".join(said(turn.world, plan.steps) for turn, plan in plans)
        if text.startswith("how many"):
            number = "one thing" if len(plans) == 1 else f"{len(plans)} things"
            return f"I did {number}: {told}" if plans else "I have done nothing yet"
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
            where = f"in {self.names(boxes)}" if boxes else "in there"
            return f"nothing: I have put nothing {where}" if plans else "I have done nothing yet"
        several = re.search(r"\b(?:so far|all|everything|until now|up to now|altogether)\b", text)
        if several and plans:
            return f"I did this: {told}"
        last = re.match(r"(?:which|what) \w+ (?:.*\b)?last$", text)
        if last and plans and len(plans[-1][1].steps) > 1:
            self.things = [plans[-1][1].steps[-1].object]
            return self.names(self.things)
        if len(plans) > 1 and re.match(r"which (?:ones|cubes|blocks|things)\b", text):
            steps = [step for _, plan in plans for step in plan.steps if step.carries and not step.implied]
            self.things = list(dict.fromkeys(step.object for step in steps)) or self.things
            return self.names(self.things) if steps else self.account()
        if len(plans) > 1 and (earlier := re.search(r"\b(?:first|before)\b", text)):
            turn, plan = plans[0 if earlier[0] == "first" else -2]
            return f"I did this: {said(turn.world, plan.steps)}"
        return self.account()

    def touched(self, match: re.Match[str]) -> str | None:
        """Name the loose things with which something was done, or nothing."""
        done = {step.object for _, plan in self._plans() for step in plan.steps}
        left = re.search(r"\bnot\b|\bnever\b| un\w+", match[0]) is not None
        loose = [i for i in range(len(self.world.things)) if self.world.is_loose(i)]
        self.things = [i for i in loose if (i in done) != left]
        return self.names(self.things) if self.things else "none"

    def untouched(self, match: re.Match[str]) -> str | None:
        """Say whether a thing was left where it was."""
        things = self.subject(match[1]) or []
        moved = [i for i in things if any(step.object == i for _, plan in self._plans() for step in plan.steps)]
        if not things:
            return None
        return f"no, I moved {self.names(moved)}" if moved else f"yes: I have not moved {self.names(things)}"

    def switched(self, match: re.Match[str]) -> str | None:
        """Say whether a device is on or off."""
        self.things = [i for i in self.refs(match[1])[1] if i in self.world.devices][:1]
        if not self.things:
            return None
        return f"{'on' if is_operated(self.world, self.things[0]) else 'off'}: {self._told(self.things[0], 'state')}"

    def left_over(self, match: re.Match[str]) -> str | None:
        """Name the things that stand alone on the table and that no plan was about, or count them."""
        used = {i for _, plan in self._plans() for step in plan.steps for i in (step.object, step.goal)}
        stacked = {i for stack in towers_of(self.world) for i in stack}
        self.things = [i for i in on_ground(self.world) if i not in used | stacked]
        named = self.names(self.things) if self.things else "none"
        return f"{len(self.things)}: {named}" if match[0].startswith("how many") and self.things else named

    def upcoming(self, match: re.Match[str]) -> str | None:
        """Say what is done next: nothing of its own accord."""
        return "nothing more: I have done what you asked for. Say what I shall do next"

    def done(self, match: re.Match[str]) -> str | None:
        """Say whether what was asked for last has been done, or whether a thing that was moved has fallen since."""
        plans, text = self._plans(), match.string
        told = self.account()
        if not plans:
            return f"no: {told}"
        turn, plan = plans[-1]
        acts = {KNOWN[edge.value].act for i in range(1, 5) for edge in Lattice(scan(text)).get(i, "verb")}
        acts &= {Act.OPEN, Act.SHUT}
        if acts:
            box = next((i for i in (*self.things, self.planner.box) if i in self.world.containers), None)
            shut = next((step for _, each in reversed(plans) for step in each.steps if step.object == box), None)
            yes = "yes" if shut and shut.act in acts else "no"
            return None if box is None else f"{yes}: {self._told(box, 'state')}"
        after = plan.result or self.world
        fell = bool(turn.ending) or any(
            self.world.is_loose(i) and i != self.world.held and (i == after.held or is_elsewhere(self.world, after, i))
            for i in {step.object for step in plan.steps}
        )
        asks_fall = re.search(
            r"\b(?:fall|fell|fallen|drop|dropped|slip|slipped|tip|tipped|lose|miss|missed|break)\b", text
        )
        return f"{'yes' if fell == bool(asks_fall) else 'no'}: {told}"

    def harm(self, match: re.Match[str]) -> str | None:
        """Say whether something was broken or dropped, as far as the robot can tell."""
        if any(turn.ending for turn, _ in self._plans()):
            return self.account()
        return f"not that I know. {holds(self.world)}" if self._plans() else "not that I know: I have done nothing yet"

    def marks(self, match: re.Match[str]) -> str | None:
        """Say what see-through things are for."""
        through = [i for i, thing in enumerate(self.world.things) if thing.target]
        if not through:
            return "nothing here is see-through"
        return f"a see-through thing marks a place to put things at, and cannot be taken: {self.names(through)}"

    def told(self, match: re.Match[str]) -> str | None:
        """Say what the person said before."""
        asked = [turn for turn in self.turns if not isinstance(turn.outcome, Answer)] if "ask" in match.string else []
        turns = asked or self.turns
        turn = turns[0 if re.search(r"\bfirst\b", match.string) else -1] if turns else None
        return f'you said: "{turn.sentence}"' if turn is not None else "you have said nothing before"

    def why(self, match: re.Match[str]) -> str | None:
        """Say why something was done or was not done."""
        if re.search(r"\b(?:one|only|two|fit|fits)\b.*\b(?:in|inside|into|on)\b", match.string):
            return f"because there is room for one thing in {self.names(self.world.containers)}, and on your hand"
        if so := re.match(r"why (?:is|are|was|were) (?!it\b|that\b|this\b|there\b|you\b)(.*)", match.string):
            entity, things = self.refs(re.sub(r" (?:open|closed|shut|empty|full|up|down)$", "", so[1]))
            if entity is not None and things:
                return self._cause(things[0])
        plans = self._plans()
        if plans and (
            plans[-1][0].ending or re.search(r"\b(?:fail|wrong|not (?:work|do|get|take|move|go))\b", match.string)
        ):
            return self.account()
        if not self.turns:
            return "I have done nothing yet, because you have not asked for anything before"
        last = self.turns[-1]
        sentence = f'you said "{last.sentence}"'
        if isinstance(last.outcome, Refusal):
            return f"because I could not: {last.outcome.text}"
        if isinstance(last.outcome, Question):
            return f"because I had to ask: {last.outcome.text}"
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
        if not acts:
            return None
        devices = {edge.value for i in range(len(lattice)) for edge in lattice.get(i, "noun")} & {*DEVICES}
        if acts <= {Act.NEVER} or (Act.NEVER in acts and not devices):
            return f"no, I cannot {match[1]}: no arm of this kind does that"
        lacking = {Act.OPEN, Act.SHUT} if not world.containers else set()
        lacking |= {Act.OPERATE} if not world.devices else set()
        can = KNOWN[world.only].act in acts if world.only else bool(acts - lacking)
        return f"{'yes' if can else 'no'}: {abilities(world)}"

    def gripper(self, match: re.Match[str]) -> str | None:
        """Say where the gripper is."""
        plans = self._plans()
        last = f"; I was at {name(self.world, plans[-1][1].steps[-1].object)} last" if plans else ""
        return f"my gripper is over the table{last}. {holds(self.world)}"

    # ---- Gestures, names, shapes and sizes

    def named(self, match: re.Match[str]) -> str | None:
        """Say which thing fits a phrase: "what is that red thing in front of me?"."""
        if self.pointed:
            return self.shown(match)
        near = re.search(r"(?: right| just)? (?:in front of|before|near|next to|close to) (me|us|you)\b", match[1])
        text = match[1].replace(near[0], "") if near else match[1]
        text = re.sub(
            r"(?: right| over| up| down| out| sticking| standing| lying| sitting)* ?(?:here|there|up)?$", "", text
        )
        entity, things = self.refs(text)
        if entity is None or not things or not tells(entity) or entity.superlative or _MORE.search(text):
            return None
        if near:
            things = sorted(things, key=lambda i: self._off(i, near[1]))[:1]
        self.things = things
        return f"{'that is' if len(things) == 1 else 'those are'} {self.names(things)}"

    def _off(self, index: int, who: str) -> float:
        """Return how far a thing is from the robot, or from the person, who is opposite."""
        thing, (_, x1, y0, y1) = self.world.things[index], self.world.bounds
        x = 0.0 if who in ("you", "robot") else 2 * x1 if not self.world.cells else x1
        return math.hypot(thing.x - x, thing.y - (y0 + y1) / 2)

    def purpose(self, match: re.Match[str]) -> str | None:
        """Say what can be done with a thing: "what is the lever for?"."""
        world = self.world
        entity, things = self.refs(next(filter(None, match.groups())))
        if self.pointed and entity is not None and entity.kind == "it":
            things = list(self.pointed)
        several, self.things = len(things) > 1, things[:1]
        if entity is None or not things:
            return None
        kind = world.things[things[0]].kind
        thing = f"a {kind}" if several else name(world, things[0])
        if world.things[things[0]].target:
            return self.marks(match)
        if things[0] in world.containers:
            return f"{thing} can be opened and closed, and one thing fits in it"
        verb = next((verb for verb, noun in DEVICE_VERBS.items() if noun == kind), None)
        if verb is not None:
            said_now = KNOWN[verb].templates[0].replace("{object}", thing)
            return f"I can {said_now}, and nothing else happens then: say {said_now!r}"
        more = "" if world.only else ", and put it somewhere or on another one"
        return f"I can {world.only or 'pick up'} {thing}{more}"

    def shape(self, match: re.Match[str]) -> str | None:
        """Say which shape things have."""
        kinds = [(i, self.world.things[i].kind) for i in (self.subject(match[1]) or [])[:3]]
        round_ = GROUPS["round"]
        told = (f"{self.names([i])} is a {kind}, {'' if kind in round_ else 'not '}round" for i, kind in kinds)
        return "; ".join(told) or None

    def shown(self, match: re.Match[str]) -> str | None:
        """Say what a gesture shows."""
        self.things = list(self.pointed[:1])
        return "; ".join(self._told(i, "state") for i in self.things) or "you point at nothing: click a thing"

    def tall(self, match: re.Match[str]) -> str | None:
        """Say how high a stack is, or how wide a thing is."""
        stacks = towers_of(self.world)
        if re.search(r"\b(?:stack|tower|pile)\b", match[1]) or (
            stacks and re.fullmatch(r"(?:it|that|this)(?: now)?", match[1])
        ):
            spoken = [stack for stack in stacks if {*stack} & {*self.planner.it}]
            highest: tuple[int, ...] = max(spoken or stacks, key=len, default=())
            self.things = list(highest)
            return f"it is {len(self.things)} high: {self.names(self.things[::-1])}" if stacks else "there is no stack"
        things = self.subject(match[1])
        if not things:
            return None
        self.things = things[:1]
        return self._told(things[0], "size")

    def as_tall(self, match: re.Match[str]) -> str | None:
        """Say whether a stack has so many things."""
        told = self.tall(match)
        wanted = NUMBERS.get(match[2])
        return told and f"{'yes' if len(self.things) == wanted else 'no'}: {told}"

    # ---- The robot

    def whose(self, match: re.Match[str]) -> str | None:
        """Say whose left is meant."""
        return whose_left(self.world.viewpoint)

    def can(self, match: re.Match[str]) -> str | None:
        """Say what can be done."""
        return abilities(self.world)

    def see(self, match: re.Match[str]) -> str | None:
        """Say what there is."""
        if self.excepted:
            world = self.world
            left_out = (world.hand, *self.excepted)
            left = [i for i, thing in enumerate(world.things) if not thing.target and i not in left_out]
            loose = [i for i in on_ground(world) if i in left]
            return f"I see {self.names(loose or left)}"
        return seen(self.world, on_table=re.search(r"\bon (?:table|desk|board|workspace)\b", match.string) is not None)

    def who(self, match: re.Match[str]) -> str | None:
        """Say what the robot is, or what a gesture shows."""
        if self.pointed and re.match(r"(?:who|what) (?:is|are) (?:this|that|it)\b", match.string):
            return self.shown(match)
        return f"I am {self.body}, and do what you say and point at. {abilities(self.world)}"

    def allowed(self, match: re.Match[str]) -> str | None:
        """Name the things with which something can be done: "which things can you open?"."""
        acts = {KNOWN[edge.value].act for edge in Lattice(scan(match[1])).get(0, "verb")}
        if not acts or acts & {Act.NEVER} == acts:
            return None
        acts = acts & {Act.OPEN, Act.SHUT, Act.OPERATE} or acts
        things = [i for i, thing in enumerate(self.world.things) if not thing.target]
        self.things = [i for i in things if any(allows(self.world, act, i) for act in acts - {Act.NEVER})]
        return f"I can {match[1]} {self.names(self.things)}" if self.things else f"there is nothing here to {match[1]}"

    def at_once(self, match: re.Match[str]) -> str | None:
        """Say that one thing is done after the other."""
        return "no: my gripper takes one thing at a time, and I do one thing after the other"

    def heights(self, match: re.Match[str]) -> str | None:
        """Say how high things are lifted and stacked."""
        if self.world.only:
            return f"I only {self.world.only} things here, and lift nothing"
        flat = "put one cube on another, and nothing on top of that"
        most = flat if self.world.flat_only else "stack as high as I reach"
        return f"I carry things at one height, just over the others, and {most}"

    def stuck(self, match: re.Match[str]) -> str | None:
        """Say whether the arm is stuck, and how far the last plan came."""
        plans = self._plans()
        going = plans and plans[-1][0].ending
        return f"no: {self.account() if going else f'I am ready. {holds(self.world)}'}"

    def taste(self, match: re.Match[str]) -> str | None:
        """Say that the robot likes no thing better than another."""
        return "I have no favourite, and like all of them alike: say which one you mean"

    def fine(self, match: re.Match[str]) -> str | None:
        """Answer questions about the robot's condition."""
        return f"yes, I am ready. {holds(self.world)}"

    def language(self, match: re.Match[str]) -> str | None:
        """Say which language is understood."""
        return "I understand English: sentences about the things on the table"
