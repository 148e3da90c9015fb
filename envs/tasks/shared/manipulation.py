"""The common part of the tasks in which objects are moved: what they draw, and how they evaluate a control step."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.errors import ConfigError
from envs.tasks.shared.achieved_goal import find_achieved_goal
from envs.tasks.shared.base import Task
from envs.tasks.shared.geometry import length, lifted, with_object_at
from envs.tasks.shared.task_config import TaskConfig
from envs.tasks.shared.types import NOTHING, Array, EpisodeSpec, GripperStart, State, StepOutcome, TaskTraits
from human import Person
from language import KINDS, VERBS, Instruction, Placed, Scene

NEAR = 0.1  # metres at which a gripper is near an object
SCENES = 1000  # scenes drawn at most until one is feasible
DISTURBED = 0.05  # metres by which another object must be moved to count as the wrong object
STILL = 0.002  # metres in a control step below which an object is at rest
# Bounds in metres of the offset of a gripper that begins near its object, from where it would hold the object.
NEAR_OFFSETS = np.array([[-0.04, -0.04, 0.06], [0.04, 0.04, 0.12]])
STAGES = 3  # of `carrying_stage`


class Manipulation(Task):
    """The referent is a real object. If the task has goals, one of them is where the referent goes.

    A goal is a see-through target or, with `real_goals`, another real object. Without kinds of sentences there are no
    words: one object, and one target at most.

    Success is to reach the goal, for `hold_steps` control steps. An episode ends as `wrong_object` once another object
    has moved by `disturbed` metres, as `wrong_target` once the referent was left at another goal, and, if the task
    `fails`, as `failed` once success has become impossible in another way.

    All reward terms except those for the ends of episodes and for time are differences of potentials (potential-based
    shaping, Ng et al. 1999), from which subclasses may take costs, so no cycle of states earns anything.

    Attributes:
        potentials: the names of the values of `_potentials`.
        ends: the reward terms for the ends of episodes, and time.
        disturbed: metres by which another object must be moved to count as the wrong object.
    """

    traits = TaskTraits(speaks=True, moves=True)
    kind_names: tuple[str, ...] = KINDS
    stages = STAGES
    potentials: tuple[str, ...]
    ends: tuple[str, ...] = ("success", "wrong_object", "wrong_target", "time")
    disturbed = DISTURBED

    def __init_subclass__(cls) -> None:
        cls.ends = (*cls.ends[:3], "failed", "time") if cls.traits.fails else cls.ends
        cls.terms = (*cls.potentials, *cls.ends)

    def _configure(self, config: TaskConfig, person: Person | None) -> None:
        self.traits = traits_by_counts(self.traits, config)
        if not self.traits.speaks:
            self.kind_names = ("none",)
        super()._configure(config, person)
        check_counts(config, self.traits, self.verb)

    # ---- evaluating

    def _allocate(self, worlds: int) -> None:
        slots = self.config.slots
        self._begun = np.zeros((worlds, slots, 3))  # where objects were as the episode began
        self._places = np.zeros((worlds, slots, 3))  # where objects were a step ago
        self._moved = np.zeros((worlds, slots, 3))  # how they moved since
        self._motion = np.zeros((worlds, 3))  # the referent
        self._still = np.zeros(worlds, np.int64)  # control steps that the referent has been at rest
        self._reached = np.zeros(worlds, np.int64)  # control steps that the goal has been reached
        self._values, self._last_values = ({name: np.zeros(worlds) for name in self.potentials} for _ in range(2))

    @abstractmethod
    def _potentials(self, state: State) -> dict[str, Array]:
        """(N,) each: the potentials by name. Higher is nearer to success."""

    @abstractmethod
    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether the goal is reached; for `hold_steps` consecutive steps, that is success."""

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        """Reset the memory of a subclass for these worlds."""

    def _update_memory(self, state: State) -> None:
        """Update the memory of a subclass for all worlds, once per control step, before anything is evaluated."""

    def reset(self, worlds: NDArray[np.int64], state: State) -> None:
        self._begun[worlds] = state.objects[worlds]
        self._places[worlds] = state.objects[worlds]
        self._moved[worlds] = self._motion[worlds] = 0.0
        self._still[worlds] = self._reached[worlds] = 0
        self._reset_memory(worlds, state)
        for name, values in self._potentials(state).items():
            self._values[name][worlds] = values[worlds]

    def step(self, state: State) -> StepOutcome:
        """Evaluate one control step of all worlds: the memory is updated first, and the rest has no side effects."""
        self._remember(state)
        return self._outcome(state)

    def _remember(self, state: State) -> None:
        """Update the memory of all episodes. Nothing else writes to it between resets."""
        self._moved = state.objects - self._places
        self._motion = self._moved[self._rows, state.referent]
        self._places[:] = state.objects
        self._still = np.where(length(self._motion) < STILL, self._still + 1, 0)
        self._update_memory(state)
        self._reached = np.where(self._at_goal(state), self._reached + 1, 0)
        self._last_values, self._values = self._values, self._potentials(state)

    def _outcome(self, state: State) -> StepOutcome:
        """Return the reward terms and ends that follow from the state and the memory."""
        success = self._reached >= self.config.success_steps
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
        return StepOutcome(
            terms=terms | {name: ends[name].astype(np.float64) for name in self.ends},
            success=success,
            wrong_object=wrong_object,
            at_goal=self._reached > 0,
            wrong_target=wrong_target,
            failed=failed,
        )

    def _failed(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether success has become impossible in another way."""
        return np.zeros(len(self._rows), bool)

    def _referent(self, state: State) -> Array:
        """(N, 3) positions of the referents, metres."""
        return state.objects[self._rows, state.referent]

    def _goal(self, state: State) -> Array:
        """(N, 3) where the referents go, metres."""
        return self._goals(state)[self._rows, state.target]

    def _goals(self, state: State) -> Array:
        """(N, K, 3) where a referent goes whose goal is each slot's object, metres."""
        return state.objects

    def _disturbed(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether an object has been moved that is to stay where it is."""
        return np.any(self._stays(state) & (length(state.objects - self._begun) > self.disturbed), axis=1)

    def _stays(self, state: State) -> NDArray[np.bool_]:
        """(N, K) which objects are to stay where they are: all but the referent."""
        others = state.movable.copy()
        others[self._rows, state.referent] = False
        if self.traits.real_goals:  # the task itself bounds how far its goals may be moved
            others[self._rows, state.target] = False
        return others

    def _misplaced(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether the referent has been brought to another goal, and left there."""
        if not self.traits.places:
            return np.zeros(len(self._rows), bool)
        others = state.goals.copy()
        others[self._rows, state.target] = others[self._rows, state.referent] = False
        if self.traits.real_goals and self.config.devices:
            others &= state.movable  # what stands at a see-through target is not misplaced
        place = self._referent(state)
        there = others & (length(self._goals(state) - place[:, None]) <= self.config.success_radius)
        moved = length(place - self._begun[self._rows, state.referent]) > self.disturbed
        return there.any(1) & moved & self._is_left(state)

    def _is_left(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether the referent is not held, and has been at rest for as long as success requires."""
        return (state.held != state.referent) & (self._still >= self.config.success_steps)

    def stage(self, state: State) -> NDArray[np.int64]:
        return carrying_stage(state, self.traits.grips, self.config.radius)

    def relabel(self, placed: Placed, moments: State, rng: Generator) -> EpisodeSpec | None:
        """Name an object that was moved, and a target where it came to rest, moved there if none stood there.

        None with fittings: no sentence names the place to which one was moved.
        """
        if self.fittings is not None:
            return None
        radius = self.config.success_radius
        achieved = find_achieved_goal(moments, moved=self.disturbed, still=STILL, radius=radius, rng=rng)
        if achieved is None:
            return None
        scene = placed.scene.moved(achieved.places)
        return self.episode(placed._replace(scene=scene), achieved.referent, achieved.target, rng)

    # ---- drawing

    def _draw(self, rng: Generator) -> EpisodeSpec:
        placed, nameable = self._draw_scene(rng)
        target = self._one_of(self.possible_goals(placed) & nameable, rng) if self.traits.places else None
        movable = self._movable(placed) & nameable
        if target is not None:
            movable[target] = False
        referent = self._one_of(movable, rng)
        start, scene = self._draw_start(placed, referent, target, rng)
        return replace(self.episode(placed._replace(scene=scene), referent, target, rng), start=start)

    def _each_in_turn(self, rng: Generator) -> list[EpisodeSpec]:
        placed, nameable = self._draw_scene(rng)
        movable = np.flatnonzero(self._movable(placed) & nameable).tolist()
        goals = self.possible_goals(placed) & nameable
        targets = np.flatnonzero(goals).tolist() if self.traits.places else [None]
        pairs = [(referent, target) for referent in movable for target in targets if referent != target]
        return [self._pointed(self.episode(placed, referent, target, rng), rng) for referent, target in pairs]

    def episode(self, placed: Placed, referent: int, target: int | None, rng: Generator) -> EpisodeSpec:
        """Return the episode in which these objects of the scene are named.

        Raises LanguageError where one cannot be.
        """
        sentence, kind = "", 0
        if self.traits.speaks:
            sentence, instruction = self._sentence(placed.scene, referent, target, rng)
            kind = self.kind_names.index(instruction.kind)
        goals, shares = self.possible_goals(placed), None
        if self.fittings is not None:
            shares = np.clip(self.fittings.shares(placed.scene.nouns, placed.scene.positions), 0.0, 1.0)
        episode = self._episode(placed, referent=referent, kind=kind, sentence=sentence)
        return replace(episode, target=target, goals=goals, shares=shares)

    def _sentence(self, scene: Scene, referent: int, target: int | None, rng: Generator) -> tuple[str, Instruction]:
        """Return a sentence for these objects, and its instruction."""
        return self._sentences.instruct(self.verb, scene, referent=referent, target=target, rng=rng)

    def _placed(self, rng: Generator) -> Placed:
        for _ in range(SCENES):
            placed = super()._placed(rng)
            if self._is_feasible(placed):
                return placed
        raise ConfigError(
            f"task.name={self.config.name} does not fit its {self.config.slots} objects into "
            f"workspace.object_area={list(self._area)}: take fewer, or list some that leave the way free"
        )

    def _is_feasible(self, placed: Placed) -> bool:
        """Return whether every referent and target of this scene can be asked for."""
        return True

    def _draw_scene(self, rng: Generator) -> tuple[Placed, NDArray[np.bool_]]:
        """Draw a scene, and (K,) which of its objects can be referent or target as far as words go."""
        if self.traits.speaks:
            return self._sentences.nameable_scene(lambda: self._placed(rng))
        placed = self._placed(rng)
        return placed, np.ones(len(placed.scene), bool)

    def _movable(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) which objects could be the referent."""
        return ~placed.scene.targets & ~placed.fixed

    def possible_goals(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) which objects could be the goal."""
        return placed.scene.targets != self.traits.real_goals

    def _one_of(self, choices: NDArray[np.bool_], rng: Generator) -> int:
        """Draw the number of one of the objects that `choices` (K,) marks."""
        if not choices.any():
            raise ConfigError(f"task.name={self.config.name} needs an object that can be moved, and named")
        return int(rng.choice(np.flatnonzero(choices)))

    # ---- where the curriculum lets episodes begin

    def _draw_start(
        self, placed: Placed, referent: int, target: int | None, rng: Generator
    ) -> tuple[GripperStart | None, Scene]:
        """Draw where the gripper begins by the curriculum, and move the referent of the scene accordingly."""
        curriculum, chance = self.config.curriculum, rng.random()
        if chance < curriculum.near:
            return GripperStart(self._near_offset(placed.scene, referent, target, rng), held=False), placed.scene
        held = chance < curriculum.near + curriculum.held
        scene = None
        if self.traits.grips and held:
            scene = self._held_scene(placed.scene, referent, target, rng)
        elif self.traits.grips and target is not None and chance < curriculum.share:
            scene = with_object_at(placed.scene, referent, self._goal_place(placed.scene, target))
        meant = [referent] if target is None else [referent, target]
        if scene is None or (self.traits.speaks and not self._sentences.nameable(scene)[meant].all()):
            return None, placed.scene
        return GripperStart(self._held_offset(rng) if held else np.zeros(3), held), scene

    def _goal_place(self, scene: Scene, target: int) -> Array:
        """(3,) where the referent lies once it has been brought to the target, metres."""
        return scene.positions[target]

    def _near_offset(self, scene: Scene, referent: int, target: int | None, rng: Generator) -> Array:
        """(3,) offset of a gripper that begins near its object, from where it would hold the object, metres."""
        return rng.random() * rng.uniform(*NEAR_OFFSETS)

    def _held_offset(self, rng: Generator) -> Array:
        """(3,) offset of a gripper that begins with an object held, metres."""
        most = self.config.curriculum.off_centre
        return np.array([*rng.uniform(-most, most, 2), 0.0]) if most else np.zeros(3)

    def _held_scene(self, scene: Scene, referent: int, target: int | None, rng: Generator) -> Scene | None:
        """Return the scene with the referent where the gripper holds it; None if no free place was found."""
        config = self.config
        size, spacing = config.object_size, config.spacing
        return lifted(scene, referent, target, area=self._area, size=size, spacing=spacing, rng=rng)


# ---- shared with the task that draws its verb


def carrying_stage(state: State, grips: bool, radius: float) -> NDArray[np.int64]:
    """(N,) in [0, STAGES): moving to an object, holding one, and holding one beside a possible goal.

    If the task does not grip, being near an object counts as holding it. Independent of the referent and target.

    Args:
        state: of the worlds.
        grips: whether the task grips.
        radius: metres from a goal within which an object succeeds; twice that is beside it.
    """
    offset = state.objects - state.gripper[:, None]
    near = length(offset) < NEAR
    has = state.held != NOTHING if grips else (near & state.movable).any(1)
    goals = state.goals & (np.arange(state.goals.shape[1]) != state.held[:, None])
    beside = (goals & (length(offset[..., :2]) < 2 * radius)).any(1)
    return np.where(has, np.where(beside, 2, 1), 0)


def traits_by_counts(traits: TaskTraits, config: TaskConfig) -> TaskTraits:
    """Return the traits, with those that follow from the config: whether it has words, and goals."""
    targets = len(config.objects.goal) or config.num_targets
    return replace(traits, speaks=bool(config.kinds), places=targets > 0 or traits.real_goals)


def check_counts(config: TaskConfig, traits: TaskTraits, verb: str) -> None:
    """Raise ConfigError unless the numbers of objects and targets fit the verb, and the words that name them."""
    real = len(config.objects.init) or config.num_objects
    targets = len(config.objects.goal) or config.num_targets
    words = VERBS[verb]
    marked = words.needs_goal and not traits.real_goals  # by a see-through target
    if (marked and not targets) or (targets and (traits.real_goals or not words.takes_goal)):
        wanted = "at least 1" if marked else "0"
        raise ConfigError(f"task.num_targets={targets} must be {wanted} in task.name={config.name}")
    if traits.real_goals and real < 2:
        raise ConfigError(f"task.num_objects={real} must be at least 2 in task.name={config.name}")
    if not traits.speaks and not traits.marks and (real > 1 or targets > 1):
        raise ConfigError(
            f"task.num_objects={real} and task.num_targets={targets} must be 1 at most in a task without words, "
            "or nothing would tell which is meant; give task.kinds"
        )
