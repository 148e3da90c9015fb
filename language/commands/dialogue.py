"""Dialogues: replies, corrections, "again", "undo" and "it" refer to what was said and done before."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from language.commands import costs
from language.commands.choosing import Choice, Choices, choices, result
from language.commands.gestures import Pointed, gestures
from language.commands.interpreting import refused, settled, unreadable
from language.commands.meanings import Entity, Gesture, Reading, Relation
from language.commands.naming import examples, name
from language.commands.outcomes import CONTROLS, Action, Outcome, Question, Refusal, Understood
from language.commands.planning import Planner
from language.commands.plans import Plan
from language.commands.precise import precise_plan
from language.commands.replies import revised
from language.commands.verb_words import CONTROLS as CONTROL_WORDS
from language.commands.world import World, table
from language.errors import NotUnderstood
from language.objects import Scene

ASKS = re.compile(
    r"\W*((who|what|why|how)('?s|'re)?\s+(?!about\b)|help\W*$)", re.IGNORECASE
)  # "what about the red one?" corrects
TO_DO = {"again": "repeat"}
SAME = 0.3  # of the distance between neighbours: a thing that moved less was only brushed


@dataclass
class Dialogue:
    """What was said and done.

    world: the scene after the last outcome. before: the scene before it. last: its reading. outcome: the last one.
    history: the outcomes, oldest first. it: the things that were spoken of last.
    surroundings: further fields of `World` for every scene, such as `bounds` and `little`.
    """

    world: World | None = None
    before: World | None = None
    last: Reading | None = None
    outcome: Outcome | None = None
    it: tuple[int, ...] = ()
    history: list[Outcome] = field(default_factory=list)
    surroundings: dict[str, Any] = field(default_factory=dict)

    def answer(self, sentence: str, scene: Scene | World | None = None, pointed: Pointed = ()) -> Outcome:
        """Returns the outcome of a sentence and remembers it.

        Args:
            sentence: as a person writes it.
            scene: None: the scene after the last outcome.
            pointed: what gestures show, in the order of the words that need one: indices of objects, several for a
                gesture that may show either, or a `Gesture`.

        Raises:
            LanguageError: `pointed` has an index that the scene lacks.
        """
        world = table(scene, **self.surroundings) if isinstance(scene, Scene) else scene or self.world
        if world is None:
            raise ValueError("the first sentence of a dialogue needs a scene")
        made = gestures(pointed, world)
        try:
            outcome = self._answer(sentence, world, scene if isinstance(scene, Scene) else None, made)
        except NotUnderstood as error:
            outcome = Refusal(sentence, span=(0, len(sentence)), text=str(error), suggestions=examples(world))
        self._remember(outcome, world)
        return outcome

    def _remember(self, outcome: Outcome, world: World) -> None:
        self.history.append(outcome)
        if isinstance(outcome, Understood) and not (outcome.steps and outcome.steps[0].kind in CONTROLS):
            self.before, self.world = world, outcome.result
            self.last = outcome.reading or self.last
            self.it = tuple(a.object for a in outcome.steps if a.object is not None)[-1:] or self.it
        elif isinstance(outcome, Question):
            self.before = self.world = world
            self.last = outcome.choices[0].reading if outcome.choices else outcome.reading or self.last
        else:
            self.world = world
        self.outcome = outcome

    def _answer(self, sentence: str, world: World, scene: Scene | None, made: tuple[Gesture, ...]) -> Outcome:
        if ASKS.match(sentence):
            text = "I carry out commands and answer no questions; say what to take and where to put it"
            return Refusal(sentence, span=(0, len(sentence)), text=text, suggestions=examples(world))
        planner = Planner(world, self.it, self.it, gestures=made)
        found = choices(sentence, planner)
        likeliest = min(found.readings, key=lambda reading: reading.cost, default=None)
        exact = None if scene is None else precise_plan(sentence, scene, world, _certain(made))
        if exact is not None and not _shifts(found):
            return self._exact(sentence, exact, found, world)
        if likeliest is not None and likeliest.cost <= costs.TOO_MUCH:
            first = likeliest.steps[0]
            if len(likeliest.steps) == 1 and first.action in CONTROL_WORDS:
                return self._control(sentence, first.action, world, found)
            if likeliest.rejects or (first.action == "fragment" and len(likeliest.steps) == 1):
                return self._reply(sentence, likeliest, found, world)
        return settled(sentence, found, planner)

    def _exact(self, sentence: str, plan: Plan, found: Choices, world: World) -> Outcome:
        """Returns the outcome of a plan of the precise grammar, with the wide grammar's reading where both agree."""
        if plan.failure:
            return refused(sentence, found._replace(failed=[Choice(Reading(()), plan, 0.0)]), world)
        agreed = next((c for c in found.possible if result(c.plan) == result(plan)), None)
        reading = agreed.reading if agreed else None
        return Understood(sentence, 1.0, (), (0, len(sentence)), plan.actions, plan.world, reading)

    def _control(self, sentence: str, action: str, world: World, found: Choices) -> Outcome:
        if action in CONTROLS:
            return Understood(sentence, 1.0, (), (0, len(sentence)), (Action(action),), world)
        if action == "undo" and self.before is not None and isinstance(self._done(), Understood):
            steps = restoring(world, self.before)
            return Understood(sentence, 1.0, (), (0, len(sentence)), steps, self.before, self.last)
        if action == "again" and self.last is not None and isinstance(self._done(), Understood):
            planner = Planner(world, self.it, self.it)
            repeated = replace(self.last, unused=())  # its tokens are those of the earlier sentence
            return settled(sentence, choices_of(repeated, planner, found), planner)
        if action == "yes" and isinstance(self.outcome, Question) and self.outcome.choices:
            if len(self.outcome.choices) == 1:
                return replace(self.outcome.choices[0], sentence=sentence)
            return replace(self.outcome, sentence=sentence)
        why = {"yes": "there is no question to answer", "no": "say what you mean instead"}
        text = why.get(action, f"there is nothing to {TO_DO.get(action, action)}")
        return Refusal(sentence, span=(0, len(sentence)), reason="dialogue", text=text, suggestions=examples(world))

    def _done(self) -> Outcome | None:
        """Returns the last outcome that did something."""
        return next((o for o in reversed(self.history) if isinstance(o, Understood) and len(o.steps)), None)

    def _reply(self, sentence: str, reply: Reading, found: Choices, world: World) -> Outcome:
        """Returns the outcome of an answer, or of a correction of the last sentence."""
        step = reply.steps[0]
        if step.action != "fragment":  # "no, take the blue one"
            return self._again_from_before(sentence, [Reading(reply.steps)], found, world, undo=True)
        if isinstance(self.outcome, Question) and len(self.outcome.candidates) > 1 and not reply.rejects:
            chosen = self._chosen(reply, world)
            if len(chosen) == 1:
                return replace(chosen[0], sentence=sentence)
        if self.last is None:
            entity = step.entity
            refs = Planner(world).resolver(world, (), None).resolve(entity) if entity else []
            known = name(world, refs[0].things[-1]) if refs and refs[0].things else ""
            text = f"What shall I do with {known}?" if known else "say what to do"
            if known:
                return Question(
                    sentence, 0.0, (), (0, len(sentence)), text, tuple(i for ref in refs for i in ref.things)
                )
            return refused(sentence, found._replace(possible=[], failed=[]), world)
        readings = revised(self.last, reply)
        return self._again_from_before(sentence, readings, found, world, undo=reply.rejects)

    def _chosen(self, reply: Reading, world: World) -> list[Understood]:
        """Returns the choices of the last question that an answer selects."""
        assert isinstance(self.outcome, Question)
        question, step = self.outcome, reply.steps[0]
        entity = step.entity or _selecting(step.places)
        if entity is None:
            return []
        entity = replace(entity, every=False)
        resolver = Planner(world, self.it, self.it).resolver(world, self.it, None)
        refs = resolver.resolve(entity, lambda ref: bool(set(ref.things) & set(question.candidates)))
        named = {i for ref in refs for i in ref.things}
        return [
            choice
            for choice in question.choices
            if named & {i for a in choice.steps for i in (a.object, a.on) if i in question.candidates}
        ]

    def _again_from_before(
        self, sentence: str, readings: list[Reading], found: Choices, world: World, undo: bool
    ) -> Outcome:
        """Returns the outcome of the first reading that can be carried out, if need be from the scene before."""
        before = self.before or world
        tried: list[tuple[World, tuple[Action, ...]]] = [(world, ())]
        restored = restoring(world, before)
        if restored:
            tried = [(before, restored)] if undo else [*tried, (before, restored)]
        last: Outcome | None = None
        for reading in readings:
            for start, actions in tried:
                planner = Planner(start, self.it, self.it)
                outcome = settled(sentence, choices_of(reading, planner, found), planner)
                if isinstance(outcome, Understood):
                    return replace(outcome, steps=(*actions, *outcome.steps))
                last = last if isinstance(last, Question) else outcome
        return last or unreadable(sentence, found.tokens, world)


