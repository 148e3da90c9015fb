"""Corrections of single words: "next to, not on", "I said close", "the other way round", "half of it back".

Words that stand for others of the last sentence are put in their place, and that is read again.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from language.acts import Part, act_of, question
from language.lattice import Lattice
from language.meanings import Clause, Gesture, Measure, Reading, RelationPhrase
from language.memory import carried
from language.ordering import TIMES
from language.outcomes import Answer, Outcome, Plan, Question, Refusal, Signal, Step
from language.planning import CARRY
from language.referents import SIDEWAYS
from language.replies import PREFERS, Replies, on_other_side
from language.revising import TURNED, further, opposite, partly_back, restoring, without_detours
from language.scanning import COLOR, THING, Token, scan, text_of
from language.settling import choices, settled
from language.spots import pinned
from language.talk import name, offers, phrase
from language.words import colors
from language.world import WorldModel

_SAID = r"i (?:clearly |just |only )?(?:said|meant|mean|told you|asked (?:you )?(?:for|to))(?: to| you to)?"
_LEAD = rf"(?:(?:no|hey|wait|hang on|hold on|oops|sorry|well|but|actually|stop|,|please|{_SAID}) )*"
_NEW, _OLD = (
    r"(?P<new>(?!(?:not|no|do|does|did|can|could|is|are|am|was)\b)\w+(?: (?!not\b)\w+){0,3}?)",
    r"(?P<old>\w+(?: \w+){0,3}?)",
)
_REST = r"(?: [.,;](?: and)? (?P<rest>[\w ]+?)(?: i mean)?)?$"
_CONTRASTS = (
    re.compile(rf"^{_LEAD}{_NEW} (?:, |and |but )?(?:not|instead of|rather than) {_OLD}(?: of course)?{_REST}"),
    re.compile(rf"^{_LEAD}not {_OLD} (?:, but|,|but)(?: {_SAID})? {_NEW}{_REST}"),
    re.compile(rf"^(?=.*\b{_SAID}\b){_LEAD}{_NEW}(?: (?:, )?{_SAID})?{_REST}"),
    re.compile(rf"^no (?:, )?{_NEW}$"),
    re.compile(rf"^{_LEAD}{_NEW} (?:would|might) (?:be|have been) (?:better|nicer)(?: instead)?$"),
    re.compile(rf"^{_LEAD}{_OLD} was wrong (?:[,.;] )?(?:sorry , |sorry )?(?:it )?should have been {_NEW}$"),
    re.compile(rf"^(?:\w+ [!.,] )?i said {_OLD} but (?:i )?(?:was thinking(?: of)?|meant|mean|wanted) {_NEW}$"),
    re.compile(rf"^{_LEAD}{_NEW} (?:suits|fits|pleases) me (?:better|more|best)$"),
)
_OF_IT = re.compile(r" (?:of )?(?:it|that|that one)$")
_SAME_AFTER = re.compile(
    r"(?P<first>.+?)(?:\W+(?:and|then|after that|afterwards|finally|also))*[\s,.;]+(?:do |repeat )?(?:exactly )?"
    r"(?:the )?same(?: thing| again)? (?:with|for|to) (?P<other>.+)",
    re.IGNORECASE | re.DOTALL,
)
_STEPS = r"(?: (?:last |previous )?(?:steps|moves|actions|commands|orders|things|times|ones))?"
_N = r"both|two|three|four|five|2|3|4|5"
_UNDO = re.compile(
    rf"(?:please |now |and |no )*(?:(?:undo|revert|reverse|cancel|take back|rewind|go back)(?: of)?(?: your| my)?"
    rf"(?: last)? (?P<n>{_N}){_STEPS}|take (?:last )?(?P<n2>{_N}){_STEPS} back)"
    r"(?: (?:that |which )?(?:you|we|i) (?:just |have )*(?:did|done))?(?: please| again)*"
)
_CHOSEN = re.compile(  # an answer that is said as a wish: "I'd like the red one", "use the blue one for that"
    r"(?:(?:yes|okay|well|hm|please|then|so|maybe|,) )*"
    r"(?P<wish>i (?:(?:would|will|do|really|rather|just|think|guess) )*"
    r"(?:like|want|prefer|take|choose|pick|need|go (?:for|with)|have|say|wanted|meant|mean)"
    r"|(?:let us|you can|you may|could you|can you|we (?:can|could|will))"
    r" (?:take|go (?:with|for)|use|have|try|pick|choose)"
    r"|take|use|go (?:with|for)|choose|pick|try|make it|let it be) (?P<what>[^,.;]+?)"
    r"(?P<purpose>(?: for (?:that|it|this))?)(?: ,)?"
    r"(?: then| please| i (?:think|guess|would say|suppose)| for now| maybe)*"
)
_OTHER_SIDE = re.compile(  # of what it was put next to
    r"(?:(?:no|but|rather|please|actually|and|now|sorry|i (?:meant|want|wanted)|,) )*"
    r"(?:(?:put|move|place|set|take|bring|shift|have) (?:it|that|that one|this) )?(?:back |over )*(?:on|to|at|onto)"
    r" (?:its )?(?:other|opposite) side(?: of (?:it|that|that one))?(?: instead| please| rather| then| now)*"
)
_ONE_MORE = re.compile(r"\bone more\b(?! time)", re.IGNORECASE)
_UNSEEN = re.compile(
    r"(?:(?:sorry|but|oh|,) )*(?:i|we) (?:can not|could not|do not|did not)(?: really| even| quite)?"
    r" (?:find|see|spot|locate|notice|catch|watch|make out|follow)(?: (?P<what>.+?))?"
    r"(?: anywhere| any more| properly| here)?"
)
_BARE = ("verb", "relation", "direction", "number")  # what is said without the rest of its clause


@dataclass
class Corrections(Replies):
    """Does the last sentence with other words."""

    def _nothing(self, sentence: str, act: str) -> Outcome:
        raise NotImplementedError

    def _contrasted(self, sentence: str) -> Outcome | None:
        """Return what comes of the last sentence with some other words: "next to, not on"; None of other sentences."""
        text = text_of(scan(sentence)).rstrip(" .!?")
        last = next((turn for turn in reversed(self.turns) if not isinstance(turn.outcome, Answer)), None)
        match = next(filter(None, (pattern.match(text) for pattern in _CONTRASTS)), None) if last else None
        if match is None or last is None or self.now.cells:
            return None
        said = match.groupdict()
        if all(_OF_IT.search(said.get(each) or "") for each in ("new", "old")):  # "on it, not next to it"
            said |= {each: _OF_IT.sub("", said[each]) for each in ("new", "old")}
        several = re.search(r"\b(?:and|then)\b|[,.;]", last.sentence.rstrip(" .!"))
        meant = self._in_other_box(last.sentence, said["new"]) if several else None
        meant = meant or _with_words(last.sentence, said["new"], said.get("old") or "")
        if meant is None:
            return None
        again = f"{said['new']} {said['rest']}" if said.get("rest") else meant
        trial = self.copy()
        trial.world, trial.turns = last.world, [turn for turn in self.turns if turn is not last]
        outcome = trial._answer(again, ())
        if isinstance(last.outcome, Plan) and isinstance(outcome, Plan) and outcome.reading is not None:
            return self._tried(sentence, [outcome.reading], restore=True)
        if isinstance(last.outcome, Plan):
            outcome = self.copy()._answer(again, ())
        return replace(outcome, sentence=sentence) if isinstance(outcome, Plan | Question) else None

    def _in_other_box(self, sentence: str, new: str) -> str | None:
        """Return a sentence with a container in place of the only other one that it names, or None.

        new: the words that may name the container.
        """
        words = [token.text for token in scan(sentence)]
        kinds = {self.now.things[i].kind for i in self.now.containers}
        named = next((kind for kind in kinds if re.fullmatch(rf"(?:(?:in|into) )?(?:{COLOR} )?{kind}", new)), None)
        others = kinds & {*words} - {named}
        return " ".join(named if word in others else word for word in words) if named and len(others) == 1 else None

    def _chosen_by_wish(self, text: str, made: tuple) -> Outcome | None:
        """Return what comes of an answer that is said as a wish: "I want the red one", where one of some was asked for.

        text: the words of the sentence.
        """
        match, asked = _CHOSEN.fullmatch(text), self.open_question()
        if match is None or asked is None or not asked.candidates or self.last is None:
            return None
        tokens, planner = scan(match["what"]), self.planner()
        entity = phrase(self.now, planner, tokens)[0]
        if entity is None or entity.span != (0, len(tokens)) or entity.kind != "thing":
            return None
        takes = re.search(r"\b(?:take|pick|have)$", match["wish"]) is not None
        if takes and tokens[-1].text not in ("one", *colors()) and not match["purpose"]:
            return None  # "take the red cube" may be another command
        if len(self._meant(planner, entity, asked.candidates)) != 1:
            return None
        return self._answer(match["what"], made)

    def _asks_why(self, asked: str, command: str) -> bool:
        """Whether a question asks why what was refused is not done: "why can't you do that?"."""
        last = self.turns[-1].outcome if self.turns else None
        if not asked.startswith("why ") or not isinstance(last, Refusal):
            return False
        if not re.search(rf"\b(?:{COLOR}|{THING})\b", command):  # "do that", "put it in there"
            return True
        return isinstance(self.copy()._answer(command, ()), Refusal)

    def _across_it(self, sentence: str, text: str) -> Outcome | None:
        """Return what comes of "put it on the other side" after a thing was put on one side of another one.

        text: the words of the sentence.
        """
        outcome = self._turned_round(sentence) if _OTHER_SIDE.fullmatch(text) else None
        return outcome if isinstance(outcome, Plan) or self._far_side(text) is None else None

    def _looked_for(self, words: str, later: Sequence[Part]) -> tuple[str, bool]:
        """Return what was not seen, before a question, and whether that says no more: "I can't find X, where is it"."""
        unseen = _UNSEEN.fullmatch(words)
        if unseen is None or not later or not question(" ".join(later[0].words)):
            return words, False
        what = unseen["what"] or "it"
        named = re.search(rf"\b(?:{COLOR}|{THING})\b", what) is not None
        return (what if named else words), re.fullmatch(r"it|that|this|them|well|much", what) is not None

    def _undone(self, sentence: str, number: int) -> Outcome:
        """Return the steps back to the world before the last plan."""
        done, world = self.done(number), self.now
        if done is None:
            return self._nothing(sentence, "undo")
        steps = restoring(world, done.world, [step.object for step in getattr(done.outcome, "steps", ())])
        result = reduce(WorldModel.after, steps, world)
        still = [i for i in world.devices if abs(result.moved.get(i, 0.0) - done.world.moved.get(i, 0.0)) > 0.5]
        if still and not steps:
            text = f"I cannot undo that: {name(world, still[0])} stays down"
            return Refusal(sentence, 0.0, (), (0, len(sentence)), "impossible", text=text, suggestions=offers(world))
        if not steps:  # only the arm has moved
            return Signal(sentence, 1.0, (), (0, len(sentence)), control="home")
        return Signal(
            sentence, 1.0, (), (0, len(sentence)), control="undo", text="I undo that", steps=steps, result=result
        )

    def _again(self, sentence: str, number: int, little: bool = False) -> Outcome | None:
        """Return the last plan once more, or several times. little: a move to a side only by a bit."""
        done = self.done()
        plan = done.outcome if done is not None else None
        if not isinstance(plan, Plan) or plan.reading is None:
            return None
        places = plan.reading.steps[-1].places
        if _ONE_MORE.search(sentence) and places and not any(each.measure for each in places):
            return self._command("another one", ())
        again = further(_settled_by(plan, plan.reading))
        if little and again.steps[-1].places:
            places = tuple(
                replace(place, measure=Measure(1.0, "bit")) if place.name == "direction" else place
                for place in again.steps[-1].places
            )
            again = Reading((replace(again.steps[-1], places=places),))
        return self._settle(sentence, replace(again, unused=(), cost=0.0, times=number))

    def _redone(self, sentence: str, words: Sequence[str]) -> Outcome | None:
        """Return the plan that was undone last, or one more undo: "redo", "again"; None if nothing was undone last."""
        last = next((turn for turn in reversed(self.turns) if not isinstance(turn.outcome, Answer)), None)
        undid = last is not None and isinstance(last.outcome, Signal) and last.outcome.control == "undo"
        if last is None or not (undid or act_of([token.text for token in scan(last.sentence)]) == "undo"):
            return None
        if not {"redo", "do", "did", "undo"} & {*words}:
            return self._undone(sentence, 1)
        trial = self.copy()
        trial.turns = [turn for turn in self.turns if turn is not last]
        undone = trial.done()
        reading = getattr(undone.outcome, "reading", None) if undone is not None else None
        return None if reading is None else self._settle(sentence, reading)

    def _instead(self, sentence: str, words: list[Token], outcome: Outcome) -> Outcome | None:
        """Return the plan that takes the last one back and does it with another thing: "put red in instead"."""
        done = self.done()
        put = carried(done.outcome) if done is not None else []
        if done is None or not put or not PREFERS.search(sentence) or not isinstance(outcome, Refusal | Plan):
            return None
        there, goal = re.search(r"\bthere\b", sentence) is not None, put[-1].goal
        steps = getattr(outcome, "steps", ())
        if goal not in self.now.containers and re.search(r"\b(?:in there|inside)\b", sentence):
            return None  # it was moved to another place than is meant now
        undone = any(step.object == put[-1].object and not step.implied for step in (steps if there else steps[:1]))
        if undone:  # "take it off, put the gray one there instead"
            return None
        shown = Gesture((), put[-1].place) if there and goal is None and put[-1].place is not None else None
        planner = self.planner((shown,) if shown is not None else (), world=done.world)
        if goal is not None and planner.it[:1] == (put[-1].object,):  # "put red on it instead"
            planner.it = (goal,)
        if goal is not None and goal not in self.now.containers:  # "put red there instead"
            words = scan(re.sub(r"\bthere\b", "on it", text_of(words)))
        back = restoring(self.now, done.world)
        tried = settled(sentence, choices(words, planner), planner) if back else outcome
        again = carried(tried)
        moved = {step.object for step in put}
        if not isinstance(tried, Plan) or not again or again[-1].object in moved:
            return None
        if isinstance(outcome, Plan) and not there and (again[-1].goal is None or again[-1].goal != goal):
            return None
        steps = without_detours((*back, *tried.steps))
        return replace(tried, steps=steps, notes=tried.notes if len(steps) == len(back) + len(tried.steps) else ())

    def _same_after(self, sentence: str, made: tuple) -> Outcome | None:
        """Return the plan of "put X in the drawer, then do the same with Y": the last part goes on from the first."""
        match = _SAME_AFTER.match(sentence)
        if match is None:
            return None
        trial = self.copy()
        first = trial._answer(match["first"], made)
        if not isinstance(first, Plan) or not first.steps:
            return None
        trial.remember(first, self.now)
        trial.world = first.result or trial.world
        then = trial._answer(f"the same with {match['other']}", ())
        if not isinstance(then, Plan):
            return then if isinstance(then, Question) else None
        return replace(then, steps=(*first.steps, *then.steps), notes=(*first.notes, *then.notes), reading=then.reading)

    def _undone_together(self, words: Sequence[str]) -> int:
        """Return how many plans are to be undone: "undo the last two", "take both moves back"; 0 in other sentences."""
        match = _UNDO.fullmatch(" ".join(words))
        return TIMES.get(match["n"] or match["n2"], 2) if match else 0  # "both"

    def _less(self, sentence: str, words: Sequence[str]) -> Outcome | None:
        """Return the plan that takes a part of the last move back: a bit, or half of it; None if it was no move."""
        done = self.done()
        if done is None or self.last is None:
            return None
        back = partly_back(self.last)
        if back is None:
            return None
        moved = next((s for s in reversed(getattr(done.outcome, "steps", ())) if s.place is not None), None)
        if moved is not None and moved.place is not None:
            start = done.world.things[moved.object]
            went, clause = math.dist((start.x, start.y), moved.place), back.steps[-1]
            if "half" in words or went < 1.5 * self.now.little:  # it went but a bit
                half = Measure(0.5 * went, "1")
                back = Reading((replace(clause, places=tuple(replace(each, measure=half) for each in clause.places)),))
        return self._settle(sentence, back)

    def _turned_round(self, sentence: str) -> Outcome | None:
        """Return the plan that does the last one the other way round: what was put on something goes below it."""
        done, last = self.done(), self.turns[-1].outcome if self.turns else None
        refused = isinstance(last, Refusal) and last.reading is not None and last.reason != "already"
        before = self.last if isinstance(last, Refusal) and refused else getattr(done and done.outcome, "reading", None)
        if before is None or (refused and getattr(last, "reading", None) is not self.last):
            return None
        stored = [i for i in self._carried()[:2] if self.now.inside.get(i) in self.now.containers]
        if len(stored) == 2 and not refused:
            return self._command(f"swap {name(self.now, stored[0])} and {name(self.now, stored[1])}", ())
        if (other := _other_side(before.steps[-1])) is not None:  # "no, the other left"
            return self._tried(sentence, [Reading((*before.steps[:-1], other))], restore=True)
        beside = {place.name for place in before.steps[-1].places} & {*SIDEWAYS, "near", "direction"}
        if re.search(r"\bside\b", sentence.lower()) and not beside:
            return None
        if not refused and (done is None or not isinstance(done.outcome, Plan)):
            return None
        steps = () if refused or done is None else getattr(done.outcome, "steps", ())  # on that side nothing was done
        reading = opposite(before, steps, self.now) or self._across(before, steps)
        return self._settle(sentence, reading) if reading is not None else None

    def _opposite_side(self, dx: float, dy: float) -> str:
        """Return the relation to a thing of what is on its side opposite to an offset from it, metres."""
        along = {name: float(np.dot(self.now.toward(side), (dx, dy))) for name, side in SIDEWAYS.items()}
        return min(along, key=lambda name: along[name])

    def _across(self, last: Reading, steps: Sequence[Step]) -> Reading | None:
        """Return the reading that puts a thing on the other side of what it was put next to."""
        places = [place for place in last.steps[-1].places if place.name == "near" and place.anchors]
        moved = next((step for step in reversed(steps) if step.carries and step.place is not None), None)
        refs = self.planner().resolver(self.now, ()).resolve(places[0].anchors[0]) if places else []
        if moved is None or moved.place is None or not refs:
            return None
        side = self._opposite_side(moved.place[0] - refs[0].x, moved.place[1] - refs[0].y)
        place = RelationPhrase(side, places[0].anchors)
        return Reading((Clause(CARRY, pinned(moved.object), (place,)),))


def _settled_by(plan: Plan, reading: Reading) -> Reading:
    """Return the reading of a plan with the thing that it concerns, which may have been asked for after "the cube"."""
    clause, things = reading.steps[-1], {step.object for step in plan.steps if not step.implied}
    entity = clause.entity
    if entity is None or entity.kind != "thing" or entity.any or entity.plural or len(things) != 1:
        return reading
    return replace(reading, steps=(*reading.steps[:-1], replace(clause, entity=pinned(*things))))


def _other_side(clause: Clause) -> Clause | None:
    """Return a clause about the thing on one side as one about that on the other side; None of other clauses."""
    entity = clause.entity
    if entity is None:
        return None
    exact = getattr(getattr(clause.instruction, "phrase", None), "superlative", None) or ""
    anchors = [anchor for relation in entity.relations for anchor in relation.anchors if anchor.kind == "side"]
    sides = [*entity.sides, entity.superlative, exact.removesuffix("most"), *(s for a in anchors for s in a.sides)]
    side = next((TURNED[side] for side in sides if side in ("left", "right")), None)
    return on_other_side(clause, Clause(None, None, (RelationPhrase("direction", value=side),))) if side else None


def _with_words(sentence: str, new: str, old: str) -> str | None:
    """Return a sentence with other words for some of it; None if nothing says for which.

    old: the words that were wrong; "": those of the same kind as the new ones.
    """
    tokens = scan(sentence)
    texts = [token.text for token in tokens]
    lattice, said, wrong = Lattice(tokens), Lattice(scan(new)), [token.text for token in scan(old)]
    size = len(wrong)
    at = [(i, i + size) for i in range(len(texts) - size + 1) if texts[i : i + size] == wrong] if size else []
    measured = len(said) == 2 and said.get(0, "number") and said.get(1, "unit")
    whole = (each for each in _BARE if any(edge.end == len(said) for edge in said.get(0, each)))
    kind = "number" if measured else next(whole, None)
    if kind is None and len(at) == 1 and re.fullmatch(COLOR, old) and re.fullmatch(COLOR, new):
        kind = "color"  # "not blue, I meant cyan"
    if kind is None:
        return None
    new = {"number": new.split()[0]}.get(kind, f"{new} of" if new == "on top" else new)
    if not at:
        at = [(i, edge.end) for i in range(len(lattice)) for edge in lattice.get(i, kind) if not edge.cost]
        longest = [
            each
            for each in at
            if not any(first <= each[0] and each[1] <= end and (first, end) != each for first, end in at)
        ]
        at = longest[:1] if kind == "verb" else longest[-1:]
    if not at:
        return None
    first, last = at[-1]
    return " ".join([*texts[:first], new, *texts[last:]])
