"""From an understood command to subtasks: the sentence, the referent and the target that the policy is given."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from envs.experts.moves import Move
from envs.interactive.interactive_env import InteractiveEnv
from envs.interactive.object_names import object_name, object_names
from language import (
    KINDS,
    VERBS,
    Describer,
    Instruction,
    LanguageError,
    ObjectPhrase,
    Understood,
    say,
)
from language.verbs import BASE, GOAL, OBJECT, has_goal


@dataclass(frozen=True)
class Subtask:
    """One step of a command.

    sentence: what the policy is given. referent, target: indices in the scene. move: on a board, where the referent
    goes; the target then marks that place.
    """

    sentence: str
    referent: int
    target: int | None = None
    move: Move | None = None


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
            if step.task != self.verb:
                task = f"task={self._config.name}, which does '{verb_words(self.verb)}'"
                raise LanguageError(f"'{verb_words(step.task)}' is not what {task}; choose another task")
            referent = step.goal if step.init is None else step.init
            target = None if step.init is None else step.goal
            assert referent is not None
            subtasks.append(Subtask(self.policy_sentence(instruction, referent, target), referent, target))
            self._check_target(subtasks[-1])
        return subtasks

    def _check_target(self, subtask: Subtask) -> None:
        scene, task = self._env.scene(), self._env.task
        if task.places and subtask.target is None:
            raise LanguageError(f"say where {object_name(subtask.referent, scene)} should go")
        if subtask.target is not None and scene.targets[subtask.target] == task.real_goals:
            name = object_name(subtask.target, scene)
            if task.real_goals:
                raise LanguageError(f"{name} is see-through; name a real object")
            raise LanguageError(f"{name} is not a target; name one of the see-through objects")

    def policy_sentence(self, instruction: Instruction | None, referent: int, target: int | None) -> str:
        """The instruction in words that the policy was trained with; "" if the task has no words.

        instruction: whose words are kept where the policy knows them; None: words are chosen. Kinds of phrase that the
        policy was not trained with, and words that require a gesture or an earlier sentence, are replaced by others
        that name the same object.
        """
        if not self._env.task.speaks:
            return ""
        phrases = [self._policy_phrase(instruction.phrase if instruction else None, referent)]
        if target is not None:
            phrases.append(self._policy_phrase(instruction.goal if instruction else None, target))
        return say(Instruction(self.verb, *phrases))

    def _policy_phrase(self, phrase: ObjectPhrase | None, index: int) -> ObjectPhrase:
        if self._env.task.points and not self._config.kinds:  # only the gesture tells the referent
            return ObjectPhrase(determiner="that")
        if phrase is not None and (phrase.kind in self._config.kinds or self._env.task.points):
            return phrase
        scene = self._env.scene()
        if self._config.kinds and self._describer.nameable(scene)[index]:
            return self._describer.phrase(scene, index, self._rng)
        if phrase is not None and phrase.determiner == "the":
            return phrase
        raise LanguageError(f"no words that this policy knows distinguish {object_name(index, scene)} from the others")

    def example(self) -> str:
        """A sentence that is possible in this scene."""
        scene = self._env.scene()
        movable = [index for index in range(len(scene)) if not scene.targets[index]]
        targets = [index for index in range(len(scene)) if scene.targets[index]]
        names = object_names(scene)
        verb = VERBS[self.verb]
        takes_goal = self._env.task.places and verb.takes_goal
        template = next(template for template in verb.templates if has_goal(template) == takes_goal)
        sentence = template.replace(OBJECT, names[movable[0]]).replace(BASE, names[movable[-1]])
        return sentence.replace(GOAL, f"to the same position as {names[targets[0]]}") if targets else sentence


def verb_words(verb: str) -> str:
    """The verb as words: "pick and place"."""
    return verb.replace("_", " ")
