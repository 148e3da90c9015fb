"""Sentences beyond the instruction grammar: from the steps that `language.commands` understands to subtasks.

Where a sentence names a place without an object, a see-through object of the scene is moved there, and the policy is
given the sentence that brings the referent to it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from demo import board, room
from demo.dialogue import Dialogue
from demo.planning import Planner, Subtask, lies_at, verb_words
from envs.experts.board import CARRIED, Move, moves_of, without_takes
from envs.interactive.interactive_env import InteractiveEnv, object_name, object_names
from envs.tasks.shared.feasible import HANDING
from envs.tasks.sort import is_sorted
from language import HAND, NOUNS, LanguageError, Scene
from language.commands import Action

BIT = 1.5  # "a bit", in radii within which an object counts as being at its place
SAME_PLACE = 0.02  # metres within which a see-through object marks the place already
HOLD = 0.15  # metres above the table at which a taken object is held
ON_TABLE = 0.01  # metres above the table below which a place counts as on the table
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
    "hand_over": ("place",),
    "sort": ("place",),
}
FIXTURES = {"drawer": "drawer", "door": "fridge"}  # a fitting in commands -> its noun
STOPS = ("stop", "wait", "home")


def dialogue(env: InteractiveEnv) -> Dialogue:
    """A dialogue about the environment's scene.

    A sentence that only names an object means the task's own verb, unless that needs a place. "A bit" is farther than
    the distance within which the task counts an object as being at its place.
    """
    if env.task.traits.stacks:
        return board.BoardDialogue(env)
    task = env.task
    default = None if task.traits.places else DOES.get(task.verb, (None,))[0]
    little = BIT * env.config.task.radius
    surroundings = {"bounds": tuple(env.config.workspace.object_area), "little": little}
    if task.verbs:
        default, surroundings["fixtures"] = None, tuple(FIXTURES)
    return Dialogue(default, surroundings, lambda: env.held)


def names_of(env: InteractiveEnv) -> list[str]:
    """The name of each object."""
    if env.task.verbs:
        return room.names_of(env.scene())
    return board.object_names(env) if env.task.traits.stacks else object_names(env.scene())


def sayable(env: InteractiveEnv) -> list[str]:
    """The feasible instructions as sentences; [] if the task has one verb."""
    return room.sayable(env) if env.task.verbs else []


def example(env: InteractiveEnv, planner: Planner) -> str:
    """A sentence that is possible in this scene."""
    return board.example(env) if env.task.traits.stacks else planner.example()


def stops(actions: Sequence[Action]) -> bool:
    """Whether the sentence asks the robot to stop."""
    return any(action.kind in STOPS for action in actions)


def moves(actions: Sequence[Action]) -> bool:
    """Whether a sentence has steps that move the arm to an object."""
    return any(action.object is not None or action.fixture is not None for action in actions)


def plan(actions: Sequence[Action], planner: Planner, env: InteractiveEnv, for_policy: bool) -> list[Subtask]:
    """A subtask for each step that moves the arm. Moves see-through objects to the places that are meant.

    Args:
        actions: the steps of a command.
        planner: of the environment's task.
        env: whose scene the command is about.
        for_policy: whether a policy drives, which may need other words than the person's.

    Raises:
        LanguageError: the task cannot do a step; nothing moves then.
    """
    if env.task.traits.stacks:
        return board.plan(actions, env, planner if for_policy else None)
    steps = without_takes(actions)
    if env.task.verbs:
        scene = planner.scene()
        return _around_marks([(action, _of_room(action, scene, env)) for action in steps], scene)
    moves = _moves(steps, planner, env)
    for action, move in zip(steps, moves, strict=True):
        if move is None and (action.kind not in DOES.get(planner.verb, ()) or action.object is None):
            task = f"task={env.config.task.name}, which does '{verb_words(planner.verb)}'"
            raise LanguageError(f"'{action.kind}' is not what {task}; choose another task")
    by_task = [action for action, move in zip(steps, moves, strict=True) if move is None]
    targets = _targets(by_task, env.scene(), env)
    for action, target in zip(by_task, targets, strict=True):
        if planner.names_later:  # the task finds a spot at its target itself
            break
        if target is not None and action.position is not None and action.on != target:
            env.put_object(target, (*_within_reach(action.position, env), env.config.task.object_size / 2))
    left = iter(targets)
    return [_subtask(action, move, left, planner) for action, move in zip(steps, moves, strict=True)]


def _of_room(action: Action, scene: Scene, env: InteractiveEnv) -> Subtask:
    """The subtask of a step where the task has several verbs. A see-through object marks a place on the table."""
    thing = action.object
    if action.fixture is not None:
        noun = list(NOUNS).index(FIXTURES[action.fixture])
        return Subtask("", int(np.flatnonzero(scene.nouns == noun)[0]), verb=action.kind)
    if thing is not None and action.kind == "reach":
        return Subtask("", thing, verb="reach")
    if thing is not None and action.kind == "take":
        boxes = np.flatnonzero(room.room_of(env).inside[thing]).tolist()
        return Subtask("", thing, boxes[0], verb="take_out") if boxes else Subtask("", thing, verb="lift")
    if thing is None or action.kind not in CARRIED or action.position is None:
        raise LanguageError(f"'{action.kind}' is not what this robot does here: try '{room.sayable(env)[0]}'")
    on = action.on
    if on is not None and scene.targets[on]:
        on = None
    if on is not None:
        found = room.room_of(env)
        return Subtask("", thing, on, verb="put_in" if found.fits[on] else HANDING if found.hands[on] else "stack")
    target, place = _targets([action], scene, env)[0], _within_reach(action.position, env)
    assert target is not None
    marked = np.linalg.norm(scene.positions[target, :2] - place) < SAME_PLACE
    height = env.config.task.object_size / 2
    return Subtask("", thing, target, verb="pick_and_place", place=None if marked else (*place, height))


def _around_marks(steps: Sequence[tuple[Action, Subtask]], scene: Scene) -> list[Subtask]:
    """The subtasks. Several things that go to a marked place get the spots around it that are free at their turn.

    What lies there already stays. Raises LanguageError if all of them do.
    """
    gathered: dict[int, Subtask] = {}  # by index of the step
    for index, (action, subtask) in enumerate(steps):
        at_mark = subtask.target is not None and scene.targets[subtask.target] and subtask.place is None
        follows = index - 1 in gathered and gathered[index - 1].target == subtask.target
        if action.several and subtask.target is not None and (at_mark or follows):
            gathered[index] = replace(subtask, place=None, mark=scene[subtask.target].position)
    left = [gathered.get(index, subtask) for index, (_, subtask) in enumerate(steps)]
    left = [each for each in left if each.mark is None or not lies_at(each.referent, each.mark, scene)]
    if not left:
        raise LanguageError("they are there already")
    return left


def _subtask(action: Action, move: Move | None, targets: Iterator[int | None], planner: Planner) -> Subtask:
    """The subtask of a step. targets: of the following steps that the task does itself."""
    assert action.object is not None
    if move is not None:
        return Subtask("", action.object, None, move)
    target = next(targets)
    if planner.names_later:
        return Subtask("", action.object, target)
    return Subtask(planner.policy_sentence(None, action.object, target), action.object, target)


def _moves(steps: Sequence[Action], planner: Planner, env: InteractiveEnv) -> list[Move | None]:
    """For each step that the task itself does not do, the expert's move; None for the others.

    Where the gripper can hold objects, everything is taken and brought to every place, also onto other objects.
    """
    places = [tuple(place) for place in env.scene().positions[:, :2].tolist()]
    moves: list[Move | None] = []
    for action in steps:
        can = env.task.traits.grips and action.object is not None and action.kind in (*CARRIED, "take")
        by_expert = can and not _does_itself(action, planner, env)
        table = _Table(env)
        moves += moves_of([action], places, range(len(places)), table, hold=table.hold) if by_expert else [None]
        if action.object is not None and action.position is not None:
            places[action.object] = action.position
    return moves


def _does_itself(action: Action, planner: Planner, env: InteractiveEnv) -> bool:
    """Whether the task itself does a step: bring something onto the table, onto another object, or neither."""
    if action.kind not in DOES.get(planner.verb, ()):
        return False
    if env.task.traits.stepwise:
        scene, at = env.scene(), (*(action.position or (np.inf, np.inf)), action.bottom or 0.0)
        height = (0.0, 0.0, env.config.task.object_size / 2)
        return bool(is_sorted(np.add(at, height), scene.positions[scene.targets.argmax()], env.config.task.object_size))
    if HAND in env.task.fixtures:
        return action.on is not None and env.scene()[action.on].noun == HAND
    return not env.task.traits.places or ((action.bottom or 0.0) > ON_TABLE) == env.task.traits.real_goals


class _Table:
    """The places of a table, for `moves_of`. hold: the height of the bottom of a held object, metres."""

    def __init__(self, env: InteractiveEnv) -> None:
        self._env, self._half = env, env.config.task.object_size / 2
        self.hold = min(HOLD, env.config.workspace.gripper_box[-1] - env.grip_depth - self._half)

    def place(self, column: float, row: float, level: float) -> NDArray[np.float64]:
        """(3,) the centre of an object at x, y whose bottom is at a height; all in metres."""
        return np.array([*_within_reach((column, row), self._env), level + self._half])


def _within_reach(position: tuple[float, float], env: InteractiveEnv) -> tuple[float, float]:
    """The nearest place where objects may be, metres: "the corner" is the corner of the area that the arm serves."""
    x0, x1, y0, y1 = env.config.workspace.object_area
    return float(np.clip(position[0], x0, x1)), float(np.clip(position[1], y0, y1))


def put_object(env: InteractiveEnv, planner: Planner, index: int, place: NDArray[np.float64]) -> None:
    """Puts an object at (2,) metres on the table, or at the nearest place where objects may stand, for good."""
    if env.bodies()[index] is None:
        raise LanguageError(f"{object_name(index, env.scene())} stays where it is; press Shuffle for another scene")
    x, y = _within_reach((float(place[0]), float(place[1])), env)
    on_table = x, y, env.config.task.object_size / 2
    planner.own_places.pop(index, None)
    env.put_object(index, board.free_place(env, index, x, y) if env.task.traits.stacks else on_table)


def _targets(steps: Sequence[Action], scene: Scene, env: InteractiveEnv) -> list[int | None]:
    """The object that marks the place of each step; None if the task has no places."""
    if not env.task.traits.places:
        return [None] * len(steps)
    if env.task.traits.stepwise:
        return [int(scene.targets.argmax())] * len(steps)
    free = [index for index in range(len(scene)) if scene.targets[index]]
    targets: list[int | None] = []
    for action in steps:
        assert action.object is not None
        if action.position is None:
            raise LanguageError(f"say where {object_name(action.object, scene)} should go")
        if env.task.traits.real_goals:
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
