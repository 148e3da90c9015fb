"""Stack and unstack: put an object on top of another one, and take one down."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.errors import ConfigError
from envs.tasks.pick_and_place import PickAndPlace
from envs.tasks.shared.achieved_goal import first_moved
from envs.tasks.shared.base import register_task
from envs.tasks.shared.free_places import FREE_COLUMNS, FreeTable
from envs.tasks.shared.geometry import length, places_in_air, with_object_at
from envs.tasks.shared.manipulation import DISTURBED
from envs.tasks.shared.task_config import TaskConfig
from envs.tasks.shared.types import NOTHING, Array, EpisodeSpec, State
from human import Person
from language import Placed, Scene

BASE_MOVED = 0.05  # metres over the table that the base may be moved
BASE_LEANS = 0.9  # cosine of the angle to the vertical that the base may lean by: 26 degrees
CLEARANCE = 0.01  # metres between a held object and the tops of others at the start of an episode
STACKS = 2  # in an episode of Unstack


@register_task("nl_stack", verb="stack")
class Stack(PickAndPlace):
    """Put an object on top of another one, the base.

    Instruction: "stack the red cube on the blue cube".
    Success: the referent has been picked up and lies on the base, its centre within `radius` of the place above the
        base's centre, released and at rest, for `hold_steps` steps.
    Failure: wrong_object, once another object has been moved; wrong_target, once it was left on top of another object;
        failed, where the base is moved by more than `BASE_MOVED`, or leans by more than `BASE_LEANS` allows.
    Reward terms: approach, grasp, lift, transport and release as of `PickAndPlace`, with the place on top of the base
        as the target; success, wrong_object, wrong_target, failed and time.
    Config keys: num_objects (at least 2), kinds, radius, hold_steps.
    """

    traits = replace(PickAndPlace.traits, real_goals=True, fails=True)

    def _goals(self, state: State) -> Array:
        return state.objects + [0.0, 0.0, self.config.object_size]

    def _failed(self, state: State) -> NDArray[np.bool_]:
        base = state.objects[self._rows, state.target]
        moved = length((base - self._begun[self._rows, state.target])[:, :2]) > BASE_MOVED
        x, y = state.quaternions[self._rows, state.target, :2].T
        return moved | (1 - 2 * (x * x + y * y) < BASE_LEANS)

    def relabel(self, placed: Placed, moments: State, rng: Generator) -> EpisodeSpec | None:
        """Name the object that was put on top of another one, and that one as its base.

        Where nothing was stacked, name an object that was moved in place of the referent, with any base.
        """
        pair = stacked_pair(moments, self._goals(moments), self.config.success_radius)
        if pair is None:
            moved = first_moved(moments, DISTURBED)
            if moved is None or moved == moments.referent[0]:
                return None
            bases = np.flatnonzero(moments.goals[0] & (np.arange(len(placed.scene)) != moved))
            pair = moved, int(rng.choice(bases))
        if pair == (moments.referent[0], moments.target[0]):
            return None
        return self.episode(placed, *pair, rng)

    def _held_scene(self, scene: Scene, referent: int, target: int | None, rng: Generator) -> Scene | None:
        """Return the scene with the referent on a line from above the table to the top of the base, clear of others."""
        assert target is not None
        size = self.config.object_size
        goal = scene.positions[target] + [0.0, 0.0, size]
        others = scene.positions[np.arange(len(scene)) != referent]
        for place in places_in_air(self._area, size, goal, rng):
            beside = length((others - place)[:, :2]) >= self.config.spacing
            if (beside | (place[2] >= others[:, 2] + size + CLEARANCE)).all():
                return with_object_at(scene, referent, place)
        return None

    def _goal_place(self, scene: Scene, target: int) -> Array:
        """(3,) the place on top of the base."""
        return scene.positions[target] + [0.0, 0.0, self.config.object_size]


def stacked_pair(moments: State, tops: Array, radius: float) -> tuple[int, int] | None:
    """Return the last object that was put on another one in an episode and released, and its base.

    Args:
        moments: the T + 1 states of one episode.
        tops: (T + 1, K, 3) the places on top of each object, metres.
        radius: metres from such a place within which an object is on it.

    Returns:
        (object, base); None if no object was put on another one.
    """
    there = length(moments.objects[:, :, None] - tops[:, None]) <= radius  # (T + 1, object, base)
    there &= moments.movable[:, :, None] & moments.goals[:, None] & (moments.held == NOTHING)[:, None, None]
    there &= ~there[0]
    when, things, bases = np.nonzero(there)
    if not len(when):
        return None
    return int(things[-1]), int(bases[-1])


@register_task("nl_unstack", verb="unstack")
class Unstack(PickAndPlace):
    """Take an object down from another one. There are several stacks of two, whose upper objects can be asked for.

    Instruction: "unstack the red cube".
    Success: the referent has been picked up and stands on the table, beside all other objects, released and at rest,
        for `hold_steps` steps.
    Failure: wrong_object, once another object, such as the base, has been moved.
    Reward terms: approach, grasp, lift, transport and release as of `PickAndPlace`, with a place of the table that was
        free as the episode began, and is observed, as the target; success, wrong_object, wrong_target (always 0) and
        time.
    Config keys: num_objects (at least 4), kinds, hold_steps.
    """

    columns = FREE_COLUMNS

    def _configure(self, config: TaskConfig, person: Person | None) -> None:
        if len(config.objects) or config.min_objects < 2 * STACKS:
            raise ConfigError(
                f"task.min_objects={config.min_objects} must be at least {2 * STACKS} in task.name={config.name}, and "
                f"task.objects empty: {STACKS} stacks of two are drawn"
            )
        super()._configure(config, person)

    # ---- evaluating

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._table = FreeTable(self._area, self.config.object_size, worlds, self.config.slots)

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        self._table.note(worlds, state)
        super()._reset_memory(worlds, state)
        self._raised[worlds] = (state.held == state.referent)[worlds]  # also an object on the table is to be lifted

    def seen(self, state: State) -> Array:
        return self._table.offsets(state)[..., :2]

    def described(self, episode: EpisodeSpec) -> Array:
        return self._table.described(episode)[:, :2]

    def free_places(self) -> Array:
        """(N, K, 3) where the table was free for each object as the episode began, metres."""
        return self._table.places

    def _goal(self, state: State) -> Array:
        return self._table.places[self._rows, state.referent]

    def _is_near_goal(self, state: State) -> NDArray[np.bool_]:
        return self._table.stands(state)

    def relabel(self, placed: Placed, moments: State, rng: Generator) -> EpisodeSpec | None:
        """Return None: an object that was moved by mistake did not stand on another one."""
        return None

    # ---- drawing

    def _scene(self, rng: Generator) -> Scene:
        """Draw a scene whose first objects stand on the next ones."""
        scene = super()._scene(rng)
        places = scene.positions.copy()
        places[:STACKS] = places[STACKS : 2 * STACKS] + [0.0, 0.0, self.config.object_size]
        return scene.moved(places)

    def _movable(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) which objects stand on another one."""
        return super()._movable(placed) & (placed.scene.positions[:, 2] > self.config.object_size)

    def episode(self, placed: Placed, referent: int, target: int | None, rng: Generator) -> EpisodeSpec:
        """Return the episode as in other tasks. Objects on others are at rest."""
        episode = super().episode(placed, referent, target, rng)
        return replace(episode, resting=np.ones(len(placed.scene), bool))
