"""Seeds of a run's parts, derived from the run's seed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor
from torchrl.collectors import Collector

from trainers.environment import TrainingEnv

NOISE = 2  # the third word of noise seeds; that of other seeds is 0 or 1


def derive_seed(seed: int, index: int, evaluation: bool = False) -> int:
    """A seed of 31 bits for worker or evaluation `index` of a run.

    Bit 30 separates evaluation from training, so that an evaluation never uses a seed of training.
    """
    word = int(np.random.SeedSequence([seed, index, int(evaluation)]).generate_state(1)[0])
    return (word & 0x3FFFFFFF) | (int(evaluation) << 30)


def noise_seed(seed: int, worker: int, iteration: int) -> int:
    """The seed of a worker's exploration noise in one batch, so that no worker's generator need be saved."""
    return int(np.random.SeedSequence([seed, worker, NOISE, iteration]).generate_state(1, np.uint64)[0])


Beginning = Mapping[str, Any]  # the state of a world's generator when its episode began: plain values


@dataclass(frozen=True)
class Episodes:
    """The episodes that N worlds are in after a batch.

    beginnings: for each world, the state of its generator when the episode began. actions: (N, T, A), those of the
    latest T steps. lengths: (N,) how many of them, the last ones, belong to the present episode.
    """

    beginnings: Sequence[Beginning]
    actions: Tensor
    lengths: Tensor

    def part(self, first: int, count: int) -> Episodes:
        """Those of worlds first to first + count - 1."""
        worlds = slice(first, first + count)
        lengths = self.lengths[worlds]
        return Episodes(self.beginnings[worlds], self.actions[worlds, -int(lengths.max()) or None :], lengths)

    def state_dict(self) -> dict[str, Any]:
        """Plain values and tensors."""
        return {"beginnings": list(self.beginnings), "actions": self.actions.clone(), "lengths": self.lengths.clone()}


class EpisodeLog:
    """Follows the worlds of all workers. `episodes` is None before the first batch."""

    def __init__(self, episodes: Episodes | None = None) -> None:
        self.episodes = episodes

    def add(self, batch: TensorDictBase, beginnings: Mapping[int, Beginning]) -> None:
        """Take a batch (worlds, steps). beginnings: of the worlds whose episode began in it, or of all worlds."""
        done, steps = batch["next", "done"][..., 0], batch.shape[1]
        since = steps - 1 - _last(done)  # steps after the last end; all of them where no episode ended
        actions, lengths = batch["action"], since
        known = [beginnings.get(i) for i in range(len(done))]
        if self.episodes is not None:
            known = [new or old for new, old in zip(known, self.episodes.beginnings, strict=True)]
            lengths = torch.where(done.any(1), since, self.episodes.lengths + steps)
            actions = torch.cat((self.episodes.actions, actions), 1)
        keep = int(lengths.max())
        self.episodes = Episodes([each or {} for each in known], actions[:, actions.shape[1] - keep :].clone(), lengths)


def _last(flags: Tensor) -> Tensor:
    """(N,) the index of the last true value in each row of (N, T); -1 where there is none."""
    order = torch.arange(1, flags.shape[1] + 1)
    return (flags * order).amax(1) - 1


MakeEnv = Callable[[int, int], TrainingEnv]  # (number of worlds, seed)


@dataclass(frozen=True)
class WorkerSpec:
    """Which worker of a run it is.

    index: among the workers. worlds: of this worker. horizon: steps of a batch. seed: of all workers of the run. end:
    steps of the whole run; the last batch is shortened to it. None: the run has no end.
    """

    index: int
    worlds: int
    horizon: int
    seed: int
    end: int | None = None

    def steps(self, iteration: int) -> int:
        """Steps of the batch of this iteration; 0 after the end."""
        left = math.inf if self.end is None else self.end - iteration * self.horizon
        return int(max(0, min(self.horizon, left)))


class Worker:
    """Collects batches (worlds, steps).

    A batch depends on the spec, the policy's weights, the episodes that the worlds are in and the number of the
    iteration, and on nothing else: another worker that starts with the same values collects the same bits.

    Args:
        make_env: builds the environment.
        act: the module from observations to "action". It acts on the CPU; whoever owns it changes its weights.
        spec: which worker it is.
        episodes: to continue; None to begin new ones.
    """

    def __init__(
        self, make_env: MakeEnv, act: TensorDictModuleBase, spec: WorkerSpec, episodes: Episodes | None = None
    ) -> None:
        self.spec = spec
        self.env = make_env(spec.worlds, derive_seed(spec.seed, spec.index))
        options: dict[str, Any] = {"frames_per_batch": spec.worlds * spec.horizon, "total_frames": -1}
        self.collector = Collector(self.env, act, use_buffers=False, auto_register_policy_transforms=False, **options)
        if episodes is not None:
            self.env.continue_episodes(episodes.beginnings, episodes.actions, episodes.lengths)
            self.collector.reset()
        self.reported: list[Beginning | None] = [None] * spec.worlds

    def collect(self, iteration: int) -> tuple[TensorDictBase, dict[int, Beginning]]:
        """A batch (worlds, steps), and the generators' states of those worlds whose episode began in it.

        The first call returns the states of all worlds.
        """
        self.collector.frames_per_batch = self.spec.steps(iteration)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(noise_seed(self.spec.seed, self.spec.index, iteration))
            batch = self.collector.rollout()
        new = {
            i: state
            for i, (state, old) in enumerate(zip(self.env.beginnings, self.reported, strict=True))
            if state is not old
        }
        self.reported = list(self.env.beginnings)
        return batch, new

    def close(self) -> None:
        """Close the environment."""
        self.collector.shutdown()
