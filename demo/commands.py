"""Sentences beyond the instruction grammar: from the steps that `language.commands` understands to subtasks.

A place that is no object becomes one: a see-through object of the scene is moved there, and the policy is given the
sentence that brings the referent to it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from demo import board
from demo.dialogue import Dialogue
from demo.planning import Planner, Subtask, verb_words
from envs.experts.moves import without_takes
from envs.interactive.interactive_env import InteractiveEnv
from envs.interactive.object_names import object_name
from language import LanguageError
from language.commands import Action

BIT = 1.5  # "a bit", in radii within which an object counts as being at its place
SAME_PLACE = 0.02  # metres within which a see-through object marks the place already
ON_TABLE = 0.01  # metres above the table below which a place is one on the table
# Verb of a task -> the kinds of step that it carries out.
DOES = {
    "reach": ("reach",),
    "grasp": ("take",),
    "lift": ("take",),
    "pick_and_place": ("place",),
    "stack": ("place",),
    "swipe": ("place", "push"),
    "push": ("push", "place"),
    "press": ("press",),
    "switch": ("switch",),
    "turn": ("turn",),
}
STOPS = ("stop", "wait", "home")


def dialogue(env: InteractiveEnv) -> Dialogue:
    """A dialogue about the environment's scene.

    Where only an object is named, what the task does is meant, unless it needs a place. "A bit" is farther than the
    distance within which the task counts an object as being at its place.
    """
    if env.task.stacks:
        return board.BoardDialogue(env)
    task = env.task
    default = None if task.places else DOES.get(task.verb, (None,))[0]
    little = BIT * env.config.task.radius
    return Dialogue(default, {"bounds": tuple(env.config.workspace.object_area), "little": little})


def stops(actions: Sequence[Action]) -> bool:
    """Whether the sentence asks the robot to stop."""
    return any(action.kind in STOPS for action in actions)


def moves(actions: Sequence[Action]) -> bool:
    """Whether a sentence has steps that move the arm to an object."""
    return any(action.object is not None for action in actions)


def plan(actions: Sequence[Action], planner: Planner, env: InteractiveEnv, for_policy: bool) -> list[Subtask]:
    """A subtask for each step that moves the arm. Moves see-through objects to the places that are meant.

    for_policy: whether a policy drives, which may need other words than the person's.

    Raises LanguageError for what the task cannot do, and then nothing moves.
    """
    if env.task.stacks:
        return board.plan(actions, env, planner if for_policy else None)
    steps = without_takes(actions)
    for action in steps:
        if action.kind not in DOES.get(planner.verb, ()) or action.object is None:
            task = f"task={env.config.task.name}, which does '{verb_words(planner.verb)}'"
            raise LanguageError(f"'{action.kind}' is not what {task}; choose another task")
    targets = _targets(steps, env)
    for action, target in zip(steps, targets, strict=True):
        if target is not None and action.position is not None and action.on != target:
            env.put_object(target, (*_within_reach(action.position, env), env.config.task.object_size / 2))
    subtasks = []
    for action, target in zip(steps, targets, strict=True):
        assert action.object is not None
        sentence = planner.policy_sentence(None, action.object, target)
        subtasks.append(Subtask(sentence, action.object, target))
    return subtasks


def _within_reach(position: tuple[float, float], env: InteractiveEnv) -> tuple[float, float]:
    """The nearest place where objects may be, metres: "the corner" is the corner of the area that the arm serves."""
    x0, x1, y0, y1 = env.config.workspace.object_area
    return float(np.clip(position[0], x0, x1)), float(np.clip(position[1], y0, y1))


def _targets(steps: Sequence[Action], env: InteractiveEnv) -> list[int | None]:
    """The object that marks the place of each step; None where the task has no places."""
    if not env.task.places:
        return [None] * len(steps)
    scene = env.scene()
    free = [index for index in range(len(scene)) if scene.targets[index]]
    targets: list[int | None] = []
    for action in steps:
        assert action.object is not None
        if action.position is None:
            raise LanguageError(f"say where {object_name(action.object, scene)} should go")
        if env.task.real_goals:
            if action.on is None:
                raise LanguageError("this task stacks; name the object to put it on, or choose task=nl_pick_and_place")
            targets.append(action.on)
            continue
        if action.bottom is not None and action.bottom > ON_TABLE:
            raise LanguageError("this task puts objects on the table; choose task=nl_stack to put one on another")
        if not free:
            raise LanguageError("too many places for one sentence: this scene has no further see-through object")
        place = np.array(_within_reach(action.position, env))
        distances = np.linalg.norm(scene.positions[free][:, :2] - place, axis=1)
        nearest = int(distances.argmin())
        marked = distances[nearest] < SAME_PLACE
        targets.append(free.pop(nearest if marked else len(free) - 1))
    return targets
