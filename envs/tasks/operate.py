"""Common logic of the tasks with devices: one of several is pressed, switched or turned, and no other."""

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

OPERATED = 0.8  # share of its range at which a device is operated
OTHER_OPERATED = 0.3  # share of its range at which another device counts as the wrong object
MARGIN = 0.05  # metres from the border of the object area to the handles, so that a gripper reaches every side


class Operate(Manipulation):
    """All objects are devices of one noun. Their poses are those of their handles.

    Success: the referent has travelled `OPERATED` of its range, for `hold_steps` steps. Another device that has
    travelled `OTHER_OPERATED` of its range ends the episode as `wrong_object`.
    Potentials: approach (metres from the gripper to where it operates the referent from, negative) and operate (the
    travelled share of what success requires).
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
        """(N, K) the joint value of each device, metres or radians, from any zero."""

    @abstractmethod
    def _from(self, state: State, place: Array) -> Array:
        """(N, 3) the position from which a gripper operates the referent, whose handle is at place (N, 3)."""

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._zero = np.zeros((worlds, self.config.slots))  # measures as the episode began

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        self._zero[worlds] = self._measure(state)[worlds]

    def seen(self, state: State) -> Array:
        return np.concatenate((facing(state.quaternions), self.travel(state)[..., None]), axis=2)

    def travel(self, state: State) -> Array:
        """(N, K) in [-1, 1]: the share of its range that each device has travelled."""
        gone = self._measure(state) - self._zero
        return np.clip(np.where(state.shown, gone / self._way, 0.0), -1.0, 1.0)

    def _gone(self, state: State) -> Array:
        """(N,) the share of its range that the referent has travelled, in either direction."""
        return np.abs(self.travel(state)[self._rows, state.referent])

    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        return self._gone(state) >= OPERATED

    def _disturbed(self, state: State) -> NDArray[np.bool_]:
        ways = np.abs(self.travel(state))
        ways[self._rows, state.referent] = 0.0
        return np.any(ways >= OTHER_OPERATED, axis=1)

    def _potentials(self, state: State) -> dict[str, Array]:
        return {
            "approach": -length(self._from(state, self._referent(state)) - state.gripper),
            "operate": np.minimum(self._gone(state) / OPERATED, 1.0),
        }

    def relabel(self, placed: Placed, moments: State, rng: Generator) -> EpisodeSpec | None:
        """None: an episode ends before another device is operated."""
        return None

    # ---- drawing

    def _placed(self, rng: Generator) -> Placed:
        """Devices with random yaw."""
        placed = super()._placed(rng)
        positions = placed.scene.positions.copy()
        positions[:, 2] = DEVICES[self.noun].grip(self.config.object_size)[2]
        yaw = rng.uniform(-math.pi, math.pi, len(positions))
        return placed._replace(scene=placed.scene.moved(positions), yaw=yaw)

    def _is_feasible(self, placed: Placed) -> bool:
        x0, x1, y0, y1 = self._area
        places = placed.scene.positions[:, :2]
        return bool(((places >= [x0 + MARGIN, y0 + MARGIN]) & (places <= [x1 - MARGIN, y1 - MARGIN])).all())
