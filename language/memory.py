"""The memory of a dialogue: turns, what they were about, and what "it" and "the other one" mean after them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Self

from language.meanings import Entity, Gesture, Reading
from language.outcomes import Answer, Outcome, Plan, Question, Refusal, Signal, Step
from language.planning import Planner
from language.revising import tells
from language.several import towers_of
from language.spots import Rest, left_place
from language.verbs import Act
from language.world import WorldModel

_ADJUSTING = ("toward", "away", "direction")  # where something is put, as seen from where it stands


class Turn(NamedTuple):
    """A sentence, what came of it, the world before it, and the things that it was about, the last one last.

    ending: how far its steps came, in a sentence, where they were not all carried out; "" if they were. beside: what
    these things were compared with.
    """

    sentence: str
    outcome: Outcome
    world: WorldModel
    about: tuple[int, ...] = ()
    ending: str = ""
    beside: tuple[int, ...] = ()

    @property
    def named(self) -> tuple[int, ...]:
        """What it was about and what that was compared with, the one that matters most first."""
        return (*self.about[-1:], *self.beside, *reversed(self.about[:-1]))


def carried(outcome: Outcome | None) -> list[Step]:
    """Return the steps of an outcome that put something somewhere; none of one that is no plan."""
    return [step for step in getattr(outcome, "steps", ()) if step.carries]


@dataclass
class Memory:
    """What was said and done.

    world: the scene after the last outcome. turns: oldest first. it: the things that were spoken of last.
    box: the container that was spoken of last. last: the reading of the last plan, question or refusal.
    surroundings: further fields of `WorldModel` for every scene, such as `bounds` and `little`.
    compared: the things that an answer compares with the one it is about, and what they were compared with.
    body: what the robot is. homeward: whether the arm goes back to its rest position after the last plan.
    """

    world: WorldModel | None = None
    turns: list[Turn] = field(default_factory=list)
    it: tuple[int, ...] = ()
    box: int | None = None
    last: Reading | None = None
    surroundings: dict[str, Any] = field(default_factory=dict)
    body: str = "a simulated robot arm, not a real one"
    homeward: bool = False
    compared: tuple[tuple[int, ...], tuple[int, ...]] = (), ()

    def copy(self) -> Self:
        """Return a dialogue with the same memory, to try a sentence."""
        return replace(self, turns=[*self.turns])

    def _answer(self, sentence: str, made: tuple[Gesture, ...]) -> Outcome:
        raise NotImplementedError

    def _command(self, text: str, made: tuple[Gesture, ...]) -> Outcome:
        raise NotImplementedError

    def remember(self, outcome: Outcome, world: WorldModel) -> None:
        """Add an outcome to the memory. world: before it."""
        about = outcome.about
        self.world = world
        if isinstance(outcome, Plan) and outcome.steps:
            self.world = outcome.result or world
            self.last = outcome.reading or self.last
            asked = [step for step in outcome.steps if not step.implied] or list(outcome.steps)
            its = tuple(dict.fromkeys(s.object for s in asked if s.several)) or self._built(outcome, asked)
            self.it = its + _below(outcome, its, world)
            done = tuple(dict.fromkeys(i for s in asked for i in (s.goal, s.object) if i is not None))
            about = (*(i for i in self._anchors(outcome, world) if i not in done), *done)
        elif isinstance(outcome, Signal) and outcome.steps:
            self.world = outcome.result or world
            about = tuple(i for i in (outcome.steps[-1].goal, outcome.steps[-1].object) if i is not None)
        elif isinstance(outcome, Question | Refusal):
            self.last = getattr(outcome, "reading", None) or self.last
        if not isinstance(outcome, Plan | Signal):
            spoken = self._spoken_of(outcome, world)
            its = about or spoken
            if isinstance(outcome, Question) and outcome.reading is None:  # "what shall I do with the red cube?"
                its = its or outcome.candidates[:1]
            self.it = (*its, *self.compared[1]) or self.it
            about = (*(i for i in dict.fromkeys((*self.compared[0], *spoken)) if i not in its), *its)
        told = [world.inside.get(i) for i in about] if isinstance(outcome, Answer) else []  # "it is in the drawer"
        boxes = [i for i in (*about, *told) if i is not None and i in world.containers]
        self.box = boxes[-1] if boxes and not isinstance(outcome, Question) else self.box
        self.turns.append(Turn(outcome.sentence, outcome, world, about, beside=self.compared[1]))
        self.compared = (), ()

    def _built(self, plan: Plan, steps: Sequence[Step]) -> tuple[int, ...]:
        """Return what "it" and "them" mean after steps: the thing of the last one, first of all of a tower or a row."""
        last, reading = steps[-1].object, plan.reading
        built = reading is not None and reading.steps[-1:] and reading.steps[-1].act in (Act.BUILD, Act.GATHER)
        carried = {step.object for step in steps if step.carries}
        whole = [i for step in reversed(steps) for i in (step.object, step.goal) if i is not None]
        return tuple(dict.fromkeys((last, *whole))) if built or len(carried) > 1 else (last,)

    def amend(self, outcome: Outcome, world: WorldModel) -> None:
        """Replace the last turn's outcome by what really came of it. world: before it."""
        turn = self.turns.pop()
        kept = self.last
        self.remember(replace(outcome, sentence=turn.sentence, about=outcome.about or turn.outcome.about), world)
        if self.last is None:
            self.last = kept

    def ended(self, told: str) -> None:
        """Note how far the last plan came. told: in a sentence; "" if it was carried out."""
        for at in range(len(self.turns) - 1, -1, -1):
            if getattr(self.turns[at].outcome, "steps", ()):
                self.turns[at] = self.turns[at]._replace(ending=told)
                return

    def _spoken_of(self, outcome: Outcome, world: WorldModel) -> tuple[int, ...]:
        """Return the things that a sentence named exactly which led to a question or could not be carried out."""
        reading = getattr(outcome, "reading", None)
        clauses = reading.steps if reading is not None else ()
        phrases = [anchor for clause in clauses for place in clause.places for anchor in place.anchors]
        phrases += [clause.entity for clause in clauses if clause.entity]
        return self._sure(phrases, world)

    def _anchors(self, plan: Plan, world: WorldModel) -> tuple[int, ...]:
        """Return the things beside which a plan puts something. world: before it."""
        clauses = plan.reading.steps if plan.reading is not None else ()
        phrases = [anchor for clause in clauses for place in clause.places for anchor in place.anchors]
        pinned = [i for each in phrases if isinstance(each.pointed, Gesture) for i in each.pointed.things]
        return tuple(dict.fromkeys((*pinned, *self._sure(phrases, world))))

    def _sure(self, phrases: Sequence[Entity], world: WorldModel) -> tuple[int, ...]:
        """Return the things that phrases name exactly."""
        resolver = self.planner(world=world).resolver(world, self.it)
        says = [each for each in phrases if each.kind == "thing" and tells(each)]
        found = [resolver.resolve(each) for each in says]
        sure = [refs[0] for refs in found if refs and all(ref.cost > refs[0].cost + 0.2 for ref in refs[1:])]
        return tuple(ref.things[-1] for ref in sure if ref.things)

    @property
    def now(self) -> WorldModel:
        """The world after the last outcome, or of the sentence that is being read."""
        assert self.world is not None
        return self.world

    def planner(self, made: tuple[Gesture, ...] = (), world: WorldModel | None = None) -> Planner:
        """Return a planner that knows what was spoken of. made: the gestures. world: None: as it is now."""
        world = world or self.now
        it = self.it if world.held is None or world.cells else (world.held, *(i for i in self.it if i != world.held))
        planner = Planner(world, it, self.it, gestures=made, box=self.box)
        planner.boxes = () if self.box is None else (self.box,)
        planner.others, planner.rests = self._others(world), self._rests(world)
        planner.carried = self._carried()
        planner.recent = tuple(dict.fromkeys(i for turn in reversed(self.turns) for i in turn.named))
        return planner

    def _carried(self) -> tuple[int, ...]:
        """Return what was put somewhere by the last plans that did so one after the other, the last one first."""
        found: list[int] = []
        for turn in reversed(self.turns):
            steps = [step for step in getattr(turn.outcome, "steps", ()) if not step.implied]
            carried = [step.object for step in reversed(steps) if step.carries]
            if isinstance(turn.outcome, Signal) or (steps and not carried):
                break
            found += carried
        return tuple(dict.fromkeys(found))

    def _rests(self, world: WorldModel) -> dict[int, Rest]:
        """Return where things stood before they were moved last."""
        found: dict[int, Rest] = {}
        for turn in self.turns:
            left = ((i, left_place(turn.world, world, i)) for i in range(len(world.things)) if world.is_loose(i))
            found |= {index: rest for index, rest in left if rest is not None}
        return found

    def _others(self, world: WorldModel) -> tuple[int, ...]:
        """Return what "the other one" means: the rest of the things of a turn from which one was singled out later."""
        if not self.it or world.cells:
            return ()
        one = self.it[0 if self.turns and self.turns[-1].beside else -1]
        alike = [i for i, thing in enumerate(world.things) if world.is_loose(i) == world.is_loose(one)]
        for turn in reversed(self.turns):
            about = [i for i in turn.about if i in alike]
            if one in about and len(about) > 1:
                return tuple(i for i in about if i != one)
        in_turn = self._carried()
        return tuple(i for i in in_turn if i != one) if one in in_turn and len(in_turn) == 2 else ()

    def _unadjusted(self) -> Reading | None:
        """Return the last reading; of a place that was adjusted since, "a bit closer", that which said the place."""
        for turn in reversed(self.turns):
            reading = getattr(turn.outcome, "reading", None)
            if not isinstance(reading, Reading) or not reading.steps[-1].places:
                break
            places = reading.steps[-1].places
            if places[0].name not in _ADJUSTING:
                return self.last if reading is self.last else Reading(reading.steps[-1:])
        return self.last

    def _gave_before(self) -> bool:
        """Whether a thing is on the person's hand with which the last plan did nothing."""
        done, hand = self.done(), self.now.hand
        given = self.now.contents(hand) if hand is not None else []
        return bool(given) and not any(step.object in given for step in getattr(done and done.outcome, "steps", ()))

    def open_question(self) -> Question | None:
        """Return the question that waits for its answer: the last one, if nothing was done since."""
        for turn in reversed(self.turns[-3:]):
            if isinstance(turn.outcome, Question):
                return turn.outcome
            if not isinstance(turn.outcome, Answer):
                return None
        return None

    def done(self, steps_back: int = 1) -> Turn | None:
        """Return the last turn that did something and was not undone; of several steps back, the first of them."""
        undone = 1 - steps_back
        found = None
        for turn in reversed(self.turns):
            if isinstance(turn.outcome, Signal) and turn.outcome.control == "undo":
                undone += 1
            elif isinstance(turn.outcome, Plan) and turn.outcome.steps:
                found = turn if undone <= 0 else found
                if undone == 0:
                    return turn
                undone -= 1 if undone > 0 else -1
        return found


def _below(plan: Plan, things: Sequence[int], world: WorldModel) -> tuple[int, ...]:
    """Return what else was in a tower that a plan took apart. world: before it."""
    clause = plan.reading.steps[-1] if plan.reading is not None else None
    if clause is None or clause.act is not Act.UNSTACK or clause.entity is None or clause.entity.kind != "stack":
        return ()
    return tuple(dict.fromkeys(i for tower in towers_of(world, things) for i in tower if i not in things))
