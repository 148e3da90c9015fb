"""Stack: pick an object up, put it on top of another one, and release it there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.errors import ConfigError
from envs.tasks.pick_and_place import PickAndPlace
from envs.tasks.shared.achieved_goal import first_moved
from envs.tasks.shared.base import register_task
from envs.tasks.shared.free_places import COLUMNS, ToTable
from envs.tasks.shared.geometry import length, places_in_air, with_object_at
from envs.tasks.shared.manipulation import DISTURBED
from envs.tasks.shared.types import NOTHING, Array, EpisodeSpec, State, TaskConfig
from human import Person
from language import Placed, Scene

BASE_MOVED = 0.05  # metres over the table that the base may be moved
BASE_LEANS = 0.9  # cosine of the angle to the vertical that the base may lean by: 26 degrees
CLEARANCE = 0.01  # metres between a held object and the tops of others at the start of an episode


@register_task("nl_stack", verb="stack")
class Stack(PickAndPlace):
    """ "stack the red cube on the blue cube": the goal is a real object, the base.

    Success: the referent has been picked up and lies on the base, its centre within `radius` of the place above the
    base's centre, released and at rest, for `hold_steps` steps. On top of another object, it is at the wrong target.
    The episode fails where the base is moved by more than `BASE_MOVED`, or leans by more than `BASE_LEANS` allows.
    Potentials: those of pick and place, with the place on top of the base as the target.
    """

    fails = True
    real_goals = True

    def _goals(self, state: State) -> Array:
        return state.objects + [0.0, 0.0, self.config.object_size]

    def _failed(self, state: State) -> NDArray[np.bool_]:
        base = state.objects[self._rows, state.target]
        moved = length((base - self._begun[self._rows, state.target])[:, :2]) > BASE_MOVED
        x, y = state.quaternions[self._rows, state.target, :2].T
        return moved | (1 - 2 * (x * x + y * y) < BASE_LEANS)

    def relabel(self, placed: Placed, moments: State, rng: Generator) -> EpisodeSpec | None:
        """The object that was put on top of another one is named, and that one as its base.

        Where nothing was stacked, an object that was moved is named in place of the referent, with any base.
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
        """On a line from anywhere above the table to the top of the base, beside or above all objects."""
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
    """The last object that was put on another one in an episode and released, and its base.

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


STACKS = 2  # in an episode


@register_task("nl_unstack", verb="unstack")
class Unstack(ToTable):
    """ "unstack the red cube": several stacks of two, whose upper objects can be asked for.

    Success: the referent has been picked up and stands on the table, beside all other objects, released and at rest,
    for `hold_steps` steps. A base that is moved is the wrong object.
    """

    columns = COLUMNS

    def __init__(
        self, config: TaskConfig, object_area: Sequence[float], num_worlds: int, person: Person | None = None
    ) -> None:
        if len(config.objects) or config.min_objects < 2 * STACKS:
            raise ConfigError(
                f"task.min_objects={config.min_objects} must be at least {2 * STACKS} in task.name={config.name}, and "
                f"task.objects empty: {STACKS} stacks of two are drawn"
            )
        super().__init__(config, object_area, num_worlds, person)

    def relabel(self, placed: Placed, moments: State, rng: Generator) -> EpisodeSpec | None:
        """None: an object that was moved by mistake did not stand on another one."""
        return None

    # ---- drawing

    def _scene(self, rng: Generator) -> Scene:
        """The first objects stand on the next ones."""
        scene = super()._scene(rng)
        places = scene.positions.copy()
        places[:STACKS] = places[STACKS : 2 * STACKS] + [0.0, 0.0, self.config.object_size]
        return scene.moved(places)

    def _movable(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) which objects stand on another one."""
        return super()._movable(placed) & (placed.scene.positions[:, 2] > self.config.object_size)

    def episode(self, placed: Placed, referent: int, target: int | None, rng: Generator) -> EpisodeSpec:
        """As in other tasks. Objects on others are at rest."""
        episode = super().episode(placed, referent, target, rng)
        return replace(episode, resting=np.ones(len(placed.scene), bool))
