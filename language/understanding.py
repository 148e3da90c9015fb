"""Understanding of a sentence in a scene: which task to perform with which objects (`parse`), and corrections."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import overload

import numpy as np

from language.errors import LanguageError, NothingFits, SeveralFit
from language.grammar import parse_words
from language.grounding import PhraseResolver
from language.instruction import Chain, Command, Correction, Instruction, Meaning, ObjectPhrase
from language.meanings import Clause, Entity, Gesture, Reading, RelationPhrase
from language.objects import DEVICES, FITTINGS, HAND, NOUNS, Scene
from language.task_generation import hand_of, scene_after
from language.verbs import EVERY, HERE, KNOWN, OPERATED, POINTING, VERBS
from language.world import WorldModel

FIXED = [list(NOUNS).index(noun) for noun in (*DEVICES, *FITTINGS, HAND)]  # which "every object" leaves out


@dataclass(frozen=True)
class GroundedStep:
    """A step of an instruction, with its objects.

    task: a key of VERBS.
    init: index of the object that is moved, or None.
    goal: index of the object that it is moved to, or of the object that is acted on in place.
    reward, networks: the name of the reward and the number of networks with which the original system trains the task.
    """

    task: str
    init: int | None
    goal: int | None
    reward: str
    networks: int

    @property
    def objects(self) -> tuple[int, ...]:
        """The objects, the one that is moved or acted on first."""
        return tuple(each for each in (self.init, self.goal) if each is not None)


@dataclass(frozen=True)
class Understood:
    """The interpretation of a sentence in a scene.

    meaning: its parse. steps: at least one. result: the scene after all steps. pointed: the object of each gesture.
    instructions: which part of the meaning each step belongs to; "every red cube" gives several steps.
    """

    meaning: Command
    steps: tuple[GroundedStep, ...]
    result: Scene
    pointed: tuple[int, ...] = ()
    instructions: tuple[Instruction, ...] = ()


@overload
def parse(sentence: str) -> Meaning: ...
@overload
def parse(
    sentence: str,
    scene: Scene,
    pointed: Sequence[int] = (),
    previous: Command | Understood | None = None,
    spoken: Sequence[int] = (),
) -> Understood: ...
def parse(
    sentence: str,
    scene: Scene | None = None,
    pointed: Sequence[int] = (),
    previous: Command | Understood | None = None,
    spoken: Sequence[int] = (),
) -> Meaning | Understood:
    """Parse a sentence and, if a scene is given, grounds it: which task to perform with which objects.

    Args:
        sentence: an instruction, a chain or a correction.
        scene: None: the sentence is only parsed.
        pointed: the object of each gesture, in the order of the words that need one ("this", "there").
        previous: the previous instruction, which a correction ("no, the blue one") revises. An `Understood` also
            carries its gestures.
        spoken: the objects that were spoken of before, the likeliest of "it" first.

    Returns:
        The meaning; with a scene, the meaning with its grounded steps.

    Raises:
        NotUnderstood: the sentence is outside the grammar.
        NothingFits, SeveralFit: a phrase fits no object, or several. Nothing is guessed.
            Each error gives the position in the sentence.
    """
    meaning = parse_words(sentence)
    if scene is None:
        return meaning
    if isinstance(meaning, Correction):
        if previous is None:
            raise NothingFits("there is no previous instruction to correct; say what to do", sentence, 0)
        return revise(previous, meaning, scene, pointed)
    return understand(meaning, scene, pointed, spoken)


def understand(command: Command, scene: Scene, pointed: Sequence[int] = (), spoken: Sequence[int] = ()) -> Understood:
    """Ground each step of a command in the scene after the steps before it. Raises NothingFits or SeveralFit.

    "It" is the object of the step before; where something is opened or closed, the fitting that was spoken of last.
    "Every red cube" gives a step for each, the one nearest to the goal first.

    pointed: the object of each gesture, in the order of the words that need one. spoken: the objects that were spoken
    of before, the likeliest of "it" first.
    """
    resolver = PhraseResolver(scene, pointed)
    steps: list[GroundedStep] = []
    instructions: list[Instruction] = []
    for instruction in command.steps:
        resolver.it = _it(instruction.task, scene, spoken)
        for step in _steps(instruction, resolver):
            spoken = [*step.objects, *spoken]
            resolver.scene = scene_after(step.task, step.init, step.goal, resolver.scene)
            steps.append(step)
            instructions.append(instruction)
    return Understood(command, tuple(steps), resolver.scene, tuple(pointed), tuple(instructions))


def _it(task: str, scene: Scene, spoken: Sequence[int]) -> int | None:
    """Return the object that "it" refers to, of those that were spoken of, the latest first."""
    nouns = list(NOUNS)
    fittings = (each for each in spoken if nouns[scene.nouns[each]] in FITTINGS)
    it = next(fittings, None) if task in OPERATED else None
    return next(iter(spoken), None) if it is None else it


def _steps(instruction: Instruction, resolver: PhraseResolver) -> list[GroundedStep]:
    """Return a step for each object that is meant; several only for "every"."""
    task = VERBS[instruction.task]
    among = ~resolver.scene.targets if task.moves else None  # targets only mark a place and cannot be moved
    several = instruction.phrase.determiner == EVERY
    if several:
        named = resolver.resolve_all(
            instruction.phrase, ~resolver.scene.targets & ~np.isin(resolver.scene.nouns, FIXED)
        )
    else:
        named = [resolver.resolve(instruction.phrase, among)]
    real = ~resolver.scene.targets if task.goal_is_real else None  # nothing can stand on a target
    goal = None if instruction.goal is None else resolver.resolve(instruction.goal, real)
    if goal in named:
        message = f"'{instruction.goal}' is the object that is to be moved; say another place"
        raise NothingFits(message, str(instruction.goal), instruction.goal.position if instruction.goal else 0)
    if task.effect == "hand":
        goal = hand_of(resolver.scene)
    if not task.moves:
        return [GroundedStep(instruction.task, None, each, task.reward, task.networks) for each in named]
    if several and goal is not None:
        away = np.linalg.norm(resolver.scene.positions - resolver.scene.positions[goal], axis=1)
        named = sorted(named, key=lambda each: float(away[each]))
    return [GroundedStep(instruction.task, each, goal, task.reward, task.networks) for each in named]


def revise(
    previous: Command | Understood, correction: Correction, scene: Scene, pointed: Sequence[int] = ()
) -> Understood:
    """Return the previous instruction with the correction applied.

    A correction with "one" or "object" keeps the words of the previous phrase that it does not change: "no, the blue
    one" after "the red cube" means the blue cube. A phrase with a noun of its own is first read alone; if it is not
    unique ("not the cube, the sphere"), the previous words are added.

    Args:
        previous: the previous instruction; an `Understood` also carries its gestures.
        correction: the correction.
        scene: the scene of the previous instruction.
        pointed: the object of each gesture of the correction.

    Raises:
        NothingFits, SeveralFit: no reading of the correction fits exactly one object.
    """
    first: LanguageError | None = None
    pointed = _unused_gestures(correction.rejected, pointed)
    before = previous if isinstance(previous, Understood) else Understood(previous, (), scene, tuple(pointed))
    at, is_goal = _corrected(before.meaning.steps, correction)
    changed = 2 * at + is_goal
    for command in _revisions(before.meaning, correction):
        try:
            understood = understand(command, scene, _regestured(before, command, changed, pointed))
        except (NothingFits, SeveralFit) as error:
            first = first or error
            continue
        return understood
    raise first or NothingFits(f"'{correction}' changes nothing of '{before.meaning}'", str(correction), 0)


def _regestured(before: Understood, command: Command, changed: int, pointed: Sequence[int]) -> list[int]:
    """Return the gestures of the revised command: the previous ones, and the new ones in the changed phrase."""
    old, gestures = list(before.pointed), []
    for number, (old_phrase, new_phrase) in enumerate(zip(_phrases(before.meaning), _phrases(command), strict=True)):
        used, needed = _gesture_count(old_phrase), _gesture_count(new_phrase)
        kept, old = old[:used], old[used:] or old[-1:]
        gestures += (list(pointed) * needed)[:needed] if number == changed else kept
    return gestures


def _phrases(command: Command) -> list[ObjectPhrase | None]:
    return [phrase for step in command.steps for phrase in (step.phrase, step.goal)]


def _gesture_count(phrase: ObjectPhrase | None) -> int:
    """Return how many of its words need a gesture."""
    return 0 if phrase is None else sum(part.determiner in (*POINTING, *HERE) for part in phrase.parts())


def _unused_gestures(rejected: ObjectPhrase | None, pointed: Sequence[int]) -> Sequence[int]:
    """Return the gestures that the rejected phrase ("not that one, this one") does not use; at least the last."""
    used = _gesture_count(rejected)
    return pointed[min(used, len(pointed) - 1) :] if used and len(pointed) else pointed


def _revisions(previous: Command, correction: Correction) -> list[Command]:
    """Return the possible revised commands, the likeliest first."""
    steps = list(previous.steps)
    at, is_goal = _corrected(steps, correction)
    new = correction.phrase or correction.goal
    assert new is not None
    steps = [_at(new.position, step) for step in steps]  # errors refer to positions in the correction
    old = steps[at].goal if is_goal else steps[at].phrase
    commands: list[Command] = []
    for phrase in _readings(old, new):
        try:
            changed = Instruction(
                steps[at].task, steps[at].phrase if is_goal else phrase, phrase if is_goal else steps[at].goal
            )
        except LanguageError:  # the task takes no goal
            continue
        revised = (*steps[:at], changed, *steps[at + 1 :])
        commands.append(revised[0] if len(revised) == 1 else Chain(revised))
    return commands


def _at(position: int, step: Instruction) -> Instruction:
    def moved(phrase: ObjectPhrase) -> ObjectPhrase:
        return replace(phrase, position=position, anchors=tuple(map(moved, phrase.anchors)))

    return replace(step, phrase=moved(step.phrase), goal=step.goal and moved(step.goal))


def _corrected(steps: Sequence[Instruction], correction: Correction) -> tuple[int, bool]:
    """Return the index of the corrected step and whether its goal is corrected.

    It is the last step that contains the rejected phrase, else the last step.
    """
    last = len(steps) - 1
    if correction.goal is not None:
        return last, VERBS[steps[last].task].takes_goal
    if correction.rejected is not None:
        for at in range(last, -1, -1):
            for is_goal, phrase in ((False, steps[at].phrase), (True, steps[at].goal)):
                if phrase is not None and _mentions(phrase, correction.rejected):
                    return at, is_goal
    return last, False


def _mentions(phrase: ObjectPhrase, rejected: ObjectPhrase) -> bool:
    return all(
        getattr(rejected, name) in (None, getattr(phrase, name))
        for name in ("noun", "color", "size", "role", "superlative", "relation")
    )


def _readings(old: ObjectPhrase | None, new: ObjectPhrase) -> list[ObjectPhrase]:
    """Return the readings of a new phrase: with all other words of the old one, with its head's words, and alone."""
    if old is None or new.determiner != "the" or old.determiner != "the":
        return [new]
    kept = ObjectPhrase(
        noun=new.noun or old.noun,
        color=new.color or (old.color if new.excluded is None or new.excluded.color is None else None),
        relation=new.relation,
        anchors=new.anchors,
        size=new.size or old.size,
        role=new.role or old.role,
        superlative=new.superlative or old.superlative,
        excluded=new.excluded or old.excluded,
        position=new.position,
    )
    whole = replace(kept, relation=new.relation or old.relation, anchors=new.anchors or old.anchors)
    readings = [whole, kept, new] if new.noun is None else [new, whole, kept]
    return list(dict.fromkeys(readings))


