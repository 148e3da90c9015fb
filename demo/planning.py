"""From an understood command to subtasks: the sentence, the referent and the target that the policy is given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from demo import room
from envs.experts.moves import Move
from envs.interactive.interactive_env import InteractiveEnv
from envs.interactive.object_names import object_name, object_names
from envs.tasks.feasible import Option
from language import (
    HAND,
    KINDS,
    VERBS,
    Describer,
    Instruction,
    LanguageError,
    ObjectPhrase,
    Scene,
    Understood,
    matches,
    say,
)
from language.verbs import BASE, GOAL, OBJECT, has_goal


@dataclass(frozen=True)
class Subtask:
    """One step of a command.

    sentence: what the policy is given. referent, target: indices in the scene. move: on a board, where the referent
    goes; the target then marks that place. verb: where the task has several. instruction: in the person's words.
    place: (3,) metres where the target is put as the step begins; None: it stays.
    """

    sentence: str
    referent: int
    target: int | None = None
    move: Move | None = None
    verb: str | None = None
    instruction: Instruction | None = None
    place: tuple[float, float, float] | None = None

    @property
    def objects(self) -> tuple[int, ...]:
        """The referent, and the target if there is one."""
        return (self.referent,) if self.target is None else (self.referent, self.target)


class Planner:
    """Plans for the task of this environment. verb: the task's verb, a key of language.VERBS."""

    def __init__(self, env: InteractiveEnv, rng: np.random.Generator) -> None:
        self._env, self._rng, self._config = env, rng, env.config.task
        self._describer = Describer(tuple(self._config.kinds) or KINDS)
        self.verb: str = env.task.verb

    def plan(self, understood: Understood) -> list[Subtask]:
        """A subtask for each step. Raises LanguageError for what this task cannot do."""
        subtasks = []
        for step, instruction in zip(understood.steps, understood.meaning.steps, strict=True):
            if step.task not in (self._env.task.verbs or (self.verb,)):
                task = f"task={self._config.name}, which does '{verb_words(self.verb)}'"
                raise LanguageError(f"'{verb_words(step.task)}' is not what {task}; choose another task")
            referent = step.goal if step.init is None else step.init
            target = None if step.init is None else step.goal
            assert referent is not None
            if self._env.task.verbs:
                subtasks.append(Subtask("", referent, target, verb=step.task, instruction=instruction))
                continue
            subtasks.append(Subtask(self.policy_sentence(instruction, referent, target), referent, target))
            self._check_target(subtasks[-1])
        return subtasks

    def begin(self, subtask: Subtask) -> Subtask:
        """The subtask with the policy's sentence, in the scene as it is now. Puts its target at its place.

        Raises LanguageError, and then nothing moves, if it cannot be done now.
        """
        if subtask.verb is None:
            return subtask
        scene, (referent, target) = self._env.scene(), (subtask.referent, subtask.target)
        if subtask.place is not None and target is not None:
            places = scene.positions.copy()
            places[target] = subtask.place
            scene = scene.moved(places)
        room.check(self._env, Option(subtask.verb, referent, target), scene)
        words = _still_fitting(subtask.instruction, referent, target, scene)
        sentence = self.policy_sentence(words, referent, target, subtask.verb, scene)
        if subtask.place is not None and target is not None:
            self._env.put_object(target, subtask.place)
        return replace(subtask, sentence=sentence)

    def _check_target(self, subtask: Subtask) -> None:
        scene, task = self._env.scene(), self._env.task
        if task.places and subtask.target is None:
            raise LanguageError(f"say where {object_name(subtask.referent, scene)} should go")
        if subtask.target is not None and scene.targets[subtask.target] == task.real_goals:
            name = object_name(subtask.target, scene)
            if task.real_goals:
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
        if not self._env.task.speaks:
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
        if self._env.task.verbs and (plain := room.plain_phrase(scene, index)) and plain.kind in self._config.kinds:
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
        takes_goal = self._env.task.places and verb.takes_goal
        template = next(template for template in verb.templates if has_goal(template) == takes_goal)
        sentence = template.replace(OBJECT, names[movable[0]]).replace(BASE, names[movable[-1]])
        return sentence.replace(GOAL, f"to the same position as {names[targets[0]]}") if targets else sentence


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