def _certain(made: Sequence[Gesture]) -> tuple[int, ...]:
    """Returns the things that gestures show if each shows one thing; else ()."""
    certain = all(len(each.things) == 1 and each.place is None for each in made)
    return tuple(each.things[0] for each in made) if certain else ()


def _shifts(found: Choices) -> bool:
    """Returns whether the likeliest plan moves something in a direction; the precise grammar takes it for a place."""
    steps = found.possible[0].reading.steps if found.possible else ()
    return any(place.name == "direction" for step in steps for place in step.places)


def _selecting(places: tuple[Relation, ...]) -> Entity | None:
    """Returns an answer such as "left" or "next to the ball" as a phrase for a thing."""
    if len(places) != 1:
        return None
    if places[0].name == "direction" and places[0].value:
        return Entity(sides=(places[0].value,))
    return Entity(relations=places)


def choices_of(reading: Reading, planner: Planner, found: Choices) -> Choices:
    """Returns the plans of one reading."""
    plans = [Choice(reading, plan, plan.cost) for plan in planner.plans(reading)]
    possible = {result(choice.plan): choice for choice in reversed(plans) if not choice.plan.failure}
    ordered = sorted(possible.values(), key=lambda choice: choice.cost)
    return found._replace(possible=ordered, failed=[choice for choice in plans if choice.plan.failure])


def restoring(now: World, then: World) -> tuple[Action, ...]:
    """Returns the actions that bring every thing back to where it was."""
    actions: list[Action] = []
    order = sorted(range(len(then.things)), key=lambda i: (i != now.held, then.things[i].bottom))
    for index in order:
        old, new = then.things[index], now.things[index]
        if index == then.held or old.target:  # a see-through thing marks a place, and the arm cannot take it
            continue
        moved = math.dist((old.x, old.y, old.bottom), (new.x, new.y, new.bottom))
        if index == now.held or moved > SAME * now.pitch:
            if index != now.held:
                actions.append(Action("take", index))
            actions.append(Action("place", index, (old.x, old.y), old.bottom, then.below[index]))
    if then.held is not None and now.held != then.held:
        actions.append(Action("take", then.held))
    return tuple(actions)