def exact_reading(
    sentence: str, world: WorldModel, pointed: Sequence[int] = (), spoken: Sequence[int] = ()
) -> Reading | None:
    """Return the reading of a sentence that the own language understands in the world's scene, or None.

    pointed: the thing of each gesture. spoken: the things that were spoken of before, the likeliest of "it" first.
    """
    if world.scene is None:
        return None
    try:
        meaning = parse(sentence)
        if isinstance(meaning, Correction) or any(_is_bare(step.goal) for step in meaning.steps):
            return None
        understood = understand(meaning, world.scene, pointed, spoken)
    except LanguageError:
        return None
    clauses = []
    for step, instruction in zip(understood.steps, understood.instructions, strict=True):
        thing = step.goal if step.init is None else step.init
        assert thing is not None
        goal = step.goal if step.init is not None and KNOWN[step.task].takes_goal else None
        several = len(understood.steps) > len(meaning.steps)
        clauses.append(_clause(world, step.task, thing, goal, instruction, several))
    return Reading(tuple(clauses))


def _is_bare(goal: ObjectPhrase | None) -> bool:
    """Whether a place is a superlative alone: "to the right" is a direction, not the rightmost thing."""
    return goal is not None and goal.superlative is not None and goal.noun is None and goal.color is None


def _named(world: WorldModel, index: int) -> Entity:
    thing = world.things[index]
    role = "target" if thing.target else None
    return Entity(noun=thing.kind, colors=((thing.color,),), role=role, pointed=Gesture((index,)))


def _clause(world: WorldModel, task: str, thing: int, goal: int | None, instruction: object, several: bool) -> Clause:
    entity = _named(world, thing)
    places: tuple[RelationPhrase, ...] = ()
    if goal is not None:
        effect = KNOWN[task].effect
        name = {"out": "from", "goal": "spot_of"}.get(effect, "on" if effect == "on" else "in")
        places = (RelationPhrase(name, (_named(world, goal),)),)
    return Clause(task, entity, places, instruction=None if several else instruction, several=several)
