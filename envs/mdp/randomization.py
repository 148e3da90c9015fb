"""What training episodes draw beside scene and sentence: joint angles at the beginning, and noise and delay."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from envs.sim.kinematics import Array, Kinematics
from envs.tasks import EpisodeSpec, TaskConfig

GRID = (5, 9, 5)  # positions along x, y and z that are solved beforehand
REFINING_STEPS = 8  # of inverse kinematics, from the nearest of those


class InitialStates:
    """Draws joint angles.

    Args:
        kinematics: the arm.
        noise: radians that each joint may be from its rest pose.
        box: (2, 3), lowest and highest corner of where grippers may be, metres, for episodes that the curriculum
            begins elsewhere; None: there is no curriculum.
    """

    def __init__(self, kinematics: Kinematics, noise: float, box: Array | None = None) -> None:
        self._kinematics, self._noise = kinematics, noise
        self._rotation = kinematics.forward(kinematics.rest[None]).rotation[0]
        self._positions = self._joints = np.zeros((0, 3))
        if box is not None:
            self._positions, self._joints = _solved_grid(kinematics, tuple(map(tuple, box.tolist())))

    def draw(self, episode: EpisodeSpec, below: float, rng: Generator) -> Array:
        """(J,) for this episode. below: metres from the gripper centre down to the centre of an object it holds."""
        joints = self._kinematics.rest + rng.uniform(-self._noise, self._noise, len(self._kinematics.rest))
        if episode.start is None or not len(self._positions):
            return joints
        return self.joints(episode.scene.positions[episode.referent] + episode.start.offset + [0.0, 0.0, below])

    def joints(self, position: Array) -> Array:
        """(J,) with the gripper at position (3,), metres, pointing down."""
        nearest = ((self._positions - position) ** 2).sum(1).argmin()
        return self._kinematics.solve(self._joints[[nearest]], position[None], self._rotation, REFINING_STEPS)[0]


@lru_cache(maxsize=64)
def _solved_grid(kinematics: Kinematics, box: tuple[tuple[float, ...], ...]) -> tuple[Array, Array]:
    """Positions (P, 3) all over the box, and joints (P, J) with the gripper there, oriented as at rest."""
    axes = [np.linspace(low, high, count) for low, high, count in zip(*box, GRID, strict=True)]
    positions = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    rest = np.repeat(kinematics.rest[None], len(positions), axis=0)
    rotation = kinematics.forward(kinematics.rest[None]).rotation[0]
    return positions, kinematics.solve(rest, positions, rotation, iterations=60)


class Perturbations:
    """Noise and delay of N worlds with K slots. An episode's noise follows from its seed, not from other worlds.

    Args:
        config: of the task.
        worlds: N.
        unit: (A,) the action unit of each number of the arm's action; an action may have further numbers.
    """

    def __init__(self, config: TaskConfig, worlds: int, unit: Array) -> None:
        randomize, self._rows, self._unit = config.randomize, np.arange(worlds), unit
        steps = config.max_steps if randomize.is_on else 0
        self._acts, self._sees = randomize.action_noise, randomize.observation_noise
        self._delay = np.zeros(worlds, np.int64)
        self._motion = np.zeros((worlds, steps if self._acts else 0, len(unit)))
        self._places = np.zeros((worlds, steps + 1 if self._sees else 0, config.slots, 3))
        self._sent: Array | None = None  # (N, delay + 1, A) the latest actions, by control step
        self._latest = randomize.delay[1] + 1

    def begin(self, world: int, episode: EpisodeSpec) -> None:
        """Begin an episode with the values that it drew."""
        drawn = episode.randomized
        self._delay[world] = 0 if drawn is None else drawn.delay
        rng = np.random.default_rng(0 if drawn is None else drawn.noise)
        for table, std in ((self._motion, self._acts), (self._places, self._sees)):
            table[world] = 0.0 if drawn is None else std * rng.standard_normal(table.shape[1:])

    def action(self, action: Array, steps: NDArray[np.int64], hold: Callable[[], NDArray]) -> Array:
        """Return the action (N, A) that is carried out: late, and with noise.

        Args:
            action: (N, A) as the policy gives it.
            steps: (N,) control steps since each episode began.
            hold: the action (N, A) that keeps the arm where it is, until the first one arrives.
        """
        if self._latest > 1:
            action = self._late(action, steps, hold)
        if self._motion.shape[1]:
            action = action.copy()
            within = np.minimum(steps, self._motion.shape[1] - 1)
            action[:, : len(self._unit)] += self._unit * self._motion[self._rows, within]
            action = np.clip(action, -1.0, 1.0)
        return action

    def _late(self, action: Array, steps: NDArray[np.int64], hold: Callable[[], NDArray]) -> Array:
        if self._sent is None:
            self._sent = np.zeros((len(action), self._latest, action.shape[1]))
        self._sent[self._rows, steps % self._latest] = action
        late = self._sent[self._rows, (steps - self._delay) % self._latest]
        return np.where((steps < self._delay)[:, None], hold(), late)

    def seen(self, rows: Array, steps: NDArray[np.int64]) -> Array:
        """(N, K, D) the rows of objects as they are observed after this many steps (N,), positions first."""
        if not self._places.shape[1]:
            return rows
        rows = rows.copy()
        rows[..., :3] += self._places[self._rows, np.minimum(steps, self._places.shape[1] - 1)]
        return rows
