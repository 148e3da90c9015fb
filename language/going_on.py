"""Sentences that go on from what was done: "on the other side", "the same on the right", "not that one either"."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from language.acts import Part, question, takes_back
from language.corrections import Corrections
from language.meanings import Clause, Entity, Gesture, Reading, RelationPhrase
from language.memory import carried
from language.outcomes import Answer, Outcome, Plan, Question, Refusal
from language.planning import CARRY
from language.replies import BESIDE
from language.revising import TURNED, filled, pinned
from language.scanning import COLOR, THING, scan
from language.settling import which
from language.talk import name, phrase

_IDLE = r"(?:(?:please|now|then|and|so|but|okay|well|just|also|oh|hm|no|sorry|actually|good|great|fine|thanks|,|\.) )*"
_FAR_SIDE = re.compile(
    r"(?P<far>(?:,? ?(?:but )?(?:at|in) (?:exactly )?same distance(?: away)?,? )?)(?:but |over )?(?:on|to|at|onto) "
    r"(?:its |it 's )?(?:other|opposite|far(?= side of it)) side"
    rf"(?: (?:of|from) (?P<of>it|that(?: one)?|this|(?:{COLOR})(?: one| cube| block| ball)?|\w+(?= ?$)))?"
)
_BETWEEN = re.compile(  # what the other side comes to: "so that gray is in the middle"
    r"^(?: ,)? (?:so|such|so that|such that) \w+(?: one| cube| block)? (?:is|stands|sits|ends up|will be|comes)"
    r"(?: right)? (?:in middle|between (?:them|two|both|those)|in between)(?: of (?:them|two|both))?"
)
_SIDES = {"left": "to left of", "right": "to right of", "front": "in front of", "behind": "behind"}
_ELSEWHERE = re.compile(  # "the same with X, right side"
    rf"{_IDLE}(?:do |repeat )?(?:exactly )?same(?: thing| again)? (?:with|for|to) (?P<what>[^,.;]+?)"
    r"(?: ,| \.)?(?: but| only| just| this time)* (?:(?:on|to|at|in) )?(?:its )?"
    r"(?P<side>left|right|front|behind|other|back)"
    r"(?: hand)?(?: side)?(?:(?: of)? (?:it|that(?: one)?))?(?: this time| instead| please)*"
)
_NOW_THIS = re.compile(r"(?:(?:and|so|okay|ok|good|,) )*(?:now|then) (?P<what>[\w ]+?)(?: then| please| again)*")
_BOTH_ELSE = re.compile(  # "the same with the orange one and the fridge": another thing and another place
    rf"{_IDLE}(?:do |repeat )?(?:exactly )?same(?: thing| again)? (?:with|for|using) (?P<one>[^,.;]+?)"
    r" (?:and|in|into|on|onto|with) (?P<other>[^,.;]+?)(?: please| now| too| as well)*"
)
_AFTER_ALL = r"(?: after all| either| any ?more| any longer| then| anyway| please)*"
_NOT_THAT = re.compile(
    rf"{_IDLE}not (?P<what>that(?: one)?|this(?: one)?|it|(?:(?!after\b|another\b|other\b)\w+ ?){{1,3}}?)"
    rf"(?P<all>{_AFTER_ALL})"
    r"(?P<other>(?:(?: ,| \.| ;)*(?: but| please| maybe| rather| give me| take| use)*"
    r" (?:a )?(?:another|other|different|some other|any other)(?: one| cube| block)?)?(?: please| instead)*)"
)
_BEFORE = r"on|onto|on top of|in|into|next to|near|beside|behind|of|to|under|at"
_MEANT = re.compile(
    rf"{_IDLE}(?:i (?:meant|mean)|it was) (?P<what>[\w ]+?)(?: after all| first| in fact| sorry| please)*"
)
_RETRY = re.compile(
    rf"{_IDLE}(?:(?:you can|you may|can you|could you|try to|try and|go ahead and|go on and|let us|maybe) )*{_IDLE}"
    r"(?:do (?:it|that|so|what i (?:said|asked|wanted)(?: before| first| earlier)?)|try(?: (?:it|that))?)"
    r"(?P<when>(?: (?:now|again|once more|then|please|after all))*)"
)
_BARE = re.compile(  # a relation to the thing beside which something was put
    rf"{_IDLE}(?:(?:place|put|set|move) (?:it|that) )?(?P<place>on top|behind|in front|beside)"
    r"(?: of (?:it|that))?(?: then| please| instead)*"
)
_ON_TOP = re.compile(rf"{_IDLE}(?P<what>(?:(?:{COLOR}) ?(?:one|cube|block)?|(?:{THING}))) on top(?: then| please)*")
_BARE_WORDS = {"on top": "on top of", "behind": "behind", "in front": "in front of", "beside": "next to"}
_BOX_TOO = re.compile(
    rf"{_IDLE}(?:do |repeat )?(?:exactly )?same(?: thing| again)? (?:with|for|to|in) "
    rf"(?P<box>(?:(?:{COLOR}) )?\w+)(?: please| now| too| as well)*"
)
_SWAPS = re.compile(r"\b(?:swap|exchange|switch|trade)\b", re.IGNORECASE)
_WITH = re.compile(rf"{_IDLE}(?P<one>[\w ]+?) (?:with|for) (?P<other>[\w ]+?)(?: please| now| too| as well| then)*")
_SHOWN_WITH = re.compile(
    rf"{_IDLE}(?:(?:can|could) you )?(?:show (?:me|us)(?: how| it| that)?|(?:try|do) (?:it|that)|demonstrate(?: it)?)"
    r" (?:with|on|using) (?P<what>[\w ]+?)(?: please| then)*"
)
_ABILITY = re.compile(
    r"^(?:\W*(?:and|so|hi|hey|hello|robot)\b\W*)*(?:can|could|do|are) you (?:able to |also |even |really )*"
    r"(?P<verb>.+?) (?:things|stuff|something|anything|objects|cubes|blocks|a cube|a block)(?P<after>(?: \w+)?)\W*$",
    re.IGNORECASE,
)


@dataclass
class GoingOn(Corrections):
    """Understands sentences that say only what is different from what was done, asked or refused last."""

    def _beside(self) -> tuple[int, int, RelationPhrase] | None:
        """Return what was put beside another thing last, that thing, and in which relation to it."""
        for turn in reversed(self.turns):
            outcome = turn.outcome
            reading = outcome.reading if isinstance(outcome, Plan) else None
            for clause in reversed(reading.steps if reading is not None else ()):
                place = next((each for each in clause.places if each.name in BESIDE and each.anchors), None)
                moved = [step.object for step in carried(outcome)]
                if place is None or not moved or place.anchors[0].kind not in ("thing", "it"):
                    continue
                shown = place.anchors[0].pointed
                others = [i for i in turn.about if i not in moved]
                if place.anchors[0].kind == "it":  # what was spoken of before
                    others += [i for i in self.planner().recent if i not in moved and self.now.is_loose(i)]
                anchor = shown.things[0] if isinstance(shown, Gesture) and shown.things else next(iter(others), None)
                if anchor is not None:
                    return moved[-1], anchor, place
        return None

    def _far_side(self, text: str) -> str | None:
        """Return plain words with the side of a thing that is opposite to where another one was put; or None.

        text: the words of the sentence.
        """
        match, put = _FAR_SIDE.search(text), self._beside()
        if match is None or not match.start() or self.now.cells:
            return None
        if match["of"] == "table" or (put is None and not match["of"]):
            return self._across_table(text[: match.start()], text[match.end() :])
        said = match["of"] if match["of"] not in ("it", "that", "that one", "this") else None
        words = f"{said} one" if said and " " not in said else said
        refs = phrase(self.now, self.planner(), scan(words))[1] if words else []
        named = [i for ref in refs for i in ref.things[-1:] if not self.now.things[i].target]
        anchor = named[0] if named else put[1] if put is not None and not said else None
        done = self.done()
        moved = [step.object for step in carried(done and done.outcome)]
        there = [i for i in reversed(moved) if i != anchor and self.now.is_on_ground(i)]
        there = there or ([put[1]] if put is not None and put[0] == anchor else [])  # "Z on the other side of X"
        if anchor is None or not there or name(self.now, there[0]) in text:
            return None
        world, (one, other) = self.now, (self.now.things[there[0]], self.now.things[anchor])
        off = one.x - other.x, one.y - other.y
        side = _SIDES[self._opposite_side(*off)]
        apart = 100 * (math.hypot(*off) - (one.width + other.width) / 2)
        rest = _BETWEEN.sub("", text[match.end() :])
        measure = f"{max(apart, 1):.0f} cm " if match["far"] else ""
        head = "put it " if text[: match.start()].strip() == "no" else text[: match.start()]
        return f"{head}{measure}{side} {name(world, anchor)}{rest}"

    def _across_table(self, before: str, after: str) -> str | None:
        """Return plain words with the side of the table on which the thing that they name does not stand; or None.

        before, after: the words beside "to the other side of the table".
        """
        world, refs = self.now, phrase(self.now, self.planner(), scan(before))[1]
        things = [i for ref in refs[:1] for i in ref.things if world.is_loose(i)]
        if not things:
            return None
        off = world.things[things[-1]].y - world.center[1]
        side = "right" if off * world.toward("left")[1] > 0 else "left"
        return f"{before}to {side} side of table{after}"

    def _same_elsewhere(self, sentence: str, text: str) -> Outcome | None:
        """Return the plan of "the same with X, right side" after something was put beside another thing."""
        match, put = _ELSEWHERE.fullmatch(text), self._beside()
        if match is None or put is None:
            return None
        _, anchor, place = put
        entity, refs = self._whole(match["what"])
        if entity is None or not refs:
            return None
        side = {"back": "behind", "other": TURNED.get(place.name, "")}.get(match["side"], match["side"])
        if not side:
            return None
        beside = replace(place, name=side, anchors=(pinned(anchor),))
        loose = replace(entity, noun=entity.noun or "cube") if self._fits(replace(entity, noun="cube")) else entity
        return self._settle(sentence, Reading((Clause(CARRY, loose, (beside,)),)))

    def _same_with_both(self, text: str) -> Outcome | None:
        """Return what the last command comes to with another thing and another place; None of other words."""
        match, done = _BOTH_ELSE.fullmatch(text), self.done()
        put = [(step.object, step.goal) for step in carried(done and done.outcome) if step.goal is not None]
        if match is None or done is None or not put or self.now.cells:
            return None
        things = self.now.things
        new = [self._things(match[each])[:1] for each in ("one", "other")]
        if not all(new):
            return None
        new.sort(key=lambda found: not self.now.is_loose(found[0]))  # what moves is first
        command = done.sentence.lower()
        for was, (now,) in zip(put[-1], new, strict=True):
            phrase_of = rf"\b{things[was].kind}\b" if was in self.now.containers else rf"\b{things[was].color}\b"
            word = things[now].kind if was in self.now.containers else things[now].color
            command, found = re.subn(phrase_of, word, command)
            if not found or self.now.is_loose(was) != self.now.is_loose(now):
                return None
        return self.copy()._answer(command, ())

    def _like_before(self, text: str) -> Outcome | None:
        """Return what comes of what was done last with another relation, container or pair; None of other words."""
        command = self._on_last(text) or self._bare_place(text) or self._box_too(text)
        command = command or self._pair_too(text) or self._shown_with(text)
        outcome = self.copy()._answer(command, ()) if command else None
        return outcome if isinstance(outcome, Plan) else None

    def _on_last(self, text: str) -> str | None:
        """Return the command of "the yellow one on top", said after one thing was put on the table; or None."""
        match, done = _ON_TOP.fullmatch(text), self.done()
        moved = [step.object for step in carried(done and done.outcome)] if match else []
        if match is None or len(moved) != 1 or not self.now.is_on_ground(moved[0]) or self.now.cells:
            return None
        return f"put {match['what']} on top of {name(self.now, moved[0])}"

    def _bare_place(self, text: str) -> str | None:
        """Return the command of "behind" or "on top", said after a thing was put beside another one; or None."""
        match = _BARE.fullmatch(text)
        if match is None or self.open_question() or self.now.cells:
            return None
        put, done = self._beside(), self.done()
        moved = [step.object for step in carried(done and done.outcome)]
        if put is None or moved[-1:] != [put[0]]:
            return None
        return f"put {name(self.now, put[0])} {_BARE_WORDS[match['place']]} {name(self.now, put[1])}"

    def _box_too(self, text: str) -> str | None:
        """Return the last command for what is in another container: "the same for the drawer"; or None."""
        match, done = _BOX_TOO.fullmatch(text), self.done()
        if match is None or done is None or done is not self.turns[-1]:
            return None
        emptied = any(step.object in done.world.inside for step in getattr(done.outcome, "steps", ()))
        return self._in_other_box(done.sentence, match["box"]) if emptied else None

    def _pair_too(self, text: str) -> str | None:
        """Return the command of "now red with the cyan one", said after two things were swapped; or None."""
        match = _WITH.fullmatch(text)
        turns = [turn for turn in self.turns[-3:] if isinstance(turn.outcome, Plan)]
        if match is None or not turns or not _SWAPS.search(turns[-1].sentence):
            return None
        named = all(self._whole(match[each])[1] for each in ("one", "other"))
        return f"swap {match['one']} and {match['other']}" if named else None

    def _shown_with(self, text: str) -> str | None:
        """Return the command of "show me with the red one", said after "can you pick things up?"; or None."""
        match, last = _SHOWN_WITH.fullmatch(text), self.turns[-1] if self.turns else None
        asked = _ABILITY.match(last.sentence) if match and last and isinstance(last.outcome, Answer) else None
        return f"{asked['verb']} {match['what']}{asked['after']}" if match and asked else None

    def _demonstrated(self, sentence: str) -> str | None:
        """Return the command of "try it" or "show me" after an answer about a thing; None of other words."""
        world, words, last = self.now, sentence.lower(), self.turns[-1] if self.turns else None
        thing = last.about[-1] if last is not None and isinstance(last.outcome, Answer) and last.about else None
        if thing is None:
            return None
        if "try" in words and thing in world.devices:
            return f"operate {name(world, thing)}"
        box = world.inside.get(thing)
        if "show" in words and (box is not None or world.is_loose(thing)):
            closed = box in world.containers and box not in world.open
            return f"open {name(world, box)}" if box is not None and closed else f"reach {name(world, thing)}"
        return None

    def _fits(self, entity: Entity) -> bool:
        return any(ref.things for ref in self.planner().resolver(self.now, ()).resolve(entity))

    def _not_that(self, sentence: str, words: Sequence[str]) -> Outcome | None:
        """Return the question that "not that one after all" leads to, after something was done with it."""
        match, done = _NOT_THAT.fullmatch(" ".join(words)), self.done()
        steps = [step for step in getattr(done and done.outcome, "steps", ()) if not step.implied]
        if match is None or not steps or self.last is None or not (match["all"] or match["other"]):
            return None
        used, world = steps[-1].object, self.now
        shown = re.fullmatch(r"(?:that|this)(?: one)?|it", match["what"])
        if shown is None and not any(used in ref.things for ref in self._whole(match["what"])[1]):
            return None
        kind, goal = world.things[used].kind, steps[-1].goal
        left = [i for i, thing in enumerate(world.things) if thing.kind == kind and not thing.target]
        related = [each for clause in self.last.steps if clause.entity for each in clause.entity.relations]
        but = [anchor for each in related if each.name == "not" for anchor in each.anchors]
        resolver = self.planner().resolver(world, ())
        excepted = {i for each in but for ref in resolver.resolve(each)[:1] for i in ref.things[-1:]}
        left = [i for i in left if i not in (used, goal, *excepted)]
        if not left:
            return None
        return Question(sentence, 0.5, text=which(world, left), candidates=tuple(left), reading=self.last)

    def _meant_first(self, sentence: str, text: str) -> Outcome | None:
        """Return the plan with what the last sentence took back: "on yellow, ehm, on cyan", "I did mean yellow"."""
        match, last = _MEANT.fullmatch(text), self.turns[-1] if self.turns else None
        if match is None or last is None or not isinstance(last.outcome, Plan) or self.last is None:
            return None
        words, tokens = [token.text for token in scan(last.sentence)], scan(match["what"])
        _, refs = self._whole(match["what"])
        color = next((token.text for token in tokens if re.fullmatch(COLOR, token.text)), None)
        if color not in words or not refs:
            return None
        index, places = refs[0].things[-1], self.last.steps[-1].places
        done = {i for step in last.outcome.steps for i in (step.object, step.goal)}
        goal = filled(self.last, pinned(index), "goal") if places and places[0].anchors else None
        said = " ".join(words[max(words.index(color) - 3, 0) : words.index(color)])
        if index in done or goal is None or not re.search(rf"\b(?:{_BEFORE})$", said):
            return None
        return self._tried(sentence, [goal], restore=True)

    def _left(self, sentence: str, parts: Sequence[Part]) -> Answer | None:
        """Return the answer to a command that is taken back: "red on blue, or wait, leave it where it is"."""
        words = " ".join(parts[0].words)
        if not takes_back(parts) or question(words) or not re.search(rf"\b(?:{COLOR}|{THING}|it|that|them)\b", words):
            return None
        head = re.split(r" (?:on|onto|in|into|next|to|left|right|behind|under|near|at|beside)\b", words)[0]
        things = [i for ref in phrase(self.now, self.planner(), scan(head))[1] for i in ref.things[-1:]]
        about = tuple(i for i in things if self.now.is_loose(i) and not self.now.things[i].target)[:1]
        text = "All right, I do nothing. Say what I shall do next"
        return Answer(sentence, 1.0, (), (0, len(sentence)), about=about, text=text)

    def _now_possible(self, sentence: str, text: str) -> Outcome | None:
        """Return the plan of what was refused two turns ago, for "now the yellow one", which it was about; or None."""
        match, turns = _NOW_THIS.fullmatch(text), self.turns[-2:]
        if match is None or len(turns) < 2 or not isinstance(turns[1].outcome, Plan):
            return None
        reading = turns[0].outcome.reading if isinstance(turns[0].outcome, Refusal) else None
        about = reading.steps[-1].entity if reading is not None else None
        named = {i for ref in self._whole(match["what"])[1] for i in ref.things[-1:]}
        refs = self.planner().resolver(turns[0].world, self.it).resolve(about) if about is not None else []
        if reading is None or not refs or not {*refs[0].things[-1:]} & named:
            return None
        outcome = self._settle(sentence, reading)
        return outcome if isinstance(outcome, Plan) else None

    def _retried(self, words: Sequence[str]) -> Outcome | None:
        """Return what comes of "now you can do it", where what was asked for before could not be done then."""
        match = _RETRY.fullmatch(" ".join(words))
        turns = [turn for turn in self.turns[-4:] if not isinstance(turn.outcome, Answer)]
        if match is None or not turns:
            return None
        again = {"now", "again", "then"} & {*words}
        refused = [turn for turn in turns if isinstance(turn.outcome, Refusal) and turn.outcome.reading is not None]
        if not refused or not again:
            return None
        return self.copy()._answer(refused[-1].sentence, ())
