"""Dialogues: what was said and done before decides what "it", "again", "no, the blue one" and answers mean."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Any, NamedTuple

from language import costs
from language.errors import NotUnderstood
from language.lattice import vocabulary
from language.meanings import Clause, Entity, Gesture, Pointed, Reading, gestures
from language.normalise import COLOR, normalised, plain_start, scan, verb_words
from language.objects import Scene
from language.outcomes import Answer, Outcome, Plan, Question, Refusal, Signal, Step
from language.planning import CARRY, Planner
from language.questions import Questions, holds_true
from language.revising import filled, pinned, restoring, revised, selecting
from language.settling import Choices, choices, choices_of, matters, settled
from language.talk import abilities, foreign, name, offers, phrase, question
from language.understanding import exact_reading
from language.verbs import Act
from language.words import CONTROLS, TABLE, phrases
from language.world import FIXED, WorldModel, table

THANKS = frozenset(phrases(TABLE["thanks"]))
_CONTROL_OF = {phrase: control for control, text in CONTROLS.items() for phrase in phrases(text)}
_NOTHING = {
    "yes": "there is no question to answer",
    "no": "say what you mean instead",
    "again": "there is nothing to repeat",
    "undo": "there is nothing to undo",
}
_SPEED = "my arm keeps its own speed; the clock has a speed, under Time"
_SAME_WITH = re.compile(
    r"^(?:and |now |then |please |so )*(?:do |repeat )?(?:exactly )?(?:the )?(?:same|that|it)(?: thing| again)? "
    r"(?:with|for|to|using) (?P<what>.+?)(?:(?: ,)? but (?P<where>.+))?$"
    r"|^(?:and )?(?P<also>.+?) (?:as well|too|also)$|^(?:and )?(?:now |then |also )?(?:how about|what about) "
    r"(?P<about>.+)$"
)
_CONDITION = re.compile(
    r"^(?:if|in case|when(?! you (?:have|are|did))|provided|assuming|should|as long as|whenever) "
    r"(?P<if>.+?)(?<! is)(?<! are)"
    rf"(?: ,| then|(?= (?:please|{verb_words()})\b)) ?(?:then )?(?P<do>.+?)"
    r"(?:(?: ,)? (?:otherwise|else|if not|or else)(?: ,)? (?P<else>.+))?$"
    r"|^(?P<do2>.+?)(?: ,)?(?: but)?(?: only)? "
    r"(?P<how>if|in case|unless|provided|as long as|except if|except when|only when) (?P<if2>(?!not$).+)$"
)


class Turn(NamedTuple):
    """A sentence, what came of it, and the world before it."""

    sentence: str
    outcome: Outcome
    world: WorldModel


@dataclass
class Dialogue:
    """What was said and done.

    world: the scene after the last outcome. turns: oldest first. it: the things that were spoken of last.
    box: the container that was spoken of last. last: the reading of the last plan or question.
    surroundings: further fields of `WorldModel` for every scene, such as `bounds` and `little`.
    """

    world: WorldModel | None = None
    turns: list[Turn] = field(default_factory=list)
    it: tuple[int, ...] = ()
    box: int | None = None
    last: Reading | None = None
    surroundings: dict[str, Any] = field(default_factory=dict)

    def copy(self) -> Dialogue:
        """Return a dialogue with the same memory, to try a sentence."""
        return replace(self, turns=[*self.turns])

    def answer(self, sentence: str, scene: Scene | WorldModel | None = None, pointed: Pointed = ()) -> Outcome:
        """Return the outcome of a sentence and remembers it.

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
            outcome = self._answer(sentence, world, made)
        except NotUnderstood as error:
            outcome = Refusal(sentence, span=(0, len(sentence)), text=str(error), suggestions=offers(world))
        self.remember(outcome, world)
        return outcome

    def remember(self, outcome: Outcome, world: WorldModel) -> None:
        """Add an outcome to the memory. world: before it."""
        self.turns.append(Turn(outcome.sentence, outcome, world))
        self.world = world
        if isinstance(outcome, Plan) and outcome.steps:
            self.world = outcome.result or world
            self.last = outcome.reading or self.last
            asked = [step for step in outcome.steps if not step.implied] or list(outcome.steps)
            self.it = tuple(dict.fromkeys(s.object for s in asked if s.several)) or (asked[-1].object,)
            boxes = [i for s in asked for i in (s.object, s.goal) if i is not None and i in world.containers]
            self.box = boxes[-1] if boxes else self.box
        elif isinstance(outcome, Signal) and outcome.steps:
            self.world = outcome.result or world
        elif isinstance(outcome, Question | Refusal):
            self.last = getattr(outcome, "reading", None) or self.last

    def amend(self, outcome: Outcome, world: WorldModel) -> None:
        """Replace the last turn's outcome by what really came of it. world: before it."""
        turn = self.turns.pop()
        kept = self.last
        self.remember(replace(outcome, sentence=turn.sentence), world)
        if self.last is None:
            self.last = kept

    # ---- One sentence

    def _planner(self, world: WorldModel, made: tuple[Gesture, ...] = ()) -> Planner:
        it = self.it if world.held is None or world.cells else (world.held, *(i for i in self.it if i != world.held))
        return Planner(world, it, self.it, gestures=made, box=self.box)

    def _answer(self, sentence: str, world: WorldModel, made: tuple[Gesture, ...]) -> Outcome:
        if len(sentence) <= 600:
            raw = [token.text for token in scan(sentence)]
            outcome = self._talk(sentence, raw, world, made)
            if outcome is not None:
                return outcome
        if world.scene is not None:
            exact = self._exact(sentence, world, made)
            if exact is not None:
                return exact
        words = normalised(sentence)
        text = " ".join(token.text for token in words)
        start = plain_start(sentence)
        for given in (self._conditional, self._same_with):
            outcome = given(sentence, start if given == self._conditional else text, world, made)
            if outcome is not None:
                return outcome
        times, words = _times(words)
        planner = self._planner(world, made)
        found = choices(words, planner, times=times)
        likeliest = min(found.readings, key=lambda reading: reading.cost, default=None)
        reply = next((r for r in sorted(found.readings, key=lambda r: r.cost) if r.cost <= costs.TOO_MUCH), None)
        if reply is not None and self._is_reply(reply, likeliest, found):
            outcome = self._reply(sentence, reply, found, world)
            if outcome is not None:
                return outcome
        return settled(sentence, found, planner)

    def _is_reply(self, reply: Reading, likeliest: Reading | None, found: Choices) -> bool:
        """Whether a sentence answers or corrects what went before, rather than asks for something of its own."""
        fragment = len(reply.steps) == 1 and reply.steps[0].verb is None
        if reply is not likeliest or not (reply.rejects or fragment):
            return False
        if reply.rejects or not found.possible or (self.turns and isinstance(self.turns[-1].outcome, Question)):
            return True
        return found.possible[0].cost > reply.cost + (0.2 if self.turns else costs.NO_VERB)

    def _exact(self, sentence: str, world: WorldModel, made: tuple[Gesture, ...]) -> Outcome | None:
        """Return the plan of a sentence of the project's own language, if it can be carried out."""
        spoken = (world.held, *self.it) if world.held is not None else self.it
        reading = exact_reading(sentence, world, _certain(made), spoken)
        if reading is None:
            return None
        plans = Planner(world, self.it, self.it, box=self.box).plans(reading)
        touched = any(step.act is Act.TOUCH for step in plans[0].steps) if plans else False
        if not plans or plans[0].failure or (touched and any(each.act is Act.HOLD for each in reading.steps)):
            return None
        best = plans[0]
        return Plan(sentence, 1.0, (), (0, len(sentence)), best.steps, best.world, reading, best.notes)

    # ---- Talk

    def _talk(self, sentence: str, raw: list[str], world: WorldModel, made: tuple[Gesture, ...]) -> Outcome | None:
        """Return the outcome of a sentence that asks for no motion: signals, questions, other languages."""
        span = (0, len(sentence))
        words = [word for word in raw if word.isalnum()]
        if not words:
            text = "I did not get any words"
            return Refusal(sentence, span=span, text=text, suggestions=offers(world))
        text = " ".join(raw).strip(" .,!?;:")
        control = self.control_word(" ".join(word for word, _ in groupby(words)) if len(set(words)) == 1 else text)
        if control is not None and not made:
            return self._control(sentence, control, world)
        strange = foreign(words, vocabulary())
        if strange:
            return Refusal(sentence, span=span, reason="language", text=strange, suggestions=offers(world))
        plain = plain_start(text)
        polite = re.match(r"(?:thanks|thank you|great|perfect|bye|goodbye|see you|hello|hi)\b", text)
        nothing = polite and not re.search(rf"\b(?:{COLOR}|cubes?|blocks?|it|one|{verb_words()})\b", plain)
        if question(text) is None and (text in THANKS or plain in THANKS or not plain or nothing):
            return Answer(
                sentence,
                1.0,
                text=("You are welcome. Say what I shall do next")
                if "than" in text
                else "All right. Say what I shall do next",
            )
        parts = [part.strip() for part in re.split(r"[.!?;]", " ".join(raw)) if part.strip()]
        asked = question(text)
        if len(parts) > 1:
            return self._several(sentence, parts, world, made)
        if asked is None or re.match(r"(?:can|could|would|will|do) you (?:please )?(?:give|put|take|open|close)", text):
            return self._about_robot(sentence, text)
        known = Questions(world, self._planner(world), self.turns, None)
        told = known.answer(asked)
        if told is not None:
            if known.things:
                self.it = tuple(known.things[:1])
                self.box = known.things[0] if known.things[0] in world.containers else self.box
            return Answer(sentence, 1.0, (), span, told)
        unknown = [word for word in words if word not in vocabulary() and not word.isdigit()]
        if re.match(r"(?:what|which|who|whose|why|when|how)\b|(?:is|are|does|did) ", asked):
            what = f"'{' '.join(unknown[:3])}'" if unknown else f"'{' '.join(words[:8])}'"
            text = f"I cannot answer that: I know nothing about {what}, only about the things here"
            return Refusal(sentence, span=span, reason="nothing", text=text, suggestions=offers(world, words))
        return None

    def _about_robot(self, sentence: str, text: str) -> Outcome | None:
        if re.match(
            (r"you (?:are|were|look|seem|have been) (?!to\b|holding|allowed|asked|supposed|going)"), text
        ) or re.match((r"i (?:am|was|feel) (?:tired|happy|sad|hungry|bored|angry|fine|here|back|sorry)\b[^,]*$"), text):
            return Answer(sentence, 0.5, text=f"I am a robot arm, and do what I can. {offers_text(self.world)}".strip())
        return None

    def control_word(self, text: str) -> str | None:
        """Return what a sentence says about the motion, a key of `CONTROLS`; None for nothing."""
        polite = (
            r"^(?:please|okay|robot|now|and|so|then|hey|well|just|oh|right|alright|could you|can you|would you|no|yes"
            r"|okay so|could you please|can you please|thanks|i said|you can|you may|you should|okay robot|,|let us"
            r"|let me|actually|sorry)(?: ,)? "
        )
        tail = (
            r"(?: ,)? (?:please|now|robot|thanks|thank you|for me|right now|then|immediately|at once|okay|a bit|again"
            r"|for a bit|for a moment|mate|sir|if you can|would you|dear|buddy|arm)$"
        )
        for _ in range(5):
            if text in _CONTROL_OF:
                return _CONTROL_OF[text]
            squeezed = text.replace(" , ", " ")
            if squeezed in _CONTROL_OF:
                return _CONTROL_OF[squeezed]
            shorter = re.sub(polite, "", re.sub(tail, "", text))
            if shorter == text:
                break
            text = shorter
        first = re.match(r"^(?:no )?(stop|halt|freeze|wait)(?: stop)* [!,]", text)
        if first and len(text.split()) <= 4:
            return _CONTROL_OF[first[1]]
        return None

    def _control(self, sentence: str, control: str, world: WorldModel) -> Outcome | None:
        span = (0, len(sentence))
        if control == "no" and self.turns and isinstance(self.turns[-1].outcome, Question):
            return Answer(sentence, 1.0, (), span, "All right, I do nothing. Say what you mean instead")
        if control == "no" and self.turns and isinstance(self.turns[-1].outcome, Plan) and "one" in sentence:
            return Question(sentence, 0.5, (), span, "Which one do you mean instead?", reading=self.last)
        if control == "no" and self.turns and isinstance(self.turns[-1].outcome, Plan):
            return Signal(sentence, 1.0, (), span, "stop", "I stop. Say what you mean instead")
        if control == "undo" and (done := self._done()) is not None:
            steps = restoring(world, done.world)
            result = world
            for step in steps:
                result = result.after(step)
            return Signal(sentence, 1.0, (), span, control, "I undo that", steps, result)
        if control == "again" and self._done() is not None and self.last is not None:
            planner = self._planner(world)
            repeated = replace(self.last, unused=(), cost=0.0)
            outcome = settled(sentence, choices_of([repeated], planner), planner)
            return outcome if isinstance(outcome, Plan) else replace(outcome, sentence=sentence)
        if control == "yes" and self.turns and isinstance(last := self.turns[-1].outcome, Question) and last.choices:
            return replace(last.choices[0] if len(last.choices) == 1 else last, sentence=sentence)
        asked = self.turns[-1].outcome if self.turns else None
        if control == "yes" and isinstance(asked, Question) and len(asked.candidates) == 1 and self.last is not None:
            slot = "goal" if self._asks_goal(asked, world) else "object"
            meant = filled(self.last, pinned(asked.candidates[0]), slot)
            planner = self._planner(world)
            return settled(sentence, choices_of([meant] if meant else [], planner), planner)
        if control == "yes" and isinstance(asked, Answer):
            able = re.match(
                r"(?:can|could|would|does|will|may|should) (.+?) (?:fit|go|stand|lie|be put|be) (.+)",
                plain_start(asked.sentence),
            )
            tried = self.copy()._answer(f"put {able[1]} {able[2].split(' , ')[0]}", world, ()) if able else None
            if isinstance(tried, Plan):
                return replace(tried, sentence=sentence)
        if control == "yes":
            return Answer(sentence, 0.5, (), span, "Good. Say what I shall do next")
        if control in _NOTHING:
            return Refusal(sentence, span=span, reason="dialogue", text=_NOTHING[control], suggestions=offers(world))
        note = _SPEED if control in ("faster", "slower") else ""
        return Signal(sentence, 1.0, (), span, control, note)

    def _done(self) -> Turn | None:
        """Return the last turn that did something and was not undone."""
        undone = 0
        for turn in reversed(self.turns):
            if isinstance(turn.outcome, Signal) and turn.outcome.control == "undo":
                undone += 1
            elif isinstance(turn.outcome, Plan) and turn.outcome.steps:
                if not undone:
                    return turn
                undone -= 1
        return None

    def _several(self, sentence: str, parts: list[str], world: WorldModel, made: tuple[Gesture, ...]) -> Outcome | None:
        """Return the outcome of several sentences, if the first is a question or says what does not matter."""
        asked = question(parts[0])
        rest = " . ".join(parts[1:])
        if asked is not None and not re.match(r"(?:can|could|would|will) you", parts[0]):
            known = Questions(world, self._planner(world), self.turns, None)
            told = known.answer(asked)
            trial = self.copy()
            if known.things:
                trial.it = tuple(known.things[:1])
                trial.box = known.things[0] if known.things[0] in world.containers else trial.box
            if (then := re.match(r"if (not|so|yes|no|it is not|it is)(?: ,)? (.+)", rest)) and told:
                if (then[1] in ("so", "yes", "it is")) != told.lower().startswith("yes"):
                    return Answer(sentence, 1.0, (), (0, len(sentence)), told)
                rest = then[2]
            outcome = trial._answer(rest, world, made) if rest else None
            if isinstance(outcome, Plan | Question):
                return replace(outcome, sentence=sentence)
            return Answer(sentence, 1.0, (), (0, len(sentence)), told) if told else None
        first = self.control_word(parts[0])
        if (
            first in ("stop", "wait")
            and len(parts) == 2
            and self.control_word(parts[1]) is None
            and parts[0] not in ("no",)
        ):
            outcome = self.copy()._answer(rest, world, made)
            return outcome if isinstance(outcome, Plan) else None
        return None

    # ---- Conditions, and "the same with"

    def _conditional(self, sentence: str, text: str, world: WorldModel, made: tuple[Gesture, ...]) -> Outcome | None:
        match = _CONDITION.match(text.replace(" 's ", " is "))
        if match is None or world.cells:
            return None
        condition, command = match["if"] or match["if2"], match["do"] or match["do2"]
        planner = self._planner(world)
        if re.match(r"(?:it|they|that)\b", condition):
            _, refs = phrase(world, planner, scan(command))
            planner.it = tuple(i for ref in refs for i in ref.things[-1:]) or planner.it
        true = holds_true(condition, world, planner)
        if true is None:
            return None
        if match["how"] in ("unless", "except if", "except when"):
            true = not true
        if not true and match["else"]:
            command = (
                match["else"]
                if not re.match(r"(?:a )?\w+ (?:one|cube|block)$|\w+$", match["else"])
                else _with_object(command, match["else"])
            )
        elif not true:
            return Answer(
                sentence,
                1.0,
                (),
                (0, len(sentence)),
                (f"I do nothing, because it is not so that {condition}")
                if match["how"] not in ("unless",)
                else f"I do nothing, because {condition}",
            )
        trial = self.copy()
        trial.it = planner.it
        outcome = trial._answer(command, world, made)
        return replace(outcome, sentence=sentence)

    def _same_with(self, sentence: str, text: str, world: WorldModel, made: tuple[Gesture, ...]) -> Outcome | None:
        match = _SAME_WITH.match(text)
        if match is None or self.last is None or (match["also"] and len(match["also"].split()) > 5):
            return None
        what = match["what"] or match["about"] or match["also"]
        found = choices(scan(what + (f" {match['where']}" if match["where"] else "")), self._planner(world, made))
        for reading in sorted(found.readings, key=lambda each: each.cost):
            clause = reading.steps[0]
            if len(reading.steps) == 1 and clause.entity is not None and (clause.verb is None or match["where"]):
                last = self.last
                if clause.places:
                    last = replace(last, steps=(*last.steps[:-1], replace(last.steps[-1], places=clause.places)))
                readings = revised(last, Reading((Clause(None, clause.entity),)))
                return self._tried(sentence, readings, found, world, restore=False)
        return None

    # ---- Replies

    def _reply(self, sentence: str, reply: Reading, found: Choices, world: WorldModel) -> Outcome | None:
        """Return the outcome of an answer, or of a correction of the last sentence."""
        clause = reply.steps[0]
        last = self.turns[-1].outcome if self.turns else None
        if not world.cells and any(matters(found.lattice, index) for index in reply.unused):
            return None  # a word is left out that may change the meaning
        if len(reply.steps) > 1 or (clause.verb is not None and not reply.rejects):
            return (
                None
                if not reply.rejects
                else self._tried(sentence, [Reading(reply.steps)], found, world, restore=world.cells)
            )
        if clause.verb is not None:  # "no, take the blue one"
            if (
                clause.act is Act.CARRY
                and clause.entity is not None
                and clause.verb == CARRY
                and len(self.turns)
                and self.last is not None
            ):
                pass
            return self._tried(sentence, [Reading(reply.steps)], found, world, restore=world.cells)
        if isinstance(last, Question) and not reply.rejects:
            chosen = self._chosen(sentence, last, reply, found, world)
            if chosen is not None:
                return chosen
        if self.last is None:
            return None if clause.entity is None else self._what(sentence, clause.entity, found, world)
        if world.held is not None and clause.entity is None and not world.cells:
            put = Reading((Clause(CARRY, None, clause.places),))
            return self._tried(sentence, [put], found, world, restore=False)
        restore = reply.rejects and (clause.entity is not None or world.cells)
        return self._tried(sentence, revised(self.last, reply), found, world, restore=restore)

    def _what(self, sentence: str, entity: Entity, found: Choices, world: WorldModel) -> Outcome | None:
        refs = self._planner(world).resolver(world, (), None).resolve(entity)
        things = [ref.things[-1] for ref in refs if ref.things]
        if not things:
            return None
        things.sort(key=lambda i: entity.noun is None and world.things[i].kind in FIXED)
        text = (
            f"What shall I do with {name(world, things[0])}? Say, for example, "
            f"{' or '.join(repr(each) for each in offers(world, name(world, things[0]).split()))}"
        )
        return Question(sentence, 0.0, (), (0, len(sentence)), text, tuple(things))

    def _chosen(
        self, sentence: str, asked: Question, reply: Reading, found: Choices, world: WorldModel
    ) -> Outcome | None:
        """Return the plan of the candidate that an answer names."""
        clause, planner = reply.steps[0], self._planner(world)
        entity = clause.entity or selecting(clause.places)
        if entity is None or (clause.entity is None and not asked.candidates):
            return None
        among = set(asked.candidates)
        several = (entity.kind == "it" and entity.plural) or (
            entity.every and not entity.colors and entity.noun is None
        )
        if several and self.last is not None:
            parts = tuple(pinned(i) for i in asked.candidates)
            readings = revised(self.last, Reading((Clause(None, Entity("list", parts=parts)),)))
            return self._tried(sentence, readings, found, world, restore=False)
        resolver = planner.resolver(world, self.it, None)
        refs = resolver.resolve(replace(entity, every=False), lambda ref: bool(set(ref.things) & among))
        named = list(dict.fromkeys(i for ref in refs for i in ref.things if i in among)) or (
            [i for ref in refs for i in ref.things][:1] if not among else []
        )
        if entity.any and not named:
            named = list(asked.candidates)
        if len(named) > 1 and not entity.any and asked.choices:
            least = min(ref.cost for ref in refs if set(ref.things) & among)
            named = [i for i in named if any(i in ref.things and ref.cost <= least + 0.3 for ref in refs)]
        chosen = [
            c for c in asked.choices if named and {i for s in c.steps for i in (s.object, s.goal)} & set(named[:1])
        ]
        if len(named) == 1 and len(chosen) == 1 and world == self.turns[-1].world:
            return replace(chosen[0], sentence=sentence)
        if not named or self.last is None or (len(named) > 1 and not entity.any):
            return None
        chosen_one = pinned(named[0])
        tried = [
            filled(self.last, chosen_one, slot)
            for slot in (("goal", "object") if self._asks_goal(asked, world) else ("object", "goal"))
        ]
        good = [each for each in tried if each is not None]
        return self._tried(sentence, good, found, world, restore=False)

    def _asks_goal(self, asked: Question, world: WorldModel) -> bool:
        """Whether the candidates of a question are places, not objects, of its sentence."""
        if self.last is None:
            return False
        clause = self.last.steps[-1]
        if clause.entity is None or clause.entity.kind == "it":
            return True
        refs = self._planner(world).resolver(world, self.it, None).resolve(clause.entity)
        things = {ref.things[-1] for ref in refs if ref.things}
        return len(things & set(asked.candidates)) < len(asked.candidates) and len(things) <= 2

    def _tried(
        self, sentence: str, readings: list[Reading], found: Choices, world: WorldModel, restore: bool
    ) -> Outcome | None:
        """Return the outcome of the first reading that can be carried out, if need be from the scene before."""
        done = self._done()
        before = done.world if done is not None else world
        tried: list[tuple[WorldModel, tuple[Step, ...]]] = [(world, ())]
        restored = restoring(world, before)
        if restored and (restore or world.cells):
            tried = (
                [(before, restored)]
                if world.cells and restore
                else [(before, restored), *tried]
                if restore
                else [*tried, (before, restored)]
            )
        last: Outcome | None = None
        for reading in readings:
            for start, steps in tried:
                planner = self._planner(start)
                planner.mentioned = self.it
                outcome = settled(sentence, choices_of([reading], planner, found), planner)
                if isinstance(outcome, Plan):
                    return replace(outcome, steps=(*steps, *outcome.steps))
                last = last if isinstance(last, Question) else outcome
        return last


def offers_text(world: WorldModel | None) -> str:
    """Return what can be said now, as a sentence."""
    return "" if world is None else abilities(world)


def _certain(made: Sequence[Gesture]) -> list[int]:
    """Return the things of gestures that show one; [] if one is uncertain."""
    return [each.things[0] for each in made] if all(len(each.things) == 1 for each in made) else []


def _times(words: list) -> tuple[int, list]:
    """Return how often something is to be done, and the words without that."""
    text = " ".join(token.text for token in words)
    match = re.search(r"\b(twice|thrice|(two|three|four|five|2|3|4|5) times)\b", text)
    if match is None:
        return 1, words
    number = {"twice": 2, "thrice": 3, "two": 2, "three": 3, "four": 4, "five": 5}.get(match[2] or match[1])
    at, count = text[: match.start()].count(" "), len(match[0].split())
    return number or int(match[2]), [*words[:at], *words[at + count :]]


def _with_object(command: str, phrase: str) -> str:
    """Return a command with another object: "give it to me", "the yellow one"."""
    return (
        re.sub(r"\b(?:it|that one|that|this)\b", phrase, command, count=1)
        if re.search(r"\b(?:it|that)\b", command)
        else f"{command.split()[0]} {phrase}"
    )
