"""Replies: answers to a question, and corrections of the last plan."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce

from language import costs
from language.acts import act_of
from language.meanings import Clause, Entity, Gesture, Measure, Reading, RelationPhrase
from language.memory import carried
from language.objects import DEVICES
from language.outcomes import Answer, Outcome, Plan, Question, Refusal, Step
from language.planning import CARRY, Planner
from language.recalling import Recollections
from language.revising import filled, further, is_unshown, region_meant, restoring, revised, selecting, without_detours
from language.scanning import COLOR, Token, scan
from language.settling import Choices, choices_of, matters, settled, which
from language.several import towers_of
from language.spots import on_ground, pinned
from language.steps import LOOSE
from language.talk import name, offers, phrase
from language.verbs import HERE, POINTING, Act, bringing, doing
from language.words import REGIONS
from language.world import FIXED, WorldModel

LITTLE = {"bit", "little", "smidge", "smidgen", "tad", "touch", "hair", "notch"}
_FIRST = (  # at first
    r"(?:(?:(?:at|in|from|to|of|since)(?: very)? (?:start|beginning|outset|first)(?! \w+ (?:cube|block|one))\b"
    r"|originally|initially|at first|(?<=back to )where it (?:started|began)"
    r"|(?:when|before) (?:we|you|i|it|all this|this)(?: all| even| ever)? (?:started|began|start|begin)(?: with)?"
    r"|(?:original|initial|starting|start|first) (?:place|position|spot|location|arrangement|state|order|set ?up"
    r"|layout|situation|configuration)s?)\b)"
)
_ALL = (
    r"(?:everything|all|things|it all|scene|room|board|table|cubes|blocks|objects|pieces|arrangement|state|set ?up"
    r"|layout|situation)"
)
_AS_FIRST = re.compile(
    r"^(?=.*\b(?:back|restore|return|reset|undo|revert|as|like|how|where|way)\b)"
    rf"(?!.*\b(?:arm|gripper|yourself|your)\b).*{_FIRST}"
)
_ALL_BACK = re.compile(
    r"^(?:please |now |and |then |just |can you |could you )*(?:(?:reset|restore|undo|revert|rewind) "
    rf"(?:{_ALL}|all (?:of )?(?:it|that|this)|original \w+)"
    rf"|put (?:{_ALL}|them all|all (?:of )?(?:them|these|those)) back(?: again)?"
    r"(?: (?:to )?(?:where|how|as|like|way)(?: (?:it|they|everything))?(?: (?:was|were|stood))?(?: before| earlier)?)?)"
    r"(?: please| again)*$"
)
_THING_BACK = re.compile(
    r"(?: back)?(?: (?:to|at|in|into|on|onto))?(?: (?:how|where|place|spot|position|its|their|(?:it|that|they) "
    rf"(?:was|were|is|stood|had been|lay|sat)))*(?: ,)? {_FIRST}"
)
_NO_THING = re.compile(r"(?:(?:enough|stop|no|okay|and|now|then|so|go|put|move|bring|back|,)(?: |$))*")
_HEIGHT = re.compile(
    r"^(?:(?:please|now|and|no|okay|just|then|can you|could you|so|go|move|come|get|bring|put|hold|keep|make|it|that"
    r"|this|arm|your|gripper|a|an|bit|little|tad|notch|touch|much|way|some|even|more|slightly|far|not|too|still"
    r"|further|up|down) )*(?P<side>higher|lower|high|low|up|upwards|to top)"
    r"(?: (?:up|down|please|now|a bit|a little|more|again|still|than that))*$"
)
_OF_TOWER = re.compile(  # "the lower cube", "the top one of the stack"
    r"\b(?:(?P<low>lower|bottom|lowest|bottommost|undermost)|upper|top|uppermost|topmost) (?:one|cube|block|brick)\b"
    r"(?: (?:of|in|from|on) (?:that |this )?(?:tower|stack|pile))?(?! (?:of|left|right|on top))"
)
_ONE_MORE = re.compile(  # of a tower: "and another one on top", "make it higher"
    r"(?:(?:and|now|then|please|can you|could you) )*(?:(?:(?:put|place|add|stack|set) )?(?:another|one more)"
    r"(?: one| cube| block)? on (?:top(?: of (?:it|that|them|tower|stack))?|(?:that |this )?(?:tower|stack|pile))"
    r"|(?:make|build) (?:it|(?:that |this )?(?:tower|stack|pile))"
    r" (?:(?:even|a bit|a little|still|one \w+) )*(?:higher|taller))"
    r"(?: as well| too| please| now)*"
)
_BY = re.compile(  # "2 cm more", "another 5"
    r"(?:(?:and|now|no|okay|ok|but|please|,) )*(?:(?P<more>another) )?(?:(?P<length>(?:\d+(?:[.,]\d+)?|\w+)"
    r" (?:cms?|centimet\w+|mm|millimet\w+|inch(?:es)?))|(?P<number>\d+(?:[.,]\d+)?|two|three|four|five|ten))"
    r"(?P<again> more| further| again)?(?: in same direction)?(?: please)?"
)
_WAYS = {"left": "to the left", "right": "to the right", "forward": "forward", "backward": "backward"}
_OF_BOXES = re.compile(  # "in the closed one"
    r"\b(?:in|into|inside) ((?:(?P<open>open|opened)|closed|shut) (?:one|container|box)\b)"
)
_LEVEL = re.compile(  # of a tower that was asked for
    r"(?:(?:no|actually|but|and|now|rather|instead|please|wait|ok|okay|hmm|better|,|i (?:want|need|would like|meant"
    r"|said|prefer)|make|put|have|with|could you|can you) )*"
    rf"(?P<thing>(?:{COLOR})(?: one| cube| block)?)(?: (?:should|must|shall|has to|to|be|is|goes|go|needs|stays))*"
    r" (?:at|on|to|as) (?P<level>bottom|top|very bottom|very top|base)(?: (?:instead|rather|please))*$"
)
_OPPOSITE = re.compile(r"\b(?:(?:diagonally )?opposite|diagonal) corner(?: (?:of table|to (?:it|that)))?\b")
_NEARER = re.compile(
    r"^(?:(?:please|now|and|no|okay|but|just|then|can you|could you|go|move|bring|put|get|make|push|it|that|a|bit"
    r"|little|tad|notch|touch|tiny|much|way|some|even|more|slightly|far|not|so|too|still|again|them|these|those|both"
    r"|two|(?<=not so )(?:near|close)|(?<=too )(?:near|close)) )*"
    r"(?P<how>closer|nearer|(?:is )?(?:still )?not (?:quite |nearly )?(?:close|near) enough"
    r"|(?:further|farther) (?:away|apart|off)|apart|separate(?: (?:them|these|those|both|two))*)"
    r"(?: (?:together|to it|to that|from it|from that|please|now|a bit|a little|again|still|than that))*$"
)
_HELD = re.compile(
    r"\b(?:things?|ones?|cubes?|blocks?|objects?|what|whatever|that) (?:that |which )?(?:(?:you|robot|arm|gripper) "
    r"(?:(?:are|is|still|now|currently|have) )*(?:hold|holds|holding|carry|carries|carrying|grip|gripping|grasping)"
    r"|(?:is |are )?in (?:your|robot) (?:gripper|hand|claw|fingers))\b"
    r"|^(?:please |now )*(?:let go|(?:open|release|relax|loosen)(?: up)? (?:your )?"
    r"(?:gripper|claw|grip|jaws|fingers|hand))(?: now| please| of it| up| wide)*$"
)
_MEANT = re.compile(r"\b(?:meant|mean|sorry|oops|rather)\b", re.IGNORECASE)
PREFERS = re.compile(  # another thing than that with which the last plan did something
    r"\b(?:instead|rather|prefer(?:red)?|better|nicer|replace|after all|in (?:its|that one's) place)\b"
    r"|\bmake (?:that|it)\b|\b(?:will|would|wd|'ll|'d) (?:also )?do\b|\bshould have been\b",
    re.IGNORECASE,
)
BESIDE = ("near", "left", "right", "front", "behind", "toward", "away", "nearest")  # places beside another thing


@dataclass
class Replies(Recollections):
    """Compares a reading with what was asked or done before."""

    def _reply(self, sentence: str, reply: Reading, found: Choices) -> Outcome | None:
        """Return the outcome of an answer, or of a correction of the last sentence."""
        clause, world = replace(reply.steps[0], entity=region_meant(reply.steps[0].entity, self.last)), self.now
        if clause.entity is not None and clause.entity.kind in ("robot", "person"):
            return None
        if clause.entity is not None and clause.entity.kind in REGIONS:  # "no, the far left corner"
            place = RelationPhrase("at", (clause.entity,), span=clause.entity.span)
            clause = replace(clause, entity=None, places=(place, *clause.places))
            reply = replace(reply, steps=(clause, *reply.steps[1:]))
        asked = self.open_question()
        if not world.cells and any(matters(found.lattice, index) for index in reply.unused):
            return None  # a word is left out that may change the meaning
        if len(reply.steps) > 1 or clause.verb is not None:  # "no, take the blue one"
            return self._tried(sentence, [Reading(reply.steps)], found, restore=world.cells, back=True)
        if asked is None and clause.entity is not None and clause.entity.noun in DEVICES and self._carried_last():
            return self._tried(sentence, [Reading((replace(clause, verb=doing(Act.OPERATE)),))], found)
        corrects = reply.rejects or _MEANT.search(sentence)
        if corrects and self.last is not None and (side := on_other_side(self.last.steps[-1], clause)) is not None:
            return self._tried(sentence, [Reading((*self.last.steps[:-1], side))], found, restore=True)
        if asked is None and clause.entity is None and (other := self._other_place(sentence, clause)) is not None:
            return other
        if asked is not None and (ordered := self._in_that_order(asked, clause)) is not None:
            return self._tried(sentence, [ordered], found)
        if asked is not None and not reply.rejects:
            if len(asked.candidates) != 1 and self._unshown(clause.entity, found):
                return replace(asked, sentence=sentence)
            entity = clause.entity or (selecting(clause.places) if asked.candidates else None)
            chosen = self._chosen(sentence, asked, entity, found) if entity is not None else None
            if chosen is not None:
                return chosen
        if self.last is None:
            return None if clause.entity is None else self._what(sentence, clause.entity)
        if self._unshown(clause.entity, found) and not clause.places:
            return Question(sentence, 0.0, text="Which thing do you mean? Name it, or point at it", reading=self.last)
        if world.held is not None and clause.entity is None and not world.cells:
            return self._tried(sentence, [Reading((Clause(CARRY, None, clause.places),))], found, restore=False)
        restore = (reply.rejects or PREFERS.search(sentence)) and (clause.entity is not None or world.cells)
        reply = replace(reply, steps=(replace(clause, entity=self._alike(clause.entity)), *reply.steps[1:]))
        meant = revised(self._beside_chosen(self.last), reply)
        meant = meant if restore else [self._higher(each) for each in meant]
        return self._tried(sentence, meant, found, restore=bool(restore))

    def _carried_last(self) -> bool:
        """Whether the last sentence was carried out and was about a thing that is carried."""
        done = bool(self.turns) and isinstance(self.turns[-1].outcome, Plan)
        return done and self.last is not None and self.last.steps[-1].act in LOOSE

    def _in_that_order(self, asked: Question, clause: Clause) -> Reading | None:
        """Return the last reading for all that was asked about, in an order: "both, the drawer first"; or None."""
        orders = tuple(place for place in clause.places if place.name == "order")
        if not orders or self.last is None or not asked.candidates:
            return None
        every = Entity("list", parts=tuple(pinned(i) for i in asked.candidates))
        last = self.last.steps[-1]
        return Reading((*self.last.steps[:-1], replace(last, entity=every, places=(*last.places, *orders))))

    def _alike(self, said: Entity | None) -> Entity | None:
        """Return a phrase such as "the cyan one" as one for the kind of thing that was named before, if one fits."""
        last, things = self.last.steps[-1].entity if self.last is not None else None, self.now.things
        if said is None or said.kind != "thing" or said.noun is not None or not said.colors or last is None:
            return said
        pin = last.pointed.things[:1] if isinstance(last.pointed, Gesture) else ()
        alike = replace(said, noun=last.noun or next((things[i].kind for i in pin), None))
        fits = alike.noun is not None and any(
            ref.things for ref in self.planner().resolver(self.now, ()).resolve(alike)
        )
        return alike if fits else said

    def _beside_chosen(self, last: Reading) -> Reading:
        """Return the last reading with the thing that its place was beside: the one that was chosen."""
        done, clause = self.done(), last.steps[-1]
        place = clause.places[0] if clause.places else None
        if done is None or getattr(done.outcome, "reading", None) is not last or place is None or self.now.cells:
            return last
        at = [step.place for step in carried(done.outcome) if step.place is not None]
        if place.name not in BESIDE or len(place.anchors) != 1 or place.anchors[0].kind != "thing" or not at:
            return last
        refs = [ref for ref in self.planner().resolver(done.world, ()).resolve(place.anchors[0]) if ref.things]
        if len(refs) < 2:
            return last
        chosen = min(refs, key=lambda ref: math.dist((ref.x, ref.y), at[-1]))
        beside = replace(place, anchors=(pinned(chosen.things[-1]),))
        return replace(last, steps=(*last.steps[:-1], replace(clause, places=(beside, *clause.places[1:]))))

    def _higher(self, reading: Reading) -> Reading:
        """Return a reading whose place was said before as on top of the tower that is there since."""
        *before, clause = reading.steps
        if clause.act is Act.BUILD and clause.entity is not None and clause.entity.kind == "thing" and self.it:
            return Reading((Clause(CARRY, clause.entity, (RelationPhrase("on", (pinned(self.it[0]),)),)),))
        place = next((each for each in clause.places if each.name == "on" and each.anchors), None)
        said = (
            [anchor for step in self.last.steps for each in step.places for anchor in each.anchors] if self.last else []
        )
        if place is None or not any(place.anchors[0] is anchor for anchor in said):
            return reading
        refs = self.planner().resolver(self.now, self.it).resolve(place.anchors[0])
        over = self.now.above[refs[0].things[-1]] if refs and refs[0].things else None
        if over is None or over not in self.it:
            return reading
        new = replace(place, anchors=(pinned(over),))
        return replace(reading, steps=(*before, replace(clause, places=(new, *clause.places[1:]))))

    def _restored(self, sentence: str, text: str) -> Outcome | None:
        """Return the outcome of "everything back to how it was in the beginning", or of a thing back to there.

        text: the words of the sentence.
        """
        world = self.now
        first = _AS_FIRST.search(text)
        if not first and not _ALL_BACK.match(text):
            return None
        only: tuple[int, ...] = ()
        if not re.search(rf"\b{_ALL}\b", text):
            what = _THING_BACK.sub("", text)
            entity, refs = phrase(world, self.planner(), scan("it" if _NO_THING.fullmatch(what) else what))
            only = tuple(dict.fromkeys(i for ref in refs for i in ref.things[-1:] if world.is_loose(i)))
            if entity is None or not only:
                return None
            if len(only) > 1 and not entity.plural and not entity.every:
                return Question(sentence, 0.5, text=which(world, only), candidates=only, reading=self.last)
        then = self.turns[0].world if self.turns else world
        steps = restoring(world, then, only=only)
        kept = [i for i in world.devices if abs(world.moved.get(i, 0.0) - then.moved.get(i, 0.0)) > 0.5]
        stays = [name(world, i) for i in kept if not only and not any(step.object == i for step in steps)]
        note = f"{' and '.join(stays)} cannot be moved back" if stays else ""
        what = name(world, only[0]) if len(only) == 1 else "everything"
        if not steps and any(i in world.inside and i in world.home for i in only):
            return None  # it was moved before the conversation: back to its home
        if not steps:
            return Answer(sentence, 1.0, text=f"{what.capitalize()} is where it was at first{note and f', but {note}'}")
        result = reduce(WorldModel.after, steps, world)
        notes = (f"I put {what} back to where it was at first", *([note] if note else []))
        return Plan(sentence, 1.0, (), (0, len(sentence)), steps=steps, result=result, notes=notes)

    def _raised(self, sentence: str, text: str) -> Outcome | None:
        """Return the refusal of "a bit higher": a thing is held at one height, or none is held.

        text: the words of the sentence.
        """
        world = self.now
        height = _HEIGHT.match(text)
        if height is None or world.only is not None or self.open_question() is not None:
            return None
        side = height["side"].replace("to top", "to the top")
        if side == "up" and world.held is None and self.planner().it and re.search(r"\b(?:again|back)\b", text):
            return self._tried(sentence, [Reading((Clause(bringing("up"), Entity("it")),))])
        if world.held is not None and side in ("low", "lower"):  # that puts it down
            return None
        why = f"nothing is in my gripper that could go {side}: tell me first what to pick up"
        if world.held is not None:
            why = f"{name(world, world.held)} cannot go {side}: I carry things at one height"
        return Refusal(sentence, 0.0, (), (0, len(sentence)), "impossible", text=why, suggestions=offers(world))

    def _reordered(self, text: str) -> str | None:
        """Return what "blue at the bottom" asks for after a tower, "the opposite corner" after a place; or None.

        text: the words of the sentence.
        """
        place = self._opposite_corner(text) or self._far_side(text) or self._told_apart(text) or self._farther_by(text)
        if place is not None:
            return place
        match = _LEVEL.match(text)
        last = self.last.steps[-1] if self.last is not None else None
        if match is None or last is None:
            return None
        named = phrase(self.now, self.planner(), scan(match["thing"]))[1]
        pair = next((tower for tower in towers_of(self.now, self.it) if len(tower) == 2), None)
        if pair is not None and any(set(pair) & {*ref.things} for ref in named):
            under, over = pair
            asked = under if match["level"].endswith(("bottom", "base")) else over
            stays = any(ref.things[-1:] == (asked,) for ref in named)
            upper, lower = (over, under) if stays else (under, over)
            return f"put {name(self.now, upper)} on {name(self.now, lower)}"
        if last.act is not Act.BUILD or self.now.flat_only:
            return None
        if self.it and not any(ref.things[-1] in self.it for ref in named if ref.things):  # the tower grows
            return None
        return f"stack them all, {match['thing']} at the {match['level']}"

    def _far_side(self, text: str) -> str | None:
        raise NotImplementedError

    def _told_apart(self, text: str) -> str | None:
        """Return plain words with the name of "the lower cube" of the only tower, "the closed one" of two; or None."""
        world, box = self.now, _OF_BOXES.search(text)
        boxes = [i for i in world.containers if (i in world.open) == bool(box and box["open"])]
        if box is not None and len(boxes) == 1:
            return f"{text[: box.start(1)]}{name(world, boxes[0])}{text[box.end() :]}"
        if _ONE_MORE.fullmatch(text) and (one := self._one_more()) is not None:
            return one
        found = list(_OF_TOWER.finditer(text))
        towers = towers_of(world)
        if len(found) != 1 or world.cells or len(towers) != 1 or "stacked" in text:
            return None
        match = found[0]
        meant = towers[0][0] if match["low"] else towers[0][-1]
        return f"{text[: match.start()]}{name(world, meant)}{text[match.end() :]}"

    def _farther_by(self, text: str) -> str | None:
        """Return plain words for "2 cm more" after something was moved to one side, or None."""
        match, done = _BY.fullmatch(text), self.done()
        reading = done.outcome.reading if done is not None and isinstance(done.outcome, Plan) else None
        place = next(iter(further(reading).steps[-1].places), None) if match and reading is not None else None
        if match is None or place is None:
            return None
        more = place.measure is not None and (match["more"] or match["again"])
        length = match["length"] or (f"{match['number']} cm" if more else None)
        towards = self.planner().resolver(self.now, self.it).resolve(place.anchors[0]) if place.anchors else []
        if length and place.name == "toward" and towards and towards[0].things:
            return f"move it {length} closer to {name(self.now, towards[0].things[-1])}"
        return f"move it {length} {_WAYS[place.value]}" if length and place.value in _WAYS else None

    def _one_more(self) -> str | None:
        """Return plain words that put a further thing on the tower that was built last, or None."""
        world, top = self.now, next(iter(self.it), None)
        if top is None or world.below[top] is None or world.cells:
            return None
        tower = world.column(world.things[top].x, world.things[top].y)
        free = [i for i in on_ground(world) if i not in tower and world.above[i] is None]
        return f"put {name(world, free[0])} on top of {name(world, tower[-1])}" if free else None

    def _opposite_corner(self, text: str) -> str | None:
        """Return plain words with the corner that is opposite the place where something was put last; or None."""
        match, done, world = _OPPOSITE.search(text), self.done(), self.now
        at = [step.place for step in getattr(done and done.outcome, "steps", ()) if step.place is not None]
        if match is None or not at or world.cells:
            return None
        x0, x1, y0, y1 = world.bounds
        off = at[-1][0] - (x0 + x1) / 2, at[-1][1] - (y0 + y1) / 2
        far, left = (sum(a * b for a, b in zip(world.toward(side), off, strict=True)) for side in ("far", "left"))
        corner = f"{'near' if far > 0 else 'far'} {'right' if left > 0 else 'left'} corner"
        return f"{text[: match.start()]}{corner}{text[match.end() :]}"

    def _unheld(self, sentence: str, text: str) -> Outcome | None:
        """Return the refusal of what is to be done with a thing in the gripper, where that is empty.

        text: the words of the sentence.
        """
        if self.now.held is not None or not _HELD.search(text):
            return None
        why, offered = "nothing is in my gripper: tell me first what to pick up", offers(self.now)
        return Refusal(sentence, 0.0, (), (0, len(sentence)), "impossible", text=why, suggestions=offered)

    def _nearer(self, sentence: str, text: str) -> Outcome | None:
        """Return what comes of "a bit closer" after a thing was put beside another one; None of other words.

        text: the words of the sentence.
        """
        match, done, world = _NEARER.match(text), self.done(), self.now
        places = self.last.steps[-1].places if self.last is not None else ()
        anchors = [each for place in places if place.name in BESIDE for each in place.anchors if each.kind == "thing"]
        steps = (
            done.outcome.steps
            if done is not None and any(turn is done for turn in self.turns[-3:]) and isinstance(done.outcome, Plan)
            else ()
        )
        moved = [step.object for step in steps if step.carries and not step.implied]
        if match is None or world.cells or world.held is not None or not moved or not anchors:
            return None
        refs = self.planner().resolver(world, ()).resolve(anchors[-1])
        if not refs or not refs[0].things or refs[0].things[-1] == moved[-1]:
            return None
        other, comes = refs[0].things[-1], not match["how"].startswith(("further", "farther", "apart", "separate"))
        measure = Measure(1.0, "bit") if LITTLE & {*text.split()} else None
        place = RelationPhrase("toward" if comes else "away", (pinned(other),), measure)
        outcome = self._settle(sentence, Reading((Clause(CARRY, pinned(moved[-1]), (place,)),)))
        if not isinstance(outcome, Refusal):
            return outcome
        told = (
            f"{name(world, moved[-1])} is as {'close to' if comes else 'far from'} {name(world, other)} as I can put it"
        )
        return replace(outcome, reason="already", text=told, span=(0, len(sentence)))

    def _unshown(self, entity: Entity | None, found: Choices) -> bool:
        """Whether a phrase is "it" or "this one", and nothing is shown to which that could refer."""
        shows = {*POINTING, *HERE} & {token.text for token in found.lattice.tokens}
        return is_unshown(entity) and (bool(shows) or (entity is not None and entity.kind == "it"))

    def _other_place(self, sentence: str, clause: Clause) -> Outcome | None:
        """Return what comes of "on the other one" after something was put on or in one thing; None of other words."""
        anchor = next((anchor for place in clause.places for anchor in place.anchors if anchor.other), None)
        plans = [turn.outcome for turn in self.turns[-3:] if isinstance(turn.outcome, Plan)]
        carried = [step for plan in plans for step in plan.steps if step.carries and step.goal is not None]
        if anchor is None or anchor.noun or anchor.colors or not carried or self.last is None:
            return None
        mover, goal, world = carried[-1].object, carried[-1].goal, self.now
        assert goal is not None
        left = [i for i in range(len(world.things)) if i not in (mover, goal)]
        kind = world.things[goal].target, world.is_loose(goal)
        others = tuple(i for i in left if (world.things[i].target, world.is_loose(i)) == kind) or tuple(left)
        if len(others) == 1:
            place = replace(clause.places[0], anchors=(pinned(others[0]),))
            return self._tried(sentence, [Reading((Clause(CARRY, pinned(mover), (place,)),))])
        if not others:
            return None
        return Question(sentence, 0.5, text=which(world, others), candidates=others, reading=self.last)

    def _named(self, sentence: str, words: list[Token], found: Choices) -> Outcome | None:
        """Return the plan of a reply of which only a phrase is understood: "let me think, the gray one I guess"."""
        asked = self.open_question()
        if asked is None or not asked.candidates or any(c.cost < costs.TOO_MUCH for c in found.possible):
            return None
        texts = [token.text for token in words]
        at = next((i for i, word in enumerate(texts) if word in ("not", "except", "but", "no", "never")), len(texts))
        if at < len(texts) and at and texts[at] in ("no", "never"):
            return None  # it takes back what it said first
        rest = " ".join(texts[at + 1 :])
        parts = re.split(r" (?:and|or|nor|,)(?: (?:and|or|not|nor))* ", rest) if rest else []
        rejected = [ref for part in parts for ref in phrase(self.now, self.planner(), scan(part))[1]]
        left = tuple(i for i in asked.candidates if i not in {i for ref in rejected for i in ref.things})
        entity = phrase(self.now, self.planner(), words[:at])[0] if at else None
        if self._unshown(entity, found):
            return None
        first, end = entity.span if entity is not None else (0, 0)
        heads = {i for i in range(len(found.lattice)) if found.lattice.is_head(i)}
        if entity is not None and at == len(texts) and (entity.ordinal or heads - {*range(first, end)}):
            return None  # it says more than the phrase
        if len(left) < len(asked.candidates) and (entity is None or entity.any):
            free = entity is not None or len(left) == 1 or act_of(texts[:at]) == "any"
            plans = (self._filled(sentence, asked, i) for i in (left if free else ()))
            if not left:
                return None
            again = Question(sentence, 0.5, text=which(self.now, left), candidates=left, reading=self.last)
            return next((plan for plan in plans if isinstance(plan, Plan)), again)
        chosen = self._chosen(sentence, replace(asked, candidates=left), entity, found) if entity is not None else None
        return chosen if isinstance(chosen, Plan) else None

    def _what(self, sentence: str, entity: Entity) -> Outcome | None:
        world = self.now
        things = [ref.things[-1] for ref in self.planner().resolver(world, ()).resolve(entity) if ref.things]
        if not things:
            return None
        things.sort(key=lambda i: entity.noun is None and world.things[i].kind in FIXED)
        thing = name(world, things[0])
        examples = " or ".join(repr(each) for each in offers(world, thing.split()))
        text = f"What shall I do with {thing}? Say, for example, {examples}"
        return Question(sentence, 0.0, (), (0, len(sentence)), text=text, candidates=tuple(things))

    def _chosen(self, sentence: str, asked: Question, entity: Entity, found: Choices) -> Outcome | None:
        """Return the plan of the candidate that an answer names."""
        planner, among = self.planner(), set(asked.candidates)
        several = (entity.kind == "it" and entity.plural) or (
            entity.every and not entity.colors and entity.noun is None
        )
        named = list(asked.candidates) if several else self._meant(planner, entity, asked.candidates)
        left_open = self.last.steps[-1].entity if self.last is not None else None
        counted = entity.kind == "list" and left_open is not None and left_open.number == len(named)
        if self.last is not None and (several or counted):
            every = Entity("list", parts=tuple(pinned(i) for i in named))
            return self._tried(sentence, revised(self.last, Reading((Clause(None, every),))), found)
        if entity.any and not named:
            named = list(asked.candidates)
        chosen = [
            c for c in asked.choices if named and {i for s in c.steps for i in (s.object, s.goal)} & set(named[:1])
        ]
        if len(named) == 1 and len(chosen) == 1 and self.now == self.turns[-1].world:
            return replace(chosen[0], sentence=sentence)
        if not named or self.last is None:
            return None
        if len(named) > 1 and not entity.any:
            if not among or len(named) == len(among):
                return None
            return Question(sentence, 0.5, text=which(self.now, named), candidates=tuple(named), reading=self.last)
        return self._filled(sentence, asked, named[0], found)

    def _meant(self, planner: Planner, entity: Entity, candidates: Sequence[int]) -> list[int]:
        """Return the candidates that a phrase means; any things if there are no candidates."""
        among = set(candidates)
        if entity.ordinal is not None and not entity.relations and not entity.sides and among:
            order = list(candidates)  # as they were listed
            return order[entity.ordinal - 1 :][:1] if entity.ordinal > 0 else order[-1:]
        resolver = planner.resolver(planner.world, self.it)
        refs = resolver.resolve(replace(entity, every=False), lambda ref: bool(set(ref.things) & among))
        if not among:
            return [i for ref in refs for i in ref.things][:1]
        least = min((ref.cost for ref in refs if set(ref.things) & among), default=0.0)
        refs = [ref for ref in refs if ref.cost <= least + 0.3]
        return list(dict.fromkeys(i for ref in refs for i in ref.things if i in among))

    def _filled(self, sentence: str, asked: Question, index: int, found: Choices | None = None) -> Outcome | None:
        """Return the outcome of the sentence that was asked about, with this thing where it left something open."""
        if self.last is None:
            return None
        loose = self.now.is_loose(index) and self._encloses(self.last.steps[-1])
        slots = ("object",) if loose else ("goal", "object") if self._asks_goal(asked) else ("object", "goal")
        name_of = "in" if index in self.now.containers else "on"
        tried = [each for slot in slots if (each := filled(self.last, pinned(index), slot, name_of)) is not None]
        return self._tried(sentence, tried, found, back=True)

    def _encloses(self, clause: Clause) -> bool:
        """Whether a clause puts something into a container, for which no loose thing can stand."""
        place = clause.places[0] if clause.places else None
        if place is None or place.name in ("in", "into"):
            return place is not None
        refs = self.planner().resolver(self.now, self.it).resolve(place.anchors[0]) if place.anchors else []
        return bool(refs) and refs[0].things[-1:] != () and refs[0].things[-1] in self.now.containers

    def _asks_goal(self, asked: Question) -> bool:
        """Whether the candidates of a question are places, not objects, of its sentence."""
        if self.last is None:
            return False
        clause = self.last.steps[-1]
        if clause.act in (Act.TAKE, Act.HOLD) and not clause.places and clause.entity is not None:
            return False
        if self._encloses(clause):
            return any(i in self.now.containers for i in asked.candidates)
        if clause.entity is None or clause.entity.kind == "it":
            return clause.act not in (Act.OPEN, Act.SHUT, Act.OPERATE, Act.EMPTY, Act.TOUCH)
        refs = self.planner().resolver(self.now, self.it).resolve(clause.entity)
        things = {ref.things[-1] for ref in refs if ref.things}
        return len(things & set(asked.candidates)) < len(asked.candidates) and len(things) <= 2

    def _tried(
        self,
        sentence: str,
        readings: list[Reading],
        found: Choices | None = None,
        restore: bool = False,
        back: bool = False,
    ) -> Outcome | None:
        """Return the outcome of the first reading that can be carried out, if need be from the scene before."""
        last: Outcome | None = None
        for reading in readings:
            for start, steps in self._starts(restore, back or self.now.cells):
                planner = self.planner(world=start)
                towers = [i for tower in towers_of(start, self.it[-1:]) for i in tower]
                planner.mentioned = (*self.it, *(i for i in towers if i not in self.it))
                outcome = settled(sentence, choices_of([reading], planner, found), planner)
                if isinstance(outcome, Plan):
                    direct = self._direct(sentence, reading, steps, outcome, found)
                    return direct or replace(outcome, steps=without_detours((*steps, *outcome.steps)))
                last = last if isinstance(last, Question) else outcome
        return last

    def _direct(
        self, sentence: str, reading: Reading, back: Sequence[Step], plan: Plan, found: Choices | None
    ) -> Plan | None:
        """Return a plan that takes a thing where it is, instead of one that first takes the same thing back."""
        restored, moved = ({step.object for step in steps if step.carries} for steps in (back, plan.steps))
        if not restored or restored != moved or self.now.cells:
            return None
        shifts = any(place.name == "direction" for step in reading.steps for place in step.places)
        if shifts:  # from where it stood before
            return plan if not any(step.goal is not None or step.act in (Act.OPEN, Act.SHUT) for step in back) else None
        planner = self.planner()
        outcome = settled(sentence, choices_of([reading], planner, found), planner)
        same = {step.object for step in carried(outcome)} == moved
        return outcome if isinstance(outcome, Plan) and same else None

    def _starts(self, restore: bool, back: bool) -> Iterator[tuple[WorldModel, tuple[Step, ...]]]:
        """Yield the worlds from which a correction is tried, each with the steps that lead to it."""
        world, done = self.now, self.done()
        corrects = done is not None and self.last is getattr(done.outcome, "reading", None)  # not what was asked since
        before = done.world if done is not None and corrects else world
        restored = restoring(world, before)
        if restored and restore:
            yield before, restored
        if not (restored and restore and world.cells):
            yield world, ()
        if restored and not restore and back:
            yield before, restored

    def _settle(self, sentence: str, reading: Reading) -> Outcome:
        planner = self.planner()
        return replace(settled(sentence, choices_of([reading], planner), planner), sentence=sentence)


def on_other_side(last: Clause, said: Clause) -> Clause | None:
    """Return the last clause with the thing on the side that is said: "the cube on the right", "I meant the left"."""
    entity, at = last.entity, said.places[0] if said.places and said.entity is None else None
    if entity is None or at is None or last.places or entity.kind != "thing":
        return None
    sides = (at.value,) if at.name == "direction" and at.value else at.anchors[0].sides if at.anchors else ()
    exact = getattr(last.instruction, "phrase", None)  # of a sentence of the project's own language
    if exact is not None and exact.superlative in ("leftmost", "rightmost") and sides:
        plain = replace(entity, colors=entity.colors if exact.color else (), sides=sides, pointed=None)
        return replace(last, entity=plain, instruction=None)
    before = [each for each in entity.relations if any(anchor.kind == "side" for anchor in each.anchors)]
    if not sides or not (before or entity.sides or entity.superlative in ("left", "right")):
        return None
    kept = tuple(each for each in entity.relations if each not in before)
    return replace(last, entity=replace(entity, sides=sides, superlative=None, relations=kept))
