"""From the steps of a plan to subtasks: the sentence, the referent and the target that the policy is given.

Where a step brings something to a place without an object, a see-through object of the scene is moved there, and the
policy is given the sentence that brings the referent to it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray

from demo import board, room, worlds
from envs.experts.board import Move, moves_of, without_takes
from envs.interactive.interactive_env import InteractiveEnv, object_name, object_names
from envs.tasks.shared.feasible import Option
from envs.tasks.shared.free_places import BESIDE
from envs.tasks.sort import is_sorted
from language import (
    HAND,
    KINDS,
    VERBS,
    Describer,
    Instruction,
    LanguageError,
    ObjectPhrase,
    Scene,
    Step,
    matches,
    say,
)
from language.verbs import BASE, EVERY, GOAL, KNOWN, OBJECT, PLACING, Act, doing, has_goal

SAME_PLACE = 0.02  # metres within which a see-through object marks the place already
HOLD = 0.15  # metres above the table at which a taken object is held
ON_TABLE = 0.01  # metres above the table below which a place counts as on the table


@dataclass(frozen=True)
class Subtask:
    """One step of a command.

    sentence: what the policy is given. referent, target: indices in the scene. move: on a board, where the referent
    goes; the target then marks that place. verb: where the task has several. instruction: in the person's words.
    place: (3,) metres where the target is put during the step; None: it stays. mark: (3,) metres; where it
    is put at a free spot of the place that is marked there instead. named: whether the person named the target, which
    marks the place otherwise. any_order: whether the steps after it that are so, too, can be done before it. number: of
    the step in its plan. second_try: whether the expert carries it out, since the policy did not manage it.
    """

    sentence: str
    referent: int
    target: int | None = None
    move: Move | None = None
    verb: str | None = None
    instruction: Instruction | None = None
    place: tuple[float, float, float] | None = None
    mark: tuple[float, float, float] | None = None
    named: bool = True
    any_order: bool = False
    number: int = 0
    second_try: bool = False

    @property
    def objects(self) -> tuple[int, ...]:
        """The referent, and the target if there is one."""
        return (self.referent,) if self.target is None else (self.referent, self.target)


class AlreadySo(LanguageError):
    """Nothing is left to do."""


class SubtaskPlanner:
    """Plans for the task of this environment.

    verb: the task's verb, a key of language.VERBS. own_places: by index, of targets that were put elsewhere for a step;
    (3,) metres. viewpoint: of the names that a person reads; policies are given words from the task's own.
    """

    def __init__(self, env: InteractiveEnv, rng: np.random.Generator) -> None:
        self._env, self._rng, self._config = env, rng, env.config.task
        self.viewpoint: str = env.config.task.viewpoint
        self._describer = Describer(tuple(self._config.kinds) or KINDS)
        self.verb: str = env.task.verb
        self.own_places: dict[int, tuple[float, float, float]] = {}

    def scene(self) -> Scene:
        """The objects as the language sees them: targets that were put elsewhere for a step are at their own places."""
        return _moved(self._env.scene(), self.own_places)

    def _name(self, index: int) -> str:
        """The name of an object, as a person reads it."""
        return object_name(index, worlds.seen_from(self._env.scene(), self.viewpoint))

    @property
    def names_later(self) -> bool:
        """Whether the policy's words for a step are chosen as it begins."""
        return self._env.task.traits.stepwise

    def plan(self, steps: Sequence[Step], for_policy: bool) -> list[Subtask]:
        """A subtask for each step that moves the arm. Raises LanguageError for what this task cannot do.

        for_policy: whether a policy drives, which may need other words than the person's.
        """
        if self._env.task.traits.stacks:
            subtasks = self._on_board(steps, for_policy)
        elif self._env.task.verbs:
            to_do = self._to_do(self._without_takes_in_room(steps))
            subtasks = [self._in_room(step) for step in self._opened_wide(to_do)]
        else:
            subtasks = self._on_table(self._to_do(without_takes(steps)))
        return [replace(subtask, number=number) for number, subtask in enumerate(subtasks)]

    def _without_takes_in_room(self, steps: Sequence[Step]) -> list[Step]:
        """Return the steps without takes, but for things that go only a bit aside: they leave their place first."""
        scene, kept = self.scene(), without_takes(steps)
        near = BESIDE * self._env.config.task.object_size
        found: list[Step] = []
        for step in kept:
            take = next((each for each in steps if each.takes and each.object == step.object), None)
            apart = np.subtract(step.place or (np.inf, np.inf), scene.positions[step.object, :2])
            if take is not None and take not in kept and not step.several and np.linalg.norm(apart) < near:
                found.append(take)
            found.append(step)
        return found

    def _opened_wide(self, steps: Sequence[Step]) -> list[Step]:
        """Return the steps with those that close and open what is open, but too little for something to go through."""
        narrow, found = room.narrow(self._env), list[Step]()
        for step in steps:
            if step.goal in narrow:
                found += [Step(verb, step.goal, implied=True) for verb in map(doing, (Act.SHUT, Act.OPEN))]
                narrow.discard(step.goal)
            if step.act in (Act.OPEN, Act.SHUT):
                narrow.discard(step.object)
            found.append(step)
        return found

    def _on_board(self, steps: Sequence[Step], for_policy: bool) -> list[Subtask]:
        scene, grid = self._env.scene(), board.grid_of(self._env)
        cells = [(float(x), float(y)) for x, y, _ in grid.cells(scene.positions)]
        marker = next(iter(np.flatnonzero(scene.targets).tolist()), None)
        subtasks = []
        for move in moves_of(steps, cells, range(len(scene)), grid):
            target = marker if move.release else None
            words = self.policy_sentence(None, move.thing, target) if for_policy and target is not None else ""
            subtasks.append(Subtask(words, move.thing, target, move))
        return subtasks

    def _to_do(self, steps: Sequence[Step]) -> list[Step]:
        """The steps but for those of several that lie where they shall go. Raises LanguageError if all do."""
        scene = self.scene()
        left = [step for step in steps if not (step.several and self._is_there(step, scene))]
        if steps and not left:
            raise AlreadySo("they are there already")
        return left

    def _is_there(self, step: Step, scene: Scene) -> bool:
        marked = step.goal is not None and scene.targets[step.goal]
        return bool(marked) and step.goal is not None and lies_at(step.object, scene[step.goal].position, scene)

    def _in_room(self, step: Step) -> Subtask:
        """The subtask of a step where the task has several verbs. A see-through object marks a place on the table."""
        words, scene = _instruction_of(step), self.scene()
        if step.act is Act.UNSTACK:
            return Subtask("", step.object, verb=step.verb, instruction=words)
        if not step.carries or (step.goal is not None and not scene.targets[step.goal]):
            return Subtask("", step.object, step.goal, verb=step.verb, instruction=words)
        assert step.place is not None
        target = step.goal if step.goal is not None else self._target(step, scene)
        place = np.array(within_reach(step.place, self._env))
        marked = np.linalg.norm(scene.positions[target, :2] - place) < SAME_PLACE
        if step.several and step.goal is not None:
            return Subtask("", step.object, target, verb=PLACING, mark=scene[target].position, any_order=True)
        height = self._env.config.task.object_size / 2
        at = None if marked else (float(place[0]), float(place[1]), height)
        named = step.goal is not None
        return Subtask("", step.object, target, verb=step.verb, instruction=words, place=at, named=named)

    def _target(self, step: Step, scene: Scene) -> int:
        """The see-through object nearest to where a step puts its object."""
        targets = np.flatnonzero(scene.targets)
        if not len(targets):
            raise LanguageError("this scene has no see-through object that could mark the place")
        away = np.linalg.norm(scene.positions[targets][:, :2] - np.array(step.place), axis=1)
        return int(targets[away.argmin()]) if away.min() < SAME_PLACE else int(targets[-1])

    def _on_table(self, steps: Sequence[Step]) -> list[Subtask]:
        """The subtasks where the task has one verb: its own, and for other steps moves of the expert."""
        positions, half = self._env.scene().positions, self._env.config.task.object_size / 2
        places = [tuple(place) for place in positions[:, :2].tolist()]
        raised = set(np.flatnonzero(positions[:, 2] > half + ON_TABLE).tolist())  # where no policy has seen its object
        moves: list[Move | None] = []
        for step in steps:
            moved = self._env.task.traits.grips and (step.carries or step.takes)
            by_expert = moved and (step.object in raised or not self._does(step))
            by_expert |= step is steps[0] and self._empties_gripper(steps)
            table = _Table(self._env)
            moves += moves_of([step], places, range(len(places)), table, hold=table.hold) if by_expert else [None]
            if step.place is not None:
                places[step.object] = step.place
                raised -= {step.object}
                raised |= {step.object} if (step.bottom or 0.0) > ON_TABLE else set()
        own = [step for step, move in zip(steps, moves, strict=True) if move is None]
        for step in own:
            if not self._can(step):
                doing = f"in this scene I only {verb_words(self.verb)}, and do not {verb_words(step.verb)}"
                raise LanguageError(f"{doing}; choose another scene in the bar, such as 'anything', for that")
        targets = self._targets(own)
        for step, target in zip(own, targets, strict=True):
            if target is not None and step.place is not None and step.goal != target and not self.names_later:
                place = (*within_reach(step.place, self._env), self._env.config.task.object_size / 2)
                if np.linalg.norm(self._env.scene().positions[target, :2] - place[:2]) >= SAME_PLACE:
                    self._env.put_object(target, place)
        left = iter(targets)
        subtasks = []
        for step, move in zip(steps, moves, strict=True):
            subtasks.append(
                Subtask("", step.object, None, move) if move is not None else self._subtask(step, next(left))
            )
        return subtasks

    def _subtask(self, step: Step, target: int | None) -> Subtask:
        words = _instruction_of(step)
        if self.names_later:
            subtask = Subtask("", step.object, target, instruction=words, any_order=step.several)
        else:
            fitting = _still_fitting(words, step.object, target, self._env.scene())
            subtask = Subtask(self.policy_sentence(fitting, step.object, target), step.object, target)
        subtask = replace(subtask, named=step.goal is not None)
        self._check_target(subtask)
        return subtask

    def _can(self, step: Step) -> bool:
        """Whether the task's verb carries out a step."""
        verb = KNOWN[self.verb]
        if step.carries:
            return verb.effect in ("goal", "on", "hand") and (verb.act is not Act.NEVER or step.verb == self.verb)
        return step.verb == self.verb or (step.takes and verb.act in (Act.TAKE, Act.HOLD))

    def _empties_gripper(self, steps: Sequence[Step]) -> bool:
        """Whether the first step lays aside what is held, for something else: no object need mark its place."""
        first = steps[0]
        lays_aside = first.carries and first.goal is None and first.object == self._env.held
        return lays_aside and any(step.object != first.object for step in steps)

    def _does(self, step: Step) -> bool:
        """Whether the task itself does a step: bring something onto the table, onto another object, or neither."""
        if not self._can(step):
            return False
        task, size = self._env.task, self._env.config.task.object_size
        if task.traits.stepwise:
            scene, at = self._env.scene(), (*(step.place or (np.inf, np.inf)), (step.bottom or 0.0) + size / 2)
            return bool(is_sorted(np.array(at), scene.positions[scene.targets.argmax()], size))
        if HAND in task.fixtures:
            return step.goal is not None and self._env.scene()[step.goal].noun == HAND
        return not task.traits.places or ((step.bottom or 0.0) > ON_TABLE) == task.traits.real_goals

    def _targets(self, steps: Sequence[Step]) -> list[int | None]:
        """The target of each step that the task does itself: what it goes on, or the object that marks its place."""
        scene, task = self._env.scene(), self._env.task
        free = [index for index in range(len(scene)) if scene.targets[index]]
        targets: list[int | None] = []
        for step in steps:
            if HAND in task.fixtures or not task.traits.places:
                targets.append(step.goal if HAND in task.fixtures else None)
                continue
            if step.place is None:
                raise LanguageError(f"say where {self._name(step.object)} should go")
            if task.traits.real_goals:
                if step.goal is None or scene.targets[step.goal]:
                    raise LanguageError("this task stacks; name the object to put it on, or choose another task")
                targets.append(step.goal)
                continue
            if step.bottom is not None and step.bottom > ON_TABLE:
                raise LanguageError("this task puts objects on the table; choose task=nl_stack to put one on another")
            if self.names_later and free:
                targets.append(step.goal if step.goal in free else free[0])
                continue
            if not free:
                raise LanguageError("too many places for one sentence: this scene has no further see-through object")
            away = np.linalg.norm(scene.positions[free][:, :2] - np.array(within_reach(step.place, self._env)), axis=1)
            nearest = int(away.argmin())
            targets.append(free.pop(nearest if away[nearest] < SAME_PLACE else len(free) - 1))
        return targets

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
            subtask = replace(
                subtask,
                place=room.free_spot(self._env, referent, subtask.mark, worlds.seen_from(scene, self.viewpoint)),
            )
        own_places = {}
        if subtask.place is not None and target is not None:
            own_places[target] = scene[target].position
            scene = _moved(scene, {target: subtask.place})
        room.check(self._env, Option(verb, referent, target), worlds.seen_from(scene, self.viewpoint))
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
            raise LanguageError(f"say where {self._name(subtask.referent)} should go")
        if subtask.target is not None and scene.targets[subtask.target] == task.traits.real_goals:
            name = self._name(subtask.target)
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
        if self._env.task.points:  # words and gesture tell it together: as in training, "that" and what it looks like
            said = phrase if phrase is not None and phrase.kind in self._config.kinds else None
            thing = scene[index]
            noun, color = (thing.noun, thing.color) if said is None else (said.noun, said.color)
            return ObjectPhrase(noun, color, determiner="that")
        if phrase is not None and phrase.kind in self._config.kinds:
            return phrase
        plain = room.plain_phrase(scene, index)  # as in an answer or a correction, which say no whole instruction
        if plain is not None and plain.kind in self._config.kinds:
            return plain
        if self._config.kinds and self._describer.nameable(scene)[index]:
            return self._describer.phrase(scene, index, self._rng)
        if phrase is not None and phrase.determiner == "the":
            return phrase
        raise LanguageError(f"no words that this policy knows distinguish {self._name(index)} from the others")

    def in_words(self, subtask: Subtask, names: Sequence[str]) -> str:
        """The subtask with these names of the objects."""
        referent, target = names[subtask.referent], None if subtask.target is None else names[subtask.target]
        if target is not None and not subtask.named:
            target = "the marked place"
        if subtask.verb is not None:
            return room.in_words(subtask.verb, referent, target)
        doing = verb_words(self.verb) if subtask.move is None else "place" if subtask.move.release else "take"
        return f"{doing} {referent}" + (f" to {target}" if target and subtask.move is None else "")

    def example(self) -> str:
        """A sentence that is possible in this scene."""
        scene = worlds.seen_from(self._env.scene(), self.viewpoint)
        if self._env.task.traits.stacks:
            return board.example(self._env, self.viewpoint)
        if self._env.task.verbs:
            return next(iter(room.sayable(self._env, scene)), "stop")
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


