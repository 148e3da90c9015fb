"""From an understood command to subtasks: the sentence, the referent and the target that the policy is given."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np

from demo import room
from envs.experts.board import Move
from envs.interactive.interactive_env import InteractiveEnv, object_name, object_names
from envs.tasks.shared.feasible import Option
from envs.tasks.sort import is_sorted
from language import (
    HAND,
    KINDS,
    VERBS,
    Describer,
    GroundedStep,
    Instruction,
    LanguageError,
    ObjectPhrase,
    Scene,
    Understood,
    matches,
    say,
)
from language.verbs import BASE, EVERY, GOAL, OBJECT, has_goal

SORTING, PLACING = "sort", "pick_and_place"  # a task that places things also brings several to a marked place


@dataclass(frozen=True)
class Subtask:
    """One step of a command.

    sentence: what the policy is given. referent, target: indices in the scene. move: on a board, where the referent
    goes; the target then marks that place. verb: where the task has several. instruction: in the person's words.
    place: (3,) metres where the target is put during the step; None: it stays. mark: (3,) metres; where it
    is put at a free spot of the place that is marked there instead. any_order: whether the steps after it that are so,
    too, can be done before it.
    """

    sentence: str
    referent: int
    target: int | None = None
    move: Move | None = None
    verb: str | None = None
    instruction: Instruction | None = None
    place: tuple[float, float, float] | None = None
    mark: tuple[float, float, float] | None = None
    any_order: bool = False

    @property
    def objects(self) -> tuple[int, ...]:
        """The referent, and the target if there is one."""
        return (self.referent,) if self.target is None else (self.referent, self.target)


class Planner:
    """Plans for the task of this environment.

    verb: the task's verb, a key of language.VERBS. own_places: by index, of targets that were put elsewhere for a step;
    (3,) metres.
    """

    def __init__(self, env: InteractiveEnv, rng: np.random.Generator) -> None:
        self._env, self._rng, self._config = env, rng, env.config.task
        self._describer = Describer(tuple(self._config.kinds) or KINDS)
        self.verb: str = env.task.verb
        self.own_places: dict[int, tuple[float, float, float]] = {}

    def scene(self) -> Scene:
        """The objects as the language sees them: targets that were put elsewhere for a step are at their own places."""
        return _moved(self._env.scene(), self.own_places)

    @property
    def names_later(self) -> bool:
        """Whether the policy's words for a step are chosen as it begins."""
        return self._env.task.traits.stepwise

    def plan(self, understood: Understood) -> list[Subtask]:
        """A subtask for each step. Raises LanguageError for what this task cannot do."""
        subtasks = []
        for step, instruction in self._to_do(understood):
            if step.task not in (self._env.task.verbs or (self.verb,)) and not self._sorts(step):
                task = f"task={self._config.name}, which does '{verb_words(self.verb)}'"
                raise LanguageError(f"'{verb_words(step.task)}' is not what {task}; choose another task")
            referent = step.goal if step.init is None else step.init
            target = None if step.init is None else step.goal
            assert referent is not None
            every = instruction.phrase.determiner == EVERY
            words = None if every else instruction
            if self._sorts(step):
                mark = self.scene()[target or 0].position
                subtasks.append(
                    Subtask("", referent, target, verb=PLACING, instruction=words, mark=mark, any_order=every)
                )
            elif self._env.task.verbs:
                subtasks.append(Subtask("", referent, target, verb=step.task, instruction=words))
            elif self.names_later:
                subtasks.append(Subtask("", referent, target, instruction=words, any_order=every))
                self._check_target(subtasks[-1])
            else:
                subtasks.append(Subtask(self.policy_sentence(words, referent, target), referent, target))
                self._check_target(subtasks[-1])
        return subtasks

    def _sorts(self, step: GroundedStep) -> bool:
        """Whether a step brings something to a marked place where the task puts it there as one of its verbs."""
        return step.task == SORTING and PLACING in self._env.task.verbs and SORTING not in self._env.task.verbs

    def _to_do(self, understood: Understood) -> list[tuple[GroundedStep, Instruction]]:
        """The steps with their instructions, but for those of "every" that are done. Raises LanguageError for none."""
        pairs, scene = list(zip(understood.steps, understood.instructions, strict=True)), self.scene()
        left = [
            (step, instruction)
            for step, instruction in pairs
            if instruction.phrase.determiner != EVERY or not _is_sorted(scene, step)
        ]
        if not left:
            raise LanguageError(f"'{pairs[-1][1].phrase}' is there already")
        return left

    def begin_next(self, subtasks: deque[Subtask]) -> Subtask:
        """Takes the next of some subtasks, and begins it; of those in any order, the first that can be done now.

        Raises LanguageError if there is none, and then nothing moves.
        """
        errors = []
        for index in range(len(list(takewhile(lambda each: each.any_order, subtasks))) or 1):
            try:
                begun = self.begin(subtasks[index])
            except LanguageError as error:
                errors.append(error)
            else:
                del subtasks[index]
                return begun
        raise errors[0]

    def begin(self, subtask: Subtask) -> Subtask:
        """The subtask with the policy's sentence, in the scene as it is now. Puts its target at its place.

        Raises LanguageError, and then nothing moves, if it cannot be done now.
        """
        scene, referent, target, verb = self.scene(), subtask.referent, subtask.target, subtask.verb
        if verb is None:
            if subtask.move is not None or not self.names_later:
                return subtask
            words = _still_fitting(subtask.instruction, referent, target, scene)
            return replace(subtask, sentence=self.policy_sentence(words, referent, target))
        if subtask.mark is not None:
            subtask = replace(subtask, place=room.free_spot(self._env, referent, subtask.mark, scene))
        own_places = {}
        if subtask.place is not None and target is not None:
            own_places[target] = scene[target].position
            scene = _moved(scene, {target: subtask.place})
        room.check(self._env, Option(verb, referent, target), scene)
        words = _still_fitting(subtask.instruction, referent, target, scene)
        sentence = self.policy_sentence(words, referent, target, verb, scene)
        self.return_targets()
        if subtask.place is not None and target is not None:
            self._env.put_object(target, subtask.place)
        self.own_places = own_places
        return replace(subtask, sentence=sentence)

    def return_targets(self) -> None:
        """Puts targets that were put elsewhere for a step back at their own places."""
        for index, place in self.own_places.items():
            self._env.put_object(index, place)
        self.own_places = {}

    def _check_target(self, subtask: Subtask) -> None:
        scene, task = self._env.scene(), self._env.task
        if task.traits.places and subtask.target is None:
            raise LanguageError(f"say where {object_name(subtask.referent, scene)} should go")
        if subtask.target is not None and scene.targets[subtask.target] == task.traits.real_goals:
            name = object_name(subtask.target, scene)
            if task.traits.real_goals:
                raise LanguageError(f"{name} is see-through; name a real object")
            raise LanguageError(f"{name} is not a target; name one of the see-through objects")

    def policy_sentence(
        self,
        instruction: Instruction | None,
        referent: int,
        target: int | None,
        verb: str | None = None,
        scene: Scene | None = None,
    ) -> str:
        """The instruction in words that the policy was trained with; "" if the task has no words.

        instruction: whose words are kept where the policy knows them; None: words are chosen. Kinds of phrase that the
        policy was not trained with, and words that require a gesture or an earlier sentence, are replaced by others
        that name the same object. verb: where the task has several. scene: None: as it is.
        """
        if not self._env.task.traits.speaks:
            return ""
        scene = self._env.scene() if scene is None else scene
        phrases = [self._policy_phrase(instruction.phrase if instruction else None, referent, scene)]
        if target is not None and VERBS[verb or self.verb].takes_goal:
            phrases.append(self._policy_phrase(instruction.goal if instruction else None, target, scene))
        return say(Instruction(verb or self.verb, *phrases))

    def _policy_phrase(self, phrase: ObjectPhrase | None, index: int, scene: Scene) -> ObjectPhrase:
        if self._env.task.points and not self._config.kinds:  # only the gesture tells the referent
            return ObjectPhrase(determiner="that")
        if phrase is not None and (phrase.kind in self._config.kinds or self._env.task.points):
            return phrase
        if self._env.task.verbs or self.names_later:
            plain = room.plain_phrase(scene, index)
            if plain is not None and plain.kind in self._config.kinds:
                return plain
        if self._config.kinds and self._describer.nameable(scene)[index]:
            return self._describer.phrase(scene, index, self._rng)
        if phrase is not None and phrase.determiner == "the":
            return phrase
        raise LanguageError(f"no words that this policy knows distinguish {object_name(index, scene)} from the others")

    def in_words(self, subtask: Subtask, names: Sequence[str]) -> str:
        """The subtask with these names of the objects."""
        referent, target = names[subtask.referent], None if subtask.target is None else names[subtask.target]
        if subtask.verb is not None:
            return room.in_words(subtask.verb, referent, target)
        verb = self.verb if subtask.move is None else "place" if subtask.move.release else "take"
        return f"{verb_words(verb)} {referent}" + (f" to {target}" if target and subtask.move is None else "")

    def example(self) -> str:
        """A sentence that is possible in this scene."""
        if self._env.task.verbs:
            return next(iter(room.sayable(self._env)), "stop")
        scene = self._env.scene()
        movable = [index for index in range(len(scene)) if not scene.targets[index] and scene[index].noun != HAND]
        targets = [index for index in range(len(scene)) if scene.targets[index]]
        names = object_names(scene)
        verb = VERBS[self.verb]
        takes_goal = self._env.task.traits.places and verb.takes_goal
        template = next(template for template in verb.templates if has_goal(template) == takes_goal)
        base = names[targets[0] if targets and not verb.goal_is_real else movable[-1]]
        sentence = template.replace(OBJECT, names[movable[0]]).replace(BASE, base)
        if verb.takes_every:
            colors = scene.colors[movable].tolist()
            thing = scene[max(movable, key=lambda index: colors.count(scene.colors[index]))]
            return template.replace(OBJECT, f"{EVERY} {thing.color} {thing.noun}").replace(BASE, base)
        return sentence.replace(GOAL, f"to the same position as {names[targets[0]]}") if targets else sentence


