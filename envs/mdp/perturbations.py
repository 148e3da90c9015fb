"""Noise and delay between a policy and its worlds, where a task randomizes them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from envs.sim.kinematics import Array
from envs.tasks import EpisodeSpec, TaskConfig


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
        """The action (N, A) that is carried out: late, and with noise.

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
