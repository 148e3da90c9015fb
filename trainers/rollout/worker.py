"""A worker collects its share of each batch: TorchRL's collector over one batched environment, in any process."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torchrl.collectors import Collector

from trainers.environment import TrainingEnv
from trainers.rollout.episode_log import Beginning, Episodes
from trainers.rollout.seeds import derive_seed, noise_seed

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
