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
    _lengths: NDArray[np.int64] | None = None  # (N,) steps of each present episode; None: no episode has begun
    _actions: list[Tensor]  # (N, A) of each of the latest steps

    @abstractmethod
    def _begin_episodes(self, worlds: NDArray[np.int64]) -> TensorDictBase:
        """Begin a new episode in each of these worlds. Returns the observation (N,) of all worlds."""

    def _beginning(self, i: int) -> Mapping[str, Any]:
        draws = {} if self._draws is None else self._draws.draw_state
        return {**self._generators[i].bit_generator.state, "draws": draws}

    def _restore(self, i: int, beginning: Mapping[str, Any]) -> None:
        """Make the next episode of world i the one with this beginning."""
        self._begin_to_remember(i, beginning)
        self._generators[i].bit_generator.state = {key: beginning[key] for key in beginning if key != "draws"}
        if self._draws is not None:
            self._draws.load_draw_state(beginning.get("draws", {}))  # earlier versions had none

    def _set_seed(self, seed: int | None) -> None:
        seeds = [np.random.SeedSequence(seed, spawn_key=(i,)) for i in range(self.batch_size[0])]
        self._generators = [np.random.default_rng(sequence) for sequence in seeds]
        if self._draws is not None:
            self._draws.load_draw_state({})  # the initial state
        self.beginnings = [self._beginning(i) for i in range(len(seeds))]
        self._lengths, self._actions = None, []

    def _begin_to_remember(self, i: int, beginning: Mapping[str, Any]) -> None:
        """Remember the beginning of an episode in world i."""
        self.beginnings[i] = beginning
        if self._lengths is None:
            self._lengths = np.zeros(len(self._generators), np.int64)
        self._lengths[i] = 0
        del self._actions[: len(self._actions) - int(self._lengths.max())]

    def _remember(self, action: Tensor) -> None:
        """Remember the action (N, A) of a step, from which a copy of the environment is made."""
        if self._lengths is not None:
            self._lengths += 1
            self._actions.append(action.detach().clone())

    def present(self) -> dict[str, Any]:
        """Return what `restore_present` needs to bring another environment, built alike, to where this one is."""
        return {
            "beginnings": list(self.beginnings),
            "lengths": None if self._lengths is None else self._lengths.copy(),
            "actions": list(self._actions),
            "generators": [generator.bit_generator.state for generator in self._generators],
            "draws": None if self._draws is None else dict(self._draws.draw_state),
            "continued": self._continued,
        }

    def restore_present(self, present: Mapping[str, Any]) -> None:
        """Take the steps of another environment's present episodes again. present: what its `present` returned."""
        lengths, actions = present["lengths"], present["actions"]
        if lengths is None:
            self.beginnings = list(present["beginnings"])
        else:
            taken = (
                torch.stack(actions[len(actions) - int(lengths.max()) :], 1) if lengths.max() else self._no_actions()
            )
            self._replay(present["beginnings"], taken, torch.from_numpy(lengths))
        for generator, state in zip(self._generators, present["generators"], strict=True):
            generator.bit_generator.state = state
        if self._draws is not None:
            self._draws.load_draw_state(present["draws"])
        self._continued = present["continued"]

    def _no_actions(self) -> Tensor:
        return torch.zeros(self.batch_size[0], 0, self.action_spec.shape[-1])

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
            self._begin_to_remember(i, self._beginning(i))
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