def _moved(scene: Scene, places: Mapping[int, tuple[float, float, float]]) -> Scene:
    """The scene with some objects at other places, metres."""
    positions = scene.positions.copy()
    for index, place in places.items():
        positions[index] = place
    return scene.moved(positions)


def _is_sorted(scene: Scene, step: GroundedStep) -> bool:
    """Whether what a step is to sort lies at its place."""
    if step.task != SORTING or step.init is None or step.goal is None:
        return False
    return lies_at(step.init, scene[step.goal].position, scene)


def lies_at(index: int, mark: tuple[float, float, float], scene: Scene) -> bool:
    """Whether the object lies at a marked place, metres."""
    return bool(is_sorted(scene.positions[index], np.array(mark), scene[index].size))


def _still_fitting(
    instruction: Instruction | None, referent: int, target: int | None, scene: Scene
) -> Instruction | None:
    """The instruction, if its words name the same objects in this scene; else None."""
    if instruction is None:
        return None
    phrases = (instruction.phrase, instruction.goal)
    for phrase, index in zip(phrases, (referent, target), strict=True):
        if phrase is not None and phrase.determiner == "the":
            try:
                fits = np.flatnonzero(matches(phrase, scene)).tolist()
            except LanguageError:
                return None
            if fits != [index]:
                return None
    return instruction


def verb_words(verb: str) -> str:
    """The verb as words: "pick and place"."""
    return verb.replace("_", " ")
