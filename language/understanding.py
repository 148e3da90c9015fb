"""From a sentence and a scene to what is to be done with which object: `parse`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import overload

from language.errors import LanguageError, NothingFits, SeveralFit
from language.grammar import parse_words
from language.grounding import PhraseResolver
from language.instruction import Chain, Command, Correction, Instruction, Meaning, ObjectPhrase
from language.objects import Scene
from language.task_generation import scene_after
from language.verbs import HERE, POINTING, VERBS


@dataclass(frozen=True)
class GroundedStep:
    """One thing to do. init: index of the object that is moved, goal: of the one it goes to, or that is acted on.

    reward, networks: the name of the reward and the number of networks that the original system trains it with.
    """

    task: str
    init: int | None
    goal: int | None
    reward: str
    networks: int


@dataclass(frozen=True)
class Understood:
    """What a sentence asks for in a scene. meaning: its tree. steps: at least one. result: the scene afterwards.

    pointed: what each gesture singled out.
    """

    meaning: Command
    steps: tuple[GroundedStep, ...]
    result: Scene
    pointed: tuple[int, ...] = ()


@overload
def parse(sentence: str) -> Meaning: ...
@overload
def parse(
    sentence: str, scene: Scene, pointed: Sequence[int] = (), previous: Command | Understood | None = None
) -> Understood: ...
def parse(
    sentence: str, scene: Scene | None = None, pointed: Sequence[int] = (), previous: Command | Understood | None = None
) -> Meaning | Understood:
    """What the sentence asks for: its tree alone or, with a scene, what to do with which objects.

    pointed: the object that each gesture singles out, in the order of the words that need one ("this", "there").
    previous: the instruction before, which a correction ("no, the blue one") revises; with its gestures where it is
        given as it was understood.
    Raises NotUnderstood, NothingFits or SeveralFit, each with the position in the sentence; never picks silently.
    """
    meaning = parse_words(sentence)
    if scene is None:
        return meaning
    if isinstance(meaning, Correction):
        if previous is None:
            raise NothingFits("there is no instruction before that this could correct; say what to do", sentence, 0)
        return revise(previous, meaning, scene, pointed)
    return understand(meaning, scene, pointed)


def understand(command: Command, scene: Scene, pointed: Sequence[int] = ()) -> Understood:
    """The command's steps, each grounded in the scene that the steps before leave. Raises NothingFits, SeveralFit."""
    listener = PhraseResolver(scene, pointed)
    steps: list[GroundedStep] = []
    for instruction in command.steps:
        step = _step(instruction, listener)
        listener.it = step.goal if step.init is None else step.init
        listener.scene = scene_after(step.task, step.init, step.goal, listener.scene)
        steps.append(step)
    return Understood(command, tuple(steps), listener.scene, tuple(pointed))


def _step(instruction: Instruction, listener: PhraseResolver) -> GroundedStep:
    task = VERBS[instruction.task]
    among = ~listener.scene.targets if task.moves else None  # a target only marks a place: nobody can move it
    named = listener.resolve(instruction.phrase, among)
    real = ~listener.scene.targets if task.effect == "on" else None  # nothing can stand on a target
    goal = None if instruction.goal is None else listener.resolve(instruction.goal, real)
    if goal == named:
        message = f"'{instruction.goal}' is the object itself that is to be moved; say another place"
        raise NothingFits(message, str(instruction.goal), instruction.goal.position if instruction.goal else 0)
    if task.moves:
        return GroundedStep(instruction.task, named, goal, task.reward, task.networks)
    return GroundedStep(instruction.task, None, named, task.reward, task.networks)


def revise(
    previous: Command | Understood, correction: Correction, scene: Scene, pointed: Sequence[int] = ()
) -> Understood:
    """The instruction before with what the correction changes, in the scene it was said in.

    "one" and "object" keep the words of before that the correction does not change ("no, the blue one" after "the
    red cube" is the blue cube); a phrase with a noun of its own stands alone unless, after "not the cube, the
    sphere", only the rest of the words before makes it single. Raises NothingFits or SeveralFit.
    """
    first: LanguageError | None = None
    pointed = _left_over(correction.rejected, pointed)
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
    """A gesture for each word of the command that needs one: that of before, or a new one in the changed phrase."""
    old, gestures = list(before.pointed), []
    for number, (was, now) in enumerate(zip(_phrases(before.meaning), _phrases(command), strict=True)):
        used, needed = _pointing(was), _pointing(now)
        mine, old = old[:used], old[used:] or old[-1:]
        gestures += (list(pointed) * needed)[:needed] if number == changed else mine
    return gestures


def _phrases(command: Command) -> list[ObjectPhrase | None]:
    return [phrase for step in command.steps for phrase in (step.phrase, step.goal)]


def _pointing(phrase: ObjectPhrase | None) -> int:
    """How many of its words need a gesture."""
    return 0 if phrase is None else sum(part.determiner in (*POINTING, *HERE) for part in phrase.parts())


def _left_over(rejected: ObjectPhrase | None, pointed: Sequence[int]) -> Sequence[int]:
    """The gestures that what is rejected ("not that one, this one") does not use up; the last one stays."""
    used = _pointing(rejected)
    return pointed[min(used, len(pointed) - 1) :] if used and len(pointed) else pointed


def _revisions(previous: Command, correction: Correction) -> list[Command]:
    """What the correction may come to, the likeliest first."""
    steps = list(previous.steps)
    at, is_goal = _corrected(steps, correction)
    new = correction.phrase or correction.goal
    assert new is not None
    steps = [_at(new.position, step) for step in steps]  # what fails is told by its place in this sentence
    old = steps[at].goal if is_goal else steps[at].phrase
    commands: list[Command] = []
    for phrase in _readings(old, new):
        try:
            changed = Instruction(
                steps[at].task, steps[at].phrase if is_goal else phrase, phrase if is_goal else steps[at].goal
            )
        except LanguageError:  # a place for a task that takes none
            continue
        revised = (*steps[:at], changed, *steps[at + 1 :])
        commands.append(revised[0] if len(revised) == 1 else Chain(revised))
    return commands


def _at(position: int, step: Instruction) -> Instruction:
    def moved(phrase: ObjectPhrase) -> ObjectPhrase:
        return replace(phrase, position=position, anchors=tuple(map(moved, phrase.anchors)))

    return replace(step, phrase=moved(step.phrase), goal=step.goal and moved(step.goal))


def _corrected(steps: Sequence[Instruction], correction: Correction) -> tuple[int, bool]:
    """Which step is corrected, and whether it is its goal: the last that says what is rejected, or the last of all."""
    last = len(steps) - 1
    if correction.goal is not None:
        return last, VERBS[steps[last].task].takes_goal
    if correction.rejected is not None:
        for at in range(last, -1, -1):
            for is_goal, phrase in ((False, steps[at].phrase), (True, steps[at].goal)):
                if phrase is not None and _says(phrase, correction.rejected):
                    return at, is_goal
    return last, False


def _says(phrase: ObjectPhrase, rejected: ObjectPhrase) -> bool:
    return all(
        getattr(rejected, name) in (None, getattr(phrase, name))
        for name in ("noun", "color", "size", "role", "superlative", "relation")
    )


def _readings(old: ObjectPhrase | None, new: ObjectPhrase) -> list[ObjectPhrase]:
    """The new phrase with all of the old one's other words, with its head's other words, and by itself."""
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
