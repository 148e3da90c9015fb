"""Environments whose running episodes can be continued in another process, bit for bit.

PyBullet's `saveState` cannot do this: it leaves out motors, constraints and which bodies sleep. But a reset with the
same generator state gives the same bits. So a running episode follows from the generator state at its reset and the
actions since then. To continue it, the world is reset with that state, and the actions are applied again.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
import torch
from numpy.random import Generator
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.envs import EnvBase


class Draws(Protocol):
    """Draws episodes whose distribution depends on the outcomes of earlier ones."""

    @property
    def draw_state(self) -> dict[str, float]:
        """The state on which drawn episodes depend, beside the generator."""
        ...

    def load_draw_state(self, state: Mapping[str, float]) -> None:
        """Restore a `draw_state`. Values that it lacks become the initial ones."""
        ...


class EpisodeReplayEnv(EnvBase):
    """N worlds, each with a generator of its own, whose episodes can be continued (`continue_episodes`).

    beginnings: for each world, the state of its generator when its present episode began, and under "draws" the
    `draw_state` of that moment. Subclasses define `_begin_episodes` in place of `_reset`, and call `_set_seed` before
    the first reset.
    """

    beginnings: list[Mapping[str, Any]]
    _draws: Draws | None = None  # draws the episodes
    _generators: list[Generator]
    _continued: tuple[Sequence[Mapping[str, Any]], Tensor, Tensor] | None = None  # arguments of `continue_episodes`

    @abstractmethod
    def _begin_episodes(self, worlds: NDArray[np.int64]) -> TensorDictBase:
        """Begin a new episode in each of these worlds. Returns the observation (N,) of all worlds."""

    def _beginning(self, i: int) -> Mapping[str, Any]:
        draws = {} if self._draws is None else self._draws.draw_state
        return {**self._generators[i].bit_generator.state, "draws": draws}

    def _restore(self, i: int, beginning: Mapping[str, Any]) -> None:
        """Make the next episode of world i the one with this beginning."""
        self.beginnings[i] = beginning
        self._generators[i].bit_generator.state = {key: beginning[key] for key in beginning if key != "draws"}
        if self._draws is not None:
            self._draws.load_draw_state(beginning.get("draws", {}))  # earlier versions had none

    def _set_seed(self, seed: int | None) -> None:
        seeds = [np.random.SeedSequence(seed, spawn_key=(i,)) for i in range(self.batch_size[0])]
        self._generators = [np.random.default_rng(sequence) for sequence in seeds]
        if self._draws is not None:
            self._draws.load_draw_state({})  # the initial state
        self.beginnings = [self._beginning(i) for i in range(len(seeds))]

    def continue_episodes(self, beginnings: Sequence[Mapping[str, Any]], actions: Tensor, lengths: Tensor) -> None:
        """Let the next reset of all worlds continue these episodes instead of beginning new ones.

        Args:
            beginnings: for each world, the state of its generator when the episode began.
            actions: (N, T, A), those of the latest T steps.
            lengths: (N,) how many of them, the last ones, belong to the present episode.
        """
        self._continued = beginnings, actions, lengths

    def _reset(self, tensordict: TensorDictBase | None = None, **_: Any) -> TensorDictBase:
        if self._continued is not None:
            episodes, self._continued = self._continued, None
            return self._replay(*episodes)
        worlds = np.arange(self.batch_size[0])
        if tensordict is not None and "_reset" in tensordict.keys():
            worlds = np.flatnonzero(tensordict["_reset"].numpy().reshape(len(worlds), -1).any(1))
        for i in worlds.tolist():
            self.beginnings[i] = self._beginning(i)
        return self._begin_episodes(worlds)

    def _replay(self, beginnings: Sequence[Mapping[str, Any]], actions: Tensor, lengths: Tensor) -> TensorDictBase:
        """Return the observation (N,) after the last action. The arguments are those of `continue_episodes`.

        All worlds take their last action in the same step. Worlds with shorter episodes begin them later, and hold
        still until then: what happens in a world before a reset has no effect after it.
        """
        steps = actions.shape[1]
        starts = steps - lengths.numpy()
        observed = self._begin_episodes(np.arange(len(starts)))
        for t in range(int(starts.min()), steps + 1):
            for i in np.flatnonzero(starts == t).tolist():
                self._restore(i, beginnings[i])
                began = self._begin_episodes(np.array([i]))
                observed = _merged(began, observed, torch.arange(len(starts)) == i)
            if t < steps:
                waits = torch.from_numpy(starts > t)[:, None]
                action = torch.where(waits, observed["hold"], actions[:, t])
                stepped = self._step(TensorDict({"action": action}, self.batch_size))
                observed = stepped.exclude("reward")
        return observed


def _merged(new: TensorDictBase, old: TensorDictBase, chosen: Tensor) -> TensorDictBase:
    """(N,) `new` where `chosen` (N,) is true, `old` elsewhere."""
    return new.apply(lambda a, b: torch.where(chosen.reshape(-1, *[1] * (a.ndim - 1)), a, b), old)