def _instruction_of(step: Step) -> Instruction | None:
    """The instruction in the project's own language that a step was read from, if it names its objects in words."""
    return step.instruction if isinstance(step.instruction, Instruction) else None


def within_reach(position: Sequence[float], env: InteractiveEnv) -> tuple[float, float]:
    """The nearest place where objects may be, metres: "the corner" is the corner of the area that the arm serves."""
    x0, x1, y0, y1 = env.config.workspace.object_area
    return float(np.clip(position[0], x0, x1)), float(np.clip(position[1], y0, y1))


class _Table:
    """The places of a table, for `moves_of`. hold: the height of the bottom of a held object, metres."""

    def __init__(self, env: InteractiveEnv) -> None:
        self._env, self._half = env, env.config.task.object_size / 2
        self.hold = min(HOLD, env.config.workspace.gripper_box[-1] - env.grip_depth - self._half)

    def place(self, column: float, row: float, level: float) -> NDArray[np.float64]:
        """(3,) the centre of an object at x, y whose bottom is at a height; all in metres."""
        return np.array([*within_reach((column, row), self._env), level + self._half])


def put_object(env: InteractiveEnv, planner: SubtaskPlanner, index: int, place: NDArray[np.float64]) -> None:
    """Puts an object at (2,) metres on the table, or at the nearest place where objects may stand, for good."""
    if env.bodies()[index] is None:
        raise LanguageError(f"{object_name(index, env.scene())} stays where it is; press New scene for another one")
    x, y = within_reach((float(place[0]), float(place[1])), env)
    on_table = x, y, env.config.task.object_size / 2
    planner.own_places.pop(index, None)
    env.put_object(index, board.free_place(env, index, x, y) if env.task.traits.stacks else on_table)


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
