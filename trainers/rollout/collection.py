"""Collection of batches with TorchRL's collectors, in this process or in several."""

from __future__ import annotations

import copy
import multiprocessing
import signal
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import torch
from tensordict import TensorDictBase
from torchrl.collectors import Collector, MultiSyncCollector

from trainers.config import CollectorConfig, workers
from trainers.environment import TrainingEnv
from trainers.models.policy import Policy
from trainers.rollout.worker_monitor import WORKER_DIED, CollectionError, WorkerMonitor

MakeEnv = Callable[[int, int], TrainingEnv]  # (number of worlds, seed)


def derive_seed(seed: int, index: int, evaluation: bool = False) -> int:
    """A seed of 31 bits for worker or evaluation `index` of a run.

    Bit 30 separates evaluation from training, so that an evaluation never uses a seed of training.
    """
    word = int(np.random.SeedSequence([seed, index, int(evaluation)]).generate_state(1)[0])
    return (word & 0x3FFFFFFF) | (int(evaluation) << 30)


class Rollouts:
    """Batches (worlds of all workers, horizon), collected with the policy that `sync` was last given.

    The policy acts on the CPU, where the worlds are, whatever device it learns on. `close` must be called at the end.
    """

    def __init__(self, make_env: MakeEnv, policy: Policy, config: CollectorConfig, horizon: int, seed: int) -> None:
        self.cpu_policy = copy.deepcopy(policy).cpu()
        count = workers(config)
        worlds = config.worlds // count
        common: dict[str, Any] = {
            "frames_per_batch": config.worlds * horizon,
            "total_frames": -1,
            "auto_register_policy_transforms": False,
        }
        act = self.cpu_policy.act
        if count == 1:
            make = partial(make_env, worlds, derive_seed(seed, 0))
            self.collector = Collector(make, act, use_buffers=False, **common)
        else:
            makes = [partial(_make_in_worker, make_env, worlds, derive_seed(seed, i)) for i in range(count)]
            self.collector = MultiSyncCollector(makes, act, cat_results=0, use_buffers=True, num_threads=1, **common)
        self.processes = list(getattr(self.collector, "procs", []))
        self.batches = iter(self.collector)
        self.monitor = WorkerMonitor(self.processes) if self.processes else None

    def sync(self, policy: Policy) -> None:
        """Copy the policy's weights; the following batches are collected with them."""
        self.cpu_policy.load_state_dict(policy.state_dict())
        if self.processes:
            self.collector.update_policy_weights_()

    def next(self) -> TensorDictBase:
        """The next batch. The batch after it reuses its memory.

        Raises:
            CollectionError: a worker process has died or hangs.
        """
        torch.set_num_threads(1)  # the networks are too small for several cores at one batch of worlds
        if not self.processes:
            return next(self.batches)
        try:
            return next(self.batches)
        except ValueError as error:  # from TorchRL's cleanup, if another worker is slow to end
            raise CollectionError(f"{WORKER_DIED}: {error}") from error
        except (RuntimeError, OSError, EOFError) as error:
            raise CollectionError(f"collecting in worker processes failed: {error}") from error

    def close(self) -> None:
        """End every worker process; kill those that do not end."""
        if self.monitor is None:
            return self.collector.shutdown()
        self.monitor.close()
        try:
            self.collector.shutdown(raise_on_error=False)
        finally:
            for child in multiprocessing.active_children():
                if child in self.processes:
                    child.kill()
                    child.join()


def _make_in_worker(make_env: MakeEnv, worlds: int, seed: int) -> TrainingEnv:
    """The environment of a worker process, with one thread and its own noise.

    The process ignores SIGINT: a terminal sends it to all processes, but the main one decides how to stop.
    """
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    return make_env(worlds, seed)
