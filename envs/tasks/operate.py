"""What tasks with devices have in common: one of several is pressed, switched or turned, and no other."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from conf.schema import ConfigError
from envs.sim.devices import DEVICES, facing
from envs.tasks.geometry import length
from envs.tasks.manipulation import Manipulation
from envs.tasks.types import Array, Column, EpisodeSpec, State, TaskConfig
from human import Person
from language import Placed

OPERATED = 0.8  # share of its way at which a device is operated
MEDDLED = 0.3  # share of its way at which another device counts as the wrong object
ROOM = 0.05  # metres from the border of where objects are put to the handles: a gripper must get round them


class Operate(Manipulation):
    """All objects are devices of one noun. Their places are those of their handles, turned as these are.

    Success: the referent has gone `OPERATED` of its way, for `hold_steps` steps. Another device that has gone `MEDDLED`
    of its way ends the episode as the wrong object.
    Potentials: approach (metres from the gripper to where it operates the referent from, negative) and operate (the
    share of what it must go that the referent has gone).
    """

    noun: str
    operates = True
    columns = (Column("faces x", -1.0, 1.0), Column("faces y", -1.0, 1.0), Column("share of its way", -1.0, 1.0))
    potentials = ("approach", "operate")

    def __init__(
        self, config: TaskConfig, object_area: Sequence[float], num_worlds: int, person: Person | None = None
    ) -> None:
        self.nouns = (self.noun,)
        device = DEVICES[self.noun]
        self._way = device.way * device.scale(config.object_size)
        if len(config.objects):
            raise ConfigError(f"task.objects must be empty in task.name={config.name}: its devices are drawn")
        super().__init__(config, object_area, num_worlds, person)

    @property
    def bodies(self) -> tuple[int, int, int]:
        return 0, 0, 0

    @property
    def devices(self) -> tuple[str, ...]:
        return (self.noun,) * self.config.num_objects

    # ---- judging

    @abstractmethod
    def _measure(self, state: State) -> Array:
        """(N, K) how far each device is, metres or radians from anywhere."""

    @abstractmethod
    def _from(self, state: State, place: Array) -> Array:
        """(N, 3) where a gripper operates the referent from, whose handle is at place (N, 3)."""

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._zero = np.zeros((worlds, self.config.slots))  # measures as the episode began

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        self._zero[worlds] = self._measure(state)[worlds]

    def seen(self, state: State) -> Array:
        return np.concatenate((facing(state.quaternions), self.ways(state)[..., None]), axis=2)

    def ways(self, state: State) -> Array:
        """(N, K) in [-1, 1]: the share of its way that each device has gone."""
        gone = self._measure(state) - self._zero
        return np.clip(np.where(state.shown, gone / self._way, 0.0), -1.0, 1.0)

    def _gone(self, state: State) -> Array:
        """(N,) the share of its way that the referent has gone, either way."""
        return np.abs(self.ways(state)[self._rows, state.referent])

    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        return self._gone(state) >= OPERATED

    def _disturbed(self, state: State) -> NDArray[np.bool_]:
        ways = np.abs(self.ways(state))
        ways[self._rows, state.referent] = 0.0
        return np.any(ways >= MEDDLED, axis=1)

    def _potentials(self, state: State) -> dict[str, Array]:
        return {
            "approach": -length(self._from(state, self._referent(state)) - state.gripper),
            "operate": np.minimum(self._gone(state) / OPERATED, 1.0),
        }

    def retold(self, placed: Placed, moments: State, rng: Generator) -> EpisodeSpec | None:
        """Nothing: an episode ends long before another device is operated."""
        return None

    # ---- drawing

    def _placed(self, rng: Generator) -> Placed:
        """Devices that face anywhere."""
        placed = super()._placed(rng)
        positions = placed.scene.positions.copy()
        positions[:, 2] = DEVICES[self.noun].grip(self.config.object_size)[2]
        yaw = rng.uniform(-math.pi, math.pi, len(positions))
        return placed._replace(scene=placed.scene.moved(positions), yaw=yaw)

    def _fits(self, placed: Placed) -> bool:
        x0, x1, y0, y1 = self._area
        places = placed.scene.positions[:, :2]
        return bool(((places >= [x0 + ROOM, y0 + ROOM]) & (places <= [x1 - ROOM, y1 - ROOM])).all())
