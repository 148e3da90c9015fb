"""Dialogues: what was said and done before decides what "it", "again", "no, the blue one" and answers mean.

A turn is read by the same chart as any sentence. What it does beside that (`language.acts`) decides what its reading
is compared with: an answer with the question before, a correction with the last plan and the world before it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from language import costs
from language.acts import (
    ABLE,
    IDLE,
    JOINING,
    SAME,
    Part,
    act_of,
    beside_home,
    parts_of,
    plainly,
    proposal,
    question,
    says,
    says_nothing,
    stops_after_all,
    without_idle,
)
from language.conditions import Conditions
from language.errors import NotUnderstood
from language.lattice import vocabulary
from language.meanings import Gesture, Pointed, Reading, gestures
from language.normalise import LONGEST_SENTENCE, normalised
from language.objects import Scene
from language.ordering import asked_deed, later_time, times
from language.outcomes import Answer, Outcome, Plan, Question, Refusal, Signal
from language.planning import Planner
from language.questions import Questions
from language.recalling import on_sides_of, without_names
from language.remarks import asks_nothing, is_chat
from language.remarks import command as command_word
from language.replies import LITTLE
from language.revising import aside
from language.scanning import COLOR, THING, Token, scan, text_of, verb_words
from language.settling import Choices, choices, crowded, settled
from language.spoken import fluent
from language.statements import stated
from language.steps import ON_TABLE
from language.talk import abilities, foreign, name, offers, phrase, said
from language.understanding import exact_reading
from language.verbs import Act
from language.world import WorldModel, table

_NOTHING = {
    "yes": "there is no question to answer",
    "no": "say what you mean instead",
    "again": "there is nothing to repeat",
    "undo": "there is nothing to undo",
    "less": "I have moved nothing that could go back a bit",
    "opposite": "I have done nothing that could be the other way round",
}
_SPEED = "my arm keeps its own speed; the clock has a speed, under Time"
_NEXT = "Say what I shall do next"
_FROM_HERE = "I begin where my arm is"

_THERE = re.compile(r"(?<!if )(?<!that )(?<!what )\b(?:is|are|was|were) there\b")
IT_SHALL = re.compile(r"(?:please )?(?:do (?:it|so|that)|then do|please do|make it so)\W*$")
_CERTAIN = re.compile(r"\b(?:the|those|these|all|both|two|three|four|my|your|please)\b", re.IGNORECASE)
_LEAVES = re.compile(
    r"\b(?:leave|keep) (?:it|that|this|them) (?:in|on|at|next|near|beside|behind|between|under|left|right)\b"
)
_ANY = re.compile(r"(?:any|some)(?:thing|one|body)?\b(?! chance| way| possib| left| put| has| forgot)")
_BESIDE_IT = re.compile(  # "where is the red cube?", "and behind it?"
    r"(?:(?:right |directly |just )?(?:behind|in front of|under|beneath|below|above|next to|beside|near|close to|inside"
    r"|(?:to |on |at )?(?:left|right) of|in)|on(?: top of)?) (?:it|that|that one|this one|them)(?: then)?$"
)
_PREPOSITIONS = ("in", "on", "to", "of", "from", "at", "under", "behind", "near", "next", "inside")

# "is there room beside it? put it there"
_ROOM_THERE = re.compile(r"is there .*\b(?:place|space|room|spot) (?!for\b|in\b|left$)")


@dataclass
class Dialogue(Conditions):
    """Answers sentences, and remembers what was said and done."""

    def answer(self, sentence: str, scene: Scene | WorldModel | None = None, pointed: Pointed = ()) -> Outcome:
        """Return the outcome of a sentence and remember it.

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
        homeward, self.world, self.homeward = self.homeward, world, False
        try:
            outcome = self.called(sentence) or self._recalling(sentence, made)
        except NotUnderstood as error:
            outcome = Refusal(sentence, span=(0, len(sentence)), text=str(error), suggestions=offers(world))
        if not isinstance(outcome, Plan | Signal):  # the last plan goes on
            self.homeward = homeward
        self.remember(outcome, world)
        return outcome

    # ---- One turn

    def _recalling(self, sentence: str, made: tuple[Gesture, ...]) -> Outcome:
        """Return the outcome of a sentence that may tell things and places by what was said and done before."""
        text, places = (sentence, ()) if self.control_word(sentence) else self.recalled(fluent(sentence))
        text = plainly(on_sides_of(without_names(text), self.now.viewpoint))
        outcome = self._answer(text, (*made, *places))
        return outcome if text == sentence else replace(outcome, sentence=sentence, unused=(), span=(0, len(sentence)))

    def _answer(self, sentence: str, made: tuple[Gesture, ...]) -> Outcome:
        world, span = self.now, (0, len(sentence))
        if len(sentence) > LONGEST_SENTENCE:
            normalised(sentence)  # says that it is too long
        parts = parts_of(sentence)
        words = [word for part in parts for word in part.words]
        if not words:
            return Refusal(sentence, span=span, text="I did not get any words", suggestions=offers(world))
        if start := beside_home(sentence)[0]:
            outcome = self._answer(" " * start + sentence[start:], made)
            if isinstance(outcome, Plan) and outcome.steps:
                return replace(outcome, sentence=sentence, notes=(_FROM_HERE, *outcome.notes))
        telling = [part for part in parts if part.act is not None or not is_chat(part.words)]
        if telling and all(
            part.act in (*IDLE, "home", "undo", "again") for part in telling
        ):  # "back off, I see nothing"
            words = [word for part in telling for word in part.words]
        signal = self._signal(sentence, words) if not made else None
        if signal is not None:
            return signal
        if strange := foreign(words, vocabulary()):
            return Refusal(sentence, span=span, reason="language", text=strange, suggestions=offers(world))
        if (chat := self._stated(sentence, parts)) is not None:
            return chat
        text = without_idle(sentence, parts)
        if (left := self._left(sentence, parts)) is not None:
            return left
        if stops_after_all(parts):
            return Signal(sentence, 1.0, (), span, control="stop", text=f"All right, I do nothing. {_NEXT}")
        if (told := self._then_asks(sentence, parts, made) or self._asked(sentence, text, made)) is not None:
            topic = self._about_topic(sentence, parts, made) if isinstance(told, Refusal) else None
            return replace(topic or told, sentence=sentence)
        if parts[-1].mark == "?" and _THERE.search(" ".join(parts[-1].words)):  # "apart from X, is there anything?"
            return self._unknown(sentence, words)
        _, end = beside_home(text)
        text, homeward = text[:end], end < len(text)
        plain = " ".join(token.text for token in scan(text) if token.text not in ".,!?")
        found = self._of_turns(text, plain, made) or self._command(self._reordered(plain) or text, made)
        outcome = replace(found, sentence=sentence)
        if (when := later_time(plain)) and isinstance(outcome, Plan | Refusal):
            why = f"I act at once, and do not wait until then ('{when}'); say it again at that time"
            return Refusal(sentence, 0.5, (), span, "impossible", text=why, suggestions=offers(world))
        if homeward and isinstance(outcome, Plan) and outcome.steps:
            self.homeward = True
            return replace(outcome, notes=(*outcome.notes, "after that I go back to my rest position"))
        if isinstance(outcome, Plan) or (isinstance(outcome, Question) and outcome.choices and not outcome.unused):
            return outcome
        said = self._aside(sentence, parts, outcome) or self._beside_chat(sentence, parts, made)
        said = said or self._about_topic(sentence, parts, made) or outcome
        return replace(said, sentence=sentence)

    def _beside_chat(self, sentence: str, parts: list[Part], made: tuple[Gesture, ...]) -> Outcome | None:
        """Return what the other parts of a sentence come to, where a part is chat in words that are not all known."""
        for part in parts if len(parts) > 1 else ():
            if part.mark != "?" and says_nothing(part):
                mark = len(sentence[part.end :]) - len(sentence[part.end :].lstrip(" ,;:!-"))
                rest = f"{sentence[: part.start]}{' ' * (part.end + mark - part.start)}{sentence[part.end + mark :]}"
                trial = self.copy()
                outcome = trial._answer(rest, made)
                if not isinstance(outcome, Refusal) and (not isinstance(outcome, Question) or outcome.choices):
                    self.homeward = trial.homeward
                    return outcome
        return None

    def _stated(self, sentence: str, parts: list[Part]) -> Answer | None:
        """Return the answer to a sentence that only says how something is, or what has happened."""
        kind = stated(parts)
        if not kind or (kind == "opinion" and self.open_question() is not None):
            return None
        known = Questions(self.now, self.planner(), self.turns)
        told = known.account() if kind == "event" else ""
        if not told:
            return _social(sentence, self.now)
        return Answer(sentence, 1.0, (), (0, len(sentence)), about=tuple(known.things), text=told)

    def _aside(self, sentence: str, parts: list[Part], outcome: Outcome) -> Outcome | None:
        """Return what a signal or small talk comes to whose other parts say nothing: "stop, you'll break it"."""
        act = next((part.act for part in parts if part.act not in (None, "yes", "no", "any", "sorry", "wrong")), None)
        if act in ("faster", "slower") and stated(
            [part for part in parts if part.act is None]
        ):  # "careful, it will fall"
            return self._signal(sentence, [word for part in parts if part.act == act for word in part.words])
        said = [word for part in parts for word in part.words]
        if act is None and isinstance(outcome, Refusal):  # "stop it, or else"
            if re.search(rf"\b(?:{COLOR}|{THING}|{verb_words()})\b", " ".join(said[2:])) or _LEAVES.search(
                " ".join(said)
            ):
                return None
            starts = (act_of(said[:end]) for end in range(1, len(said)))
            act = next((each for each in starts if each in ("stop", "wait")), None)
            if act is not None:
                return Signal(sentence, 0.8, (), (0, len(sentence)), control=act)
        if act is None and re.match(r"(?:you|i|we) (?:are|am|were|was|look|seem|feel)\b", " ".join(said)):
            act = "social"
        if act == "social":
            rest = [word for part in parts if part.act is None for word in part.words]
            plain = " ".join(rest)
            about = re.search(rf"\b(?:{COLOR}|cubes?|blocks?|it|one|{verb_words()})\b", plain)
            return (
                None
                if about or (any(word not in vocabulary() for word in rest) and len(rest) > 3)
                else _social(sentence, self.now)
            )
        halted = act == "continue" and self.turns and isinstance(self.turns[-1].outcome, Signal)  # "it's gone, go on"
        if act is None or (act not in ("stop", "wait") and not halted and not isinstance(outcome, Answer)):
            return None  # other signals are meant only where nothing else is asked for
        if act == "wait" and any(part.act is None and command_word().match(" ".join(part.words)) for part in parts):
            return None  # "no, wait, put it on the blue one"
        return self._signal(sentence, [word for part in parts if part.act == act for word in part.words])

    def _command(self, text: str, made: tuple[Gesture, ...]) -> Outcome:
        """Return the outcome of a sentence that asks for something to be done, answers or corrects."""
        if why := aside(self.now, text):
            return Refusal(text, 0.5, (), (0, len(text)), "impossible", text=why, suggestions=offers(self.now))
        if (exact := self._exact(text, made)) is not None:
            return exact
        conditional = self._conditional(text, made)
        if conditional is not None:
            return conditional
        words, same = self._without_same(normalised(text))
        self.last = self._unadjusted() if same else self.last
        if not words:  # "hey there", which says nothing more
            return _social(text, self.now)
        number, spent = times([token.text for token in words])
        words = [token for at, token in enumerate(words) if at not in spent]
        if number > 1 and act_of([token.text for token in words]) in ("yes", "again"):
            return self._again(text, number) or self._nothing(text, "again")
        planner = self.planner(made)
        if any(token.text == "another" for token in words):  # it is any one but that of before
            planner.others = ()
        found = choices(words, planner, times=number)
        likely = sorted(found.readings, key=lambda reading: reading.cost)
        outcome: Outcome | None = None
        if likely and likely[0].cost <= costs.TOO_MUCH and (same or self._is_reply(likely[0], found)):
            outcome = self._reply(text, likely[0], found)
        outcome = outcome or settled(text, found, planner)
        outcome = self._instead(text, words, outcome) or outcome
        if isinstance(outcome, Plan) or (isinstance(outcome, Question) and outcome.choices):
            return outcome
        return self._named(text, words, found) or outcome

    def _without_same(self, words: list[Token]) -> tuple[list[Token], bool]:
        """Return the words without those that ask for the same once more, "the same with X", and whether they do."""
        while self.last is None and words and words[0].text in ("no", ","):  # there is nothing to correct
            words = words[1:]
        text = text_of(words)
        match = SAME.search(text) if self.last is not None else None
        if match is None:
            return words, False
        first = text[: match.start()].count(" ") + (match.start() > 0)
        return [
            t for t in (*words[:first], *words[first + len(match[0].split()) :]) if t.text not in ("but", "only")
        ], True

    def _is_reply(self, reply: Reading, found: Choices) -> bool:
        """Whether a sentence answers or corrects what went before, rather than asks for something of its own."""
        phrase_alone = self.now.only and self.open_question() is None and not reply.rejects  # it says what to do
        if phrase_alone or crowded(found):
            return False
        if not reply.rejects and (len(reply.steps) > 1 or reply.steps[0].verb is not None):
            return False
        if reply.rejects or not found.possible or self.open_question() is not None:
            return True
        entity = reply.steps[0].entity
        beside = [anchor.kind for each in getattr(entity, "relations", ()) for anchor in each.anchors]
        if entity is not None and entity.colors and "it" in beside:  # "and the blue one next to it" says where
            return False
        return found.possible[0].cost > reply.cost + (0.2 if self.turns else costs.NO_VERB)

    def _exact(self, sentence: str, made: tuple[Gesture, ...]) -> Outcome | None:
        """Return the plan of a sentence of the project's own language, if it can be carried out."""
        world = self.now
        spoken = (world.held, *self.it) if world.held is not None else self.it
        reading = exact_reading(sentence, world, _certain(made), spoken)
        if reading is None:
            return None
        plans = Planner(world, self.it, self.it, box=self.box).plans(reading)
        touched = any(step.act is Act.TOUCH for step in plans[0].steps) if plans else False
        if not plans or plans[0].failure or (touched and any(each.act is Act.HOLD for each in reading.steps)):
            return None
        best = plans[0]
        return Plan(
            sentence,
            1.0,
            (),
            (0, len(sentence)),
            steps=best.steps,
            result=best.world,
            reading=reading,
            notes=best.notes,
        )

    # ---- Signals and short replies

    def control_word(self, text: str) -> str | None:
        """Return what a sentence says about the motion, a key of `CONTROLS`; None for nothing."""
        return act_of([token.text for token in scan(text) if token.text.isalnum()])

    def _signal(self, sentence: str, words: Sequence[str]) -> Outcome | None:
        """Return the outcome of a turn that consists of signals, short replies and small talk; None of another one."""
        number, spent = times(words)
        rest = [word for at, word in enumerate(words) if at not in spent and not (spent and word in JOINING)]
        act = act_of(rest) or ("again" if number > 1 and act_of([*rest, "again"]) else None)
        span, asked = (0, len(sentence)), self.open_question()
        did = next((turn.outcome for turn in reversed(self.turns) if not isinstance(turn.outcome, Answer)), None)
        if back := self._undone_together(words):
            return self._undone(sentence, back)
        if (further := self._retried(words) or self._not_that(sentence, words)) is not None:
            return replace(further, sentence=sentence)
        if act is None:
            return None
        if act in ("social", "sorry"):
            return _social(sentence, self.now)
        if act == "any" and asked is None:
            return Question(sentence, 0.0, (), span, text=f"{_NEXT}: there is no question to choose for")
        if act in ("no", "wrong") and asked is not None:
            return Answer(sentence, 1.0, (), span, text="All right, I do nothing. Say what you mean instead")
        if act in ("no", "wrong") and isinstance(did, Plan) and {"one", "cube", "block", "thing"} & {*words}:
            return Question(sentence, 0.5, (), span, text="Which one do you mean instead?", reading=self.last)
        if act == "wrong" and "where" in words and isinstance(did, Plan):
            return Question(sentence, 0.5, (), span, text="Where do you want it instead?", reading=self.last)
        if act == "no" and did is None and {"thanks", "thank"} & {*words}:
            return _social(sentence, self.now)
        if act == "no" and isinstance(did, Plan):
            return Signal(sentence, 1.0, (), span, control="stop", text="I stop. Say what you mean instead")
        if act == "undo" and {"take", "it", "back"} <= {*words} and self._gave_before():
            return None  # what is on the person's hand
        if act in ("undo", "wrong"):
            redoes = "undo" in words[words.index("undo") + 1 :] if "undo" in words else False
            return (self._redone(sentence, words) if redoes else None) or self._undone(sentence, number)
        if act == "again" or (act == "yes" and number > 1):
            again = self._redone(sentence, words) or self._again(sentence, number, bool(LITTLE & {*words}))
            return again or self._nothing(sentence, "again")
        if act == "less" and self.done() is not None and self.last is not None:
            return self._less(sentence, words) or self._undone(sentence, number)
        if act == "opposite":
            return self._turned_round(sentence) or self._nothing(sentence, act)
        if act == "yes" and asked is None and isinstance(did, Signal) and did.control in ("stop", "wait"):
            return Signal(sentence, 1.0, (), span, control="continue")
        if act in ("yes", "any"):
            return self._agreed(sentence, act, asked)
        if act in _NOTHING:
            return self._nothing(sentence, act)
        note = _SPEED if act in ("faster", "slower") else ""
        return Signal(sentence, 1.0, (), span, control=act, text=note)

    def _nothing(self, sentence: str, act: str) -> Outcome:
        text = _NOTHING[act]
        return Refusal(
            sentence, 0.0, (), (0, len(sentence)), reason="dialogue", text=text, suggestions=offers(self.now)
        )

    def _agreed(self, sentence: str, act: str, asked: Question | None) -> Outcome | None:
        """Return what comes of a yes, or of leaving the choice to the robot."""
        if asked is not None and asked.choices and (act == "any" or len(asked.choices) == 1):
            return replace(asked.choices[0], sentence=sentence)
        if asked is not None and act == "yes" and len(asked.candidates) != 1:
            return replace(asked, sentence=sentence)
        if act == "any" and asked is not None and not asked.candidates and self.last is not None:
            anywhere = replace(self.last.steps[-1], places=ON_TABLE)
            return self._settle(sentence, Reading((*self.last.steps[:-1], anywhere)))
        if asked is not None and self.last is not None:
            found = (self._filled(sentence, asked, index) for index in asked.candidates)
            return next((outcome for outcome in found if isinstance(outcome, Plan)), None)
        asked_of = self.turns[-1].sentence if self.turns and act == "yes" else ""
        command = proposal(asked_of) or asked_deed(asked_of) or self._demonstrated(sentence)
        tried = self.copy()._command(command, ()) if command else None
        if isinstance(tried, Plan):
            return replace(tried, sentence=sentence)
        return Answer(sentence, 0.5, (), (0, len(sentence)), text=f"Good. {_NEXT}") if act == "yes" else None

    # ---- Questions

    def _asked(self, sentence: str, text: str, made: tuple[Gesture, ...] = ()) -> Outcome | None:
        """Return the answer to a turn that asks, or what is to be done after it; None if it asks nothing."""
        parts = parts_of(text)
        for at, part in enumerate(parts):
            rest = " ".join(part.words)
            later = [i for i in range(at, len(parts) - 1) if parts[i].mark in ".!?"]
            end = later[0] if later else len(parts) - 1
            words = " , ".join(" ".join(each.words) for each in parts[at : end + 1])
            asked = question(words + parts[end].mark)
            if asked is None and parts[end].mark == "?" and _ANY.match(words):  # "anything red here?"
                asked = question(f"is there {words}")
            if asked is not None and _ROOM_THERE.match(asked) and end + 1 < len(parts):
                return None  # the wording says what is put there
            if asked is not None and ABLE.match(asked) and _CERTAIN.search(sentence):  # "can you stack the cubes?"
                asked = None
            if asked is None and at == 0 and self.open_question() is None:
                asked = self._asked_again(rest, part.mark)
            if asked is None:
                rest, looks = self._looked_for(rest, parts[at + 1 :])
                label = part.mark == ":" and at + 1 < len(parts) and not command_word().match(rest)
                known = part.act is not None or looks or label or self._is_topic(rest, parts[at + 1 :])
                if not known and not (
                    parts[-1].mark == "?" and question(" ".join(parts[-1].words)) and asks_nothing(rest)
                ):
                    return None
                continue
            after = text[parts[end].end :]
            return self._told(sentence, asked, after if end + 1 < len(parts) else "", made)
        return None

    def _is_topic(self, words: str, later: list[Part]) -> bool:
        """Whether words only name what a later question is about: "the lever - what colour does it have?"."""
        asking = [part for part in later if question(" ".join(part.words))]
        if not asking or (asking[0].words[0] in ("which", "who", "whose") and asking[0].mark != "?"):
            return False
        tokens = scan(words)
        entity, things = Questions(self.now, self.planner(), self.turns).refs(
            re.sub("^(?:and|now|so) |what about", "", words)
        )
        if entity is None or not things or re.search(rf"\b(?:{verb_words()})\b", words) or len(tokens) > 6:
            return False
        self.it = tuple(things[:1])
        self.box = things[0] if things[0] in self.now.containers else self.box
        return True

    def _asked_again(self, words: str, mark: str) -> str | None:
        """Return the last question with another phrase: "what is in the drawer?", "and in the fridge?".

        mark: the sign after the words.
        """
        last = self.turns[-1] if self.turns else None
        match = re.match(r"(?:and|what about|how about|and what about|or)\b ?(.+)$", words)
        answered = last is not None and isinstance(last.outcome, Answer)
        earlier = (question(" ".join(part.words)) for part in parts_of(last.sentence)) if last and answered else ()
        before = next((asked for asked in earlier if asked), None)
        placed = rf"\b(?:{verb_words()})\b|\bon (?:top(?: of)? ?)?(?:it|that|those|)$"  # says what is to be done
        if match is None or before is None:
            return None
        beside = _BESIDE_IT.match(match[1]) and (mark == "?" or not match[1].startswith("on "))
        if beside and re.match("where|what|which", before):
            return f"what is {match[1]}"
        if re.search(placed, match[1]):
            return None
        planner = self.planner()
        new, old = (phrase(self.now, planner, scan(text))[0] for text in (match[1], before))
        if new is None or old is None or not (old.noun or old.colors or old.relations) or "can you" in before:
            return None
        words_before, words_new = (before.split(), match[1].split())
        old_words = scan(before)[slice(*old.span)]
        anchored = old.relations[-1].anchors[:1] if old.relations else ()
        target = anchored[0] if anchored and (new.relations or words_new[0] in _PREPOSITIONS) else old
        first, last_word = target.span
        if target is old and old.relations and not new.relations and last_word == len(words_before):
            last_word = max(min(each.span[0] for each in old.relations), first + 1)  # "is X left of Y?", "and Z?"
        while first < last_word and words_before[first] in (
            "is",
            "are",
            "do",
            "does",
            "was",
            "has",
            "have",
            "still",
            "in",
        ):
            first += 1
        return (
            " ".join([*words_before[:first], *words_new[new.span[0] :], *words_before[last_word:]])
            if old_words
            else None
        )

    def _told(self, sentence: str, asked: str, rest: str, made: tuple[Gesture, ...] = ()) -> Outcome | None:
        """Return the answer to a question, or the outcome of what is said after it."""
        world, span = self.now, (0, len(sentence))
        command = proposal(asked)
        if command is not None and not self._asks_why(asked, command):
            wished = self.copy()._command(command, made) if re.match(r"why (?:do|would) ", asked) else None
            return wished if isinstance(wished, Plan) else self._supposed(sentence, command)
        known = Questions(world, self.planner(made), self.turns, self.body)
        if known.pointed:
            known.planner.it = tuple(known.pointed)
        told = known.answer(asked)
        about, self.compared = tuple(dict.fromkeys(known.things)), known.compared
        boxes = [i for i in world.containers if world.things[i].kind in asked.split()]
        if len(boxes) == 1 and told is not None:  # "which one is nearest to the drawer?"
            self.box = boxes[0]
        if rest:
            trial = self.copy()
            named = about or self._told_of(asked)
            trial.it, trial.box = (*named[:1],) or self.it, next((i for i in named if i in world.containers), self.box)
            if (then := re.match(r"\W*if (not|so|yes|no|it is not|it is)(?:\W) ?(.+)", rest, re.S | re.I)) and told:
                if (then[1] in ("so", "yes", "it is")) != told.lower().startswith("yes"):
                    return Answer(sentence, 1.0, (), span, about=about, text=told)
                rest = re.sub(r"^(?:is|are|has|was) ", "", asked) if IT_SHALL.match(then[2]) else then[2]
            outcome = trial._answer(rest, ()) if parts_of(rest) else None
            self.homeward = trial.homeward
            exclaims = told is None and re.match(r"what an? ", asked)  # "what a nice one! now ..."
            if isinstance(outcome, Plan | Question) or ((then or exclaims) and isinstance(outcome, Refusal)):
                return outcome
        if told is not None:
            return Answer(sentence, 1.0, (), span, about=about, text=told)
        if re.match(r"(?:did|do|are|have|were|can|will|is|was) (?:you|it|that|this|weather)\b", asked):
            return Answer(sentence, 1.0, text=f"I am a robot arm, and do what I can. {abilities(world)}")
        unknown = r"(?:what|which|who|whose|why|when|how)\b|(?:is|are|does|did|has|have|had|was|were) "
        where = r"where (?:is|are|does|did) (?!.*\b(?:put|move|bring|take|stack|pick|give|drop|set|lay|get)\b)"
        if re.match(unknown, asked) or (re.match(where, asked) and self.open_question() is None):
            return self._unknown(sentence, asked.split())
        return None

    def _unknown(self, sentence: str, words: Sequence[str]) -> Refusal:
        """Return the refusal of a question that cannot be answered."""
        unknown = [word for word in words if word not in vocabulary() and word.isalpha()]
        what = " ".join(unknown[:3] or words[:8])
        text = f"I cannot answer that: I know nothing about '{what}', only about the things here"
        offered = offers(self.now, words)
        return Refusal(sentence, 0.0, (), (0, len(sentence)), reason="nothing", text=text, suggestions=offered)

    def _supposed(self, sentence: str, command: str) -> Outcome:
        """Return what would come of a command: "could it go on the red one?"."""
        tried = self._signal(command, command.split()) or self.copy()._command(command, ())
        about = tried.about
        if isinstance(tried, Plan):
            about = tuple(dict.fromkeys(i for step in tried.steps for i in (step.object, step.goal) if i is not None))
            goals = {step.goal for step in tried.steps if step.carries}
            full = [box for box in self.now.containers if box in goals and self.now.contents(box)]
            can = "" if sentence.lower().startswith("what") else "yes, that can be done: "
            text = f"{can}I would {said(self.now, tried.steps)}. Say 'do it' if you want that"
            if full:
                text = f"no: one thing fits in {name(self.now, full[0])}, and it is full"
        elif isinstance(tried, Question) and tried.candidates:
            text = f"yes, that can be done, for example with {name(self.now, tried.candidates[0])}: say with which"
        elif isinstance(tried, Signal):
            text = f"say {command!r}"
        else:
            text = f"no: {getattr(tried, 'text', '')}" if isinstance(tried, Refusal) else tried.message
        return Answer(sentence, 0.8, (), (0, len(sentence)), about=about, text=text[0].upper() + text[1:])


