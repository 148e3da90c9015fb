"""What tasks that move objects have in common: what is to go where, and what counts as having spoilt it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from conf.schema import ConfigError
from envs.tasks.achieved_goal import meant_by
from envs.tasks.geometry import length, lifted, put
from envs.tasks.referring import ReferringTask
from envs.tasks.types import NOTHING, Array, EpisodeSpec, GripperStart, Outcome, State, TaskConfig
from human import Person
from language import VERBS, Instruction, Placed, Scene

DISTURBED = 0.05  # metres that another object is moved before it counts as the wrong one
NEAR = 0.1  # metres at which a gripper is near an object
STILL = 0.002  # metres in a control step below which an object is at rest
SCENES = 1000  # to draw one that fits
OVER = np.array([[-0.04, -0.04, 0.06], [0.04, 0.04, 0.12]])  # from where to its object a gripper begins that is near it


class Manipulation(ReferringTask):
    """The referent is one of the real objects, and where there are targets, one of them tells where it goes.

    Without kinds of sentences there are no words: one object, and one target at most. Another object moved by
    `DISTURBED` ends the episode as the wrong object; the referent left at another target, as the wrong target. Where
    `fails`, something else can spoil it for good, and that ends the episode as well.

    Reward terms are differences of potentials, but for the ends of episodes and the time: what is gained on the way
    to something is lost on the way back, so that going to and fro pays nothing.
    """

    potentials: tuple[str, ...]  # the names of what `_potentials` returns
    fails = False
    ends: tuple[str, ...] = ("success", "wrong_object", "wrong_target", "time")
    moves = True
    stages = 3

    def __init_subclass__(cls) -> None:
        cls.ends = (*cls.ends[:3], "failed", "time") if cls.fails else cls.ends
        cls.terms = (*cls.potentials, *cls.ends)

    def __init__(
        self, config: TaskConfig, object_area: Sequence[float], num_worlds: int, person: Person | None = None
    ) -> None:
        self.speaks = bool(config.kinds)
        self.kind_names: tuple[str, ...] = ReferringTask.kind_names if self.speaks else ("none",)
        super().__init__(config, object_area, num_worlds, person)
        real = len(config.objects.init) or config.num_objects
        targets = len(config.objects.goal) or config.num_targets
        self.places = targets > 0 or self.real_goals
        verb = VERBS[self.verb]
        marked = verb.needs_goal and not self.real_goals  # by a see-through target
        if (marked and not targets) or (targets and (self.real_goals or not verb.takes_goal)):
            wanted = "at least 1" if marked else "0"
            raise ConfigError(f"task.num_targets={targets} must be {wanted} in task.name={config.name}")
        if self.real_goals and real < 2:
            raise ConfigError(f"task.num_objects={real} must be at least 2 in task.name={config.name}")
        if not self.speaks and (real > 1 or targets > 1):
            raise ConfigError(
                f"task.num_objects={real} and task.num_targets={targets} must be 1 at most in a task without words, "
                "or nothing would tell which is meant; give task.kinds"
            )

    def _allocate(self, worlds: int) -> None:
        slots = self.config.slots
        self._begun = np.zeros((worlds, slots, 3))  # where objects were as the episode began
        self._places = np.zeros((worlds, slots, 3))  # where objects were a step ago
        self._moved = np.zeros((worlds, slots, 3))  # how they moved since
        self._motion = np.zeros((worlds, 3))  # the referent
        self._still = np.zeros(worlds, np.int64)  # control steps that the referent has been at rest
        self._reached = np.zeros(worlds, np.int64)  # control steps that the goal has been reached
        self._values, self._last_values = ({name: np.zeros(worlds) for name in self.potentials} for _ in range(2))

    # ---- judging

    @abstractmethod
    def _potentials(self, state: State) -> dict[str, Array]:
        """How far each stage is done, (N,) each: higher is nearer to the goal."""

    @abstractmethod
    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether all is as it should be; for `hold_steps` steps running, that is success."""

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        """Resets what a subclass remembers of these worlds' episodes."""

    def _update_memory(self, state: State) -> None:
        """Updates what a subclass remembers of all episodes, once a control step, before anything is evaluated."""

    def reset(self, worlds: NDArray[np.int64], state: State) -> None:
        """Start these worlds' episodes anew, or go on with another referent."""
        self._begun[worlds] = state.objects[worlds]
        self._places[worlds] = state.objects[worlds]
        self._moved[worlds] = self._motion[worlds] = 0.0
        self._still[worlds] = self._reached[worlds] = 0
        self._reset_memory(worlds, state)
        for name, values in self._potentials(state).items():
            self._values[name][worlds] = values[worlds]

    def step(self, state: State) -> Outcome:
        """Evaluates one control step of all worlds: the memory is updated first, what follows has no side effects."""
        self._remember(state)
        return self._outcome(state)

    def _remember(self, state: State) -> None:
        """Updates the memory of all episodes. Nothing else writes to it between resets."""
        self._moved = state.objects - self._places
        self._motion = self._moved[self._rows, state.referent]
        self._places[:] = state.objects
        self._still = np.where(length(self._motion) < STILL, self._still + 1, 0)
        self._update_memory(state)
        self._reached = np.where(self._at_goal(state), self._reached + 1, 0)
        self._last_values, self._values = self._values, self._potentials(state)

    def _outcome(self, state: State) -> Outcome:
        """The reward terms and ends that follow from the state and the memory."""
        success = self._reached >= self.config.hold_steps
        wrong_object = self._disturbed(state) & ~success
        wrong_target = self._misplaced(state) & ~success & ~wrong_object
        failed = self._failed(state) & ~success & ~wrong_object & ~wrong_target
        terms = {name: self._values[name] - self._last_values[name] for name in self.potentials}
        ends = {
            "success": success,
            "wrong_object": wrong_object,
            "wrong_target": wrong_target,
            "failed": failed,
            "time": np.ones(len(self._rows)),
        }
        terms |= {name: ends[name].astype(np.float64) for name in self.ends}
        return Outcome(terms, success, wrong_object, self._reached > 0, wrong_target, failed)

    def _failed(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether success has become impossible in another way."""
        return np.zeros(len(self._rows), bool)

    def _referent(self, state: State) -> Array:
        """(N, 3) where the object is that is to be moved."""
        return state.objects[self._rows, state.referent]

    def _goal(self, state: State) -> Array:
        """(N, 3) the place where it is to go."""
        return self._goals(state)[self._rows, state.target]

    def _goals(self, state: State) -> Array:
        """(N, K, 3) the place where an object goes that is brought to each slot's object."""
        return state.objects

    def _disturbed(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether an object that was not meant has been moved."""
        others = state.movable.copy()
        others[self._rows, state.referent] = False
        if self.real_goals:  # a task says itself how far its goals may be moved
            others[self._rows, state.target] = False
        return np.any(others & (length(state.objects - self._begun) > DISTURBED), axis=1)

    def _misplaced(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether the referent has been brought to another target, and left there."""
        if not self.places:
            return np.zeros(len(self._rows), bool)
        others = state.goals.copy()
        others[self._rows, state.target] = False
        place = self._referent(state)
        there = others & (length(self._goals(state) - place[:, None]) <= self.config.radius)
        moved = length(place - self._begun[self._rows, state.referent]) > DISTURBED
        left = (state.held != state.referent) & (self._still >= self.config.hold_steps)
        return there.any(1) & moved & left

    def stage(self, state: State) -> NDArray[np.int64]:
        """(N,) in [0, 3): on the way to something, holding something, and holding it beside a place that is marked.

        Where nothing is gripped, near an object instead of holding it. None of it depends on what is meant.
        """
        offset = state.objects - state.gripper[:, None]
        near = length(offset) < NEAR
        has = state.held != NOTHING if self.grips else (near & state.movable).any(1)
        goals = state.goals & (np.arange(state.goals.shape[1]) != state.held[:, None])
        beside = (goals & (length(offset[..., :2]) < 2 * self.config.radius)).any(1)
        return np.where(has, np.where(beside, 2, 1), 0)

    # ---- drawing

    def _draw(self, rng: Generator) -> EpisodeSpec:
        placed, nameable = self._drawn(rng)
        target = self._one_of(self._possible_goals(placed) & nameable, rng) if self.places else None
        movable = self._movable(placed) & nameable
        if target is not None:
            movable[target] = False
        referent = self._one_of(movable, rng)
        start, scene = self._started(placed, referent, target, rng)
        return replace(self.episode(placed._replace(scene=scene), referent, target, rng), start=start)

    def _each_in_turn(self, rng: Generator) -> list[EpisodeSpec]:
        placed, nameable = self._drawn(rng)
        movable = np.flatnonzero(self._movable(placed) & nameable).tolist()
        targets = np.flatnonzero(self._possible_goals(placed) & nameable).tolist() if self.places else [None]
        pairs = [(referent, target) for referent in movable for target in targets if referent != target]
        return [self._pointed(self.episode(placed, referent, target, rng), rng) for referent, target in pairs]

    def episode(self, placed: Placed, referent: int, target: int | None, rng: Generator) -> EpisodeSpec:
        """The episode in which these objects of the scene are named. Raises LanguageError where one cannot be."""
        sentence, kind = "", 0
        if self.speaks:
            phrase = self._describer.phrase(placed.scene, referent, rng)
            goal = None if target is None else self._describer.phrase(placed.scene, target, rng)
            instruction = Instruction(self.verb, phrase, goal)
            sentence, kind = self._say(instruction, rng), self.kind_names.index(instruction.kind)
        goals = self._possible_goals(placed)
        return replace(self._episode(placed, referent, kind, sentence), target=target, goals=goals)

    def _placed(self, rng: Generator) -> Placed:
        for _ in range(SCENES):
            placed = super()._placed(rng)
            if self._fits(placed):
                return placed
        raise ConfigError(
            f"task.name={self.config.name} does not fit its {self.config.slots} objects into "
            f"workspace.object_area={list(self._area)}: take fewer, or list some that leave the way free"
        )

    def _fits(self, placed: Placed) -> bool:
        """Whether whatever could be asked in this scene can be done."""
        return True

    def retold(self, placed: Placed, moments: State, rng: Generator) -> EpisodeSpec | None:
        """An object that was moved is named, and a target that stands, or could have stood, where it came to be."""
        told = meant_by(moments, DISTURBED, STILL, self.config.radius, rng)
        if told is None:
            return None
        return self.episode(placed._replace(scene=placed.scene.moved(told.places)), told.referent, told.target, rng)

    def _drawn(self, rng: Generator) -> tuple[Placed, NDArray[np.bool_]]:
        if self.speaks:
            return self._nameable_scene(rng)
        placed = self._placed(rng)
        return placed, np.ones(len(placed.scene), bool)

    def _movable(self, placed: Placed) -> NDArray[np.bool_]:
        return ~placed.scene.targets & ~placed.fixed

    def _possible_goals(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) what the referent can be brought to."""
        return placed.scene.targets != self.real_goals

    def _one_of(self, choices: NDArray[np.bool_], rng: Generator) -> int:
        if not choices.any():
            raise ConfigError(f"task.name={self.config.name} needs an object that can be moved, and named")
        return int(rng.choice(np.flatnonzero(choices)))

    def _started(
        self, placed: Placed, referent: int, target: int | None, rng: Generator
    ) -> tuple[GripperStart | None, Scene]:
        """Where the gripper begins, by the curriculum, and the scene as it then is."""
        curriculum, chance = self.config.curriculum, rng.random()
        if chance < curriculum.near:
            return GripperStart(self._near(placed.scene, referent, target, rng), held=False), placed.scene
        held = chance < curriculum.near + curriculum.held
        scene = None
        if self.grips and held:
            scene = self._lifted(placed.scene, referent, target, rng)
        elif self.grips and target is not None and chance < curriculum.share:
            scene = put(placed.scene, referent, self._placed_place(placed.scene, target))
        meant = [referent] if target is None else [referent, target]
        if scene is None or (self.speaks and not self._describer.nameable(scene)[meant].all()):
            return None, placed.scene
        return GripperStart(np.zeros(3), held), scene

    def _placed_place(self, scene: Scene, target: int) -> Array:
        """(3,) where the referent lies once it has been brought to the target, metres."""
        return scene.positions[target]

    def _near(self, scene: Scene, referent: int, target: int | None, rng: Generator) -> Array:
        """(3,) from where a gripper would hold its object to where it begins near it, metres."""
        return rng.random() * rng.uniform(*OVER)

    def _lifted(self, scene: Scene, referent: int, target: int | None, rng: Generator) -> Scene | None:
        """The scene with the referent where the gripper is to hold it; None where no place was found."""
        config = self.config
        return lifted(scene, referent, target, self._area, config.object_size, config.spacing, rng)
