"""Common logic of the tasks with devices: one of several is pressed, switched or turned, and no other."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from conf.schema import ConfigError
from envs.sim.devices import DEVICES, facing
from envs.tasks.device_motion import MOTIONS, moved
from envs.tasks.geometry import length
from envs.tasks.manipulation import Manipulation
from envs.tasks.types import Array, Column, EpisodeSpec, State, TaskConfig
from human import Person
from language import NOUNS, Placed

OPERATED = 0.8  # share of its range at which a device is operated
OTHER_OPERATED = 0.3  # share of its range at which another device counts as the wrong object
SPRUNG = [list(NOUNS).index(noun) for noun, device in DEVICES.items() if device.spring]
MARGIN = 0.05  # metres from the border of the object area to the handles, so that a gripper reaches every side


class Operate(Manipulation):
    """The referent is a device of one noun. The pose of a device is that of its handle.

    Success: the referent has travelled `OPERATED` of its range, for `hold_steps` steps. Another device that has
    travelled `OTHER_OPERATED` of its range ends the episode as `wrong_object`.
    Potentials: approach (metres from the gripper to where it operates the referent from, negative) and operate (the
    travelled share of what success requires).
    """

    noun: str
    columns: tuple[Column, ...] = (
        Column("faces x", -1.0, 1.0),
        Column("faces y", -1.0, 1.0),
        Column("share of its way since the instruction was given", -1.0, 1.0),
    )
    potentials = ("approach", "operate")

    def __init__(
        self, config: TaskConfig, object_area: Sequence[float], num_worlds: int, person: Person | None = None
    ) -> None:
        if len(config.objects):
            raise ConfigError(f"task.objects must be empty in task.name={config.name}: its devices are drawn")
        super().__init__(config, object_area, num_worlds, person)

    # ---- evaluating

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._zero = np.zeros((worlds, self.config.slots))  # joint values as the episode began
        self._before = np.zeros((worlds, self.config.slots))  # how far devices had been moved then

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        self._zero[worlds] = self._measure(state)[worlds]
        self._before[worlds] = moved(state, self.device_width)[worlds]

    def _measure(self, state: State) -> Array:
        """(N, K) the joint value of each device, metres or radians, from any zero."""
        return MOTIONS[self.noun].measure(state.objects, state.quaternions)

    def travel(self, state: State) -> Array:
        """(N, K) in [-1, 1]: the share of its range that each device has travelled; 0 for other objects."""
        gone = DEVICES[self.noun].travelled(self.device_width, self._zero, self._measure(state))
        return np.where(state.shown, gone, 0.0)

    def before(self, referent: NDArray[np.int64]) -> Array:
        """(N,) how far the referents (N,) had been moved as the episode began, in shares of their way."""
        return self._before[self._rows, referent]

    def seen(self, state: State) -> Array:
        return np.concatenate((facing(state.quaternions), self.travel(state)[..., None]), axis=2)

    def _gone(self, state: State) -> Array:
        """(N,) the share of its range that the referent has travelled, in either direction."""
        return np.abs(self.travel(state)[self._rows, state.referent])

    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        return self._gone(state) >= OPERATED

    def _disturbed(self, state: State) -> NDArray[np.bool_]:
        ways = self.travel(state)
        ways = np.where(np.isin(state.nouns, SPRUNG), ways, np.abs(ways))  # a button that is let go springs back
        ways[self._rows, state.referent] = 0.0
        return np.any(ways >= OTHER_OPERATED, axis=1)

    def _potentials(self, state: State) -> dict[str, Array]:
        turns = state.quaternions[self._rows, state.referent]
        before = self.before(state.referent)
        start = MOTIONS[self.noun].start(self._referent(state), turns, state.gripper, before)
        return {
            "approach": -length(start - state.gripper),
            "operate": np.minimum(self._gone(state) / OPERATED, 1.0),
        }

    def relabel(self, placed: Placed, moments: State, rng: Generator) -> EpisodeSpec | None:
        """None: an episode ends before another device is operated."""
        return None


class OperateAlone(Operate):
    """All objects are devices of that noun."""

    operates = True

    def __init__(
        self, config: TaskConfig, object_area: Sequence[float], num_worlds: int, person: Person | None = None
    ) -> None:
        self.nouns = (self.noun,)
        super().__init__(config, object_area, num_worlds, person)

    @property
    def bodies(self) -> tuple[int, int, int]:
        return 0, 0, 0

    @property
    def devices(self) -> tuple[str, ...]:
        return (self.noun,) * self.config.num_objects

    def _placed(self, rng: Generator) -> Placed:
        """Devices with random yaw."""
        placed = super()._placed(rng)
        positions = placed.scene.positions.copy()
        positions[:, 2] = DEVICES[self.noun].grip(self.device_width)[2]
        yaw = rng.uniform(-math.pi, math.pi, len(positions))
        return placed._replace(scene=placed.scene.moved(positions), yaw=yaw)

    def _is_feasible(self, placed: Placed) -> bool:
        x0, x1, y0, y1 = self._area
        places = placed.scene.positions[:, :2]
        return bool(((places >= [x0 + MARGIN, y0 + MARGIN]) & (places <= [x1 - MARGIN, y1 - MARGIN])).all())