def interpret(
    sentence: str, scene: Scene | WorldModel, dialogue: Dialogue | None = None, pointed: Pointed = ()
) -> Outcome:
    """Return what a sentence means in a scene. Never raise for any sentence.

    Args:
        sentence: as a person writes it.
        scene: a table's scene, or a `WorldModel`: of a board or a room, or with something in the gripper.
        dialogue: what was said and done before; it remembers this sentence. None: a new one.
        pointed: what gestures show, in the order of the words that need one ("this", "that", "here", "there"): the
            index of an object; a sequence of indices where a gesture may show any of them; or a `Gesture`, also for
            a free place of the table. If there are more such words than gestures, the last serves for the rest.

    Raises:
        LanguageError: `pointed` has an index that the scene lacks.
    """
    return (dialogue or Dialogue()).answer(sentence, scene, pointed)


def _social(sentence: str, world: WorldModel) -> Answer:
    """Return the answer to small talk: to a greeting, thanks, a farewell, or anything else."""
    thanks = re.search(r"\b(?:than[kx]|ty\b|tysm\b)", sentence.lower()) is not None
    if says(sentence, "farewells"):
        return Answer(sentence, 1.0, text="You are welcome. Goodbye" if thanks else "Goodbye")
    if says(sentence, "invitations"):
        return Answer(sentence, 1.0, text=abilities(world))
    if thanks:
        text = "You are welcome"
    elif says(sentence, "greetings"):
        examples = " or ".join(repr(each) for each in offers(world))
        return Answer(sentence, 1.0, text=f"Hello! I am a robot arm. Say what I shall do, for example {examples}")
    else:
        text = "All right"
    return Answer(sentence, 1.0, text=f"{text}. {_NEXT}")


def _certain(made: Sequence[Gesture]) -> list[int]:
    """Return the things of gestures that show one; [] if one is uncertain."""
    return [each.things[0] for each in made] if all(len(each.things) == 1 for each in made) else []
