"""From what was understood to what a policy is told: the jobs, and the words in which it knows how to hear them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from envs.interactive.interactive_env import InteractiveEnv
from language import (
    KINDS,
    VERBS,
    Describer,
    Instruction,
    LanguageError,
    ObjectPhrase,
    Scene,
    Understood,
    describe,
    say,
)
from language.verbs import BASE, GOAL, OBJECT, has_goal


@dataclass(frozen=True)
class Job:
    """One step of what was asked. sentence: as the policy hears it. referent, target: objects of the scene."""

    sentence: str
    referent: int
    target: int | None = None


class Planner:
    """What the task of this stage can do. verb: the task of the language that it is, with `doing` in words."""

    def __init__(self, stage: InteractiveEnv, rng: np.random.Generator) -> None:
        self._stage, self._rng, self._task = stage, rng, stage.config.task
        self._describer = Describer(tuple(self._task.kinds) or KINDS)
        self.verb: str = stage.task.verb
        self.doing = self.verb.replace("_", " ")

    def plan(self, understood: Understood) -> list[Job]:
        """A job for each step. Raises LanguageError for what this task does not do."""
        jobs = []
        for step, words in zip(understood.steps, understood.meaning.steps, strict=True):
            if step.task != self.verb:
                doing = f"task={self._task.name}, which does '{self.doing}'"
                raise LanguageError(f"'{step.task.replace('_', ' ')}' is not what {doing}; choose another task")
            first = step.goal if step.init is None else step.init
            second = None if step.init is None else step.goal
            assert first is not None
            jobs.append(Job(self.words(words, first, second), first, second))
            self._check(jobs[-1])
        return jobs

    def _check(self, job: Job) -> None:
        scene = self._stage.scene()
        if self._stage.task.places and job.target is None:
            raise LanguageError(f"say where {called(job.referent, scene)} is to go")
        if job.target is not None and not scene.targets[job.target]:
            raise LanguageError(f"{called(job.target, scene)} marks no place: name one of the see-through ones")

    def words(self, said: Instruction, referent: int, target: int | None) -> str:
        """The sentence as this policy knows how to hear it.

        Kinds that it was not taught, and words that only a gesture or what was said before can fill, are put in others
        that name the same object now.
        """
        if not self._stage.task.speaks:
            return ""
        phrases = [self._phrase(said.phrase, referent)]
        if target is not None:
            phrases.append(self._phrase(said.goal, target))
        return say(Instruction(said.task, *phrases))

    def _phrase(self, said: ObjectPhrase | None, index: int) -> ObjectPhrase:
        if self._stage.task.points and not self._task.kinds:  # the finger alone tells it
            return ObjectPhrase(determiner="that")
        if said is not None and (said.kind in self._task.kinds or self._stage.task.points):
            return said
        scene = self._stage.scene()
        if self._task.kinds and self._describer.nameable(scene)[index]:
            return self._describer.phrase(scene, index, self._rng)
        if said is not None and said.determiner == "the":
            return said
        raise LanguageError(f"no words that this policy knows tell {called(index, scene)} from its like")

    def example(self) -> str:
        """Something that can be said here."""
        scene = self._stage.scene()
        movable = [index for index in range(len(scene)) if not scene.targets[index]]
        targets = [index for index in range(len(scene)) if scene.targets[index]]
        names = all_called(scene)
        verb, takes = self.verb, bool(targets) and VERBS[self.verb].takes_goal
        form = next(t for t in VERBS[verb].templates if has_goal(t) == takes)
        said = form.replace(OBJECT, names[movable[0]]).replace(BASE, names[movable[-1]])
        return said.replace(GOAL, f"to the same position as {names[targets[0]]}") if takes else said


def all_called(scene: Scene) -> list[str]:
    """What each object is called."""
    return [called(index, scene) for index in range(len(scene))]


def called(index: int, scene: Scene) -> str:
    """The plainest name of one object."""
    try:
        return describe(index, scene)
    except LanguageError:  # no words tell it from its like
        return f"a {scene[index].color} {scene[index].noun}"
