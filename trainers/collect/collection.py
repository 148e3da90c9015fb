"""Statistics of the training episodes, from the collected batches."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from tensordict import TensorDictBase
from torch import Tensor

from trainers.collect.worker import EpisodeLog, Episodes, MakeEnv, Worker, WorkerSpec
from trainers.collect.worker_pool import CollectionError, Order, WorkerHost, WorkerPool, raised
from trainers.collect.worker_process import ProcessHost
from trainers.config import CollectorConfig, RayCollectorConfig, workers
from trainers.models.policy import ExpertMixture, Policy


class EpisodeStatistics:
    """Success, return and length of the episodes that end in each batch. Running episodes continue in the next batch.

    reward_names: the names of the columns of reward_terms.
    """

    def __init__(self, reward_names: Sequence[str] = ()) -> None:
        self.reward_names = reward_names
        self._running: np.ndarray | None = None  # (2, worlds) return and length so far

    @property
    def metrics(self) -> tuple[str, ...]:
        """The names that `measure` returns."""
        names = ("success", "wrong_object", "return", "length", "episodes")
        return (*(f"train/{name}" for name in names), *(f"reward/{name}" for name in self.reward_names))

    def state_dict(self) -> dict[str, Any]:
        """The returns and lengths of the running episodes, as plain values."""
        return {"running": None if self._running is None else self._running.tolist()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue the episodes of a `state_dict`."""
        self._running = None if state["running"] is None else np.array(state["running"])

    def measure(self, batch: TensorDictBase) -> dict[str, float]:
        """Means over the episodes that end in a batch (worlds, steps), and over all steps for the reward terms.

        NaN if no episode ends.
        """
        after = batch["next"]
        done = after["done"].squeeze(-1).numpy()
        returns, lengths = self._accumulate(after["reward"].squeeze(-1).numpy(), done)
        flags = (after[name].squeeze(-1).numpy()[done] for name in ("success", "wrong_object"))
        means = [float(x.mean()) if len(x) else float("nan") for x in (*flags, returns, lengths)]
        terms = after["reward_terms"].flatten(0, 1).mean(0).tolist() if self.reward_names else []
        return dict(zip(self.metrics, [*means, float(done.sum()), *terms], strict=True))

    def _accumulate(self, reward: np.ndarray, done: np.ndarray) -> np.ndarray:
        """Returns and lengths (2, ended) of the episodes that ended, in the order of the steps.

        reward, done: (worlds, steps).
        """
        running = np.zeros((2, len(reward))) if self._running is None else self._running
        ended = []
        for step_reward, step_done in zip(reward.T, done.T, strict=True):
            running = running + np.stack([step_reward, np.ones_like(step_reward)])
            ended.append(running[:, step_done])
            running = np.where(step_done, 0.0, running)
        self._running = running
        return np.concatenate(ended, axis=1)


class Rollouts:
    """Batches (worlds of all workers, steps), collected with the policy of the last `sync`.

    If batches are collected ahead, `next` requests a later one before it returns its own.

    The policy acts on the CPU, where the worlds are, whatever device it learns on. `close` must be called at the end.
    The batches depend on the arguments alone: the loss and replacement of a worker changes no bit.

    Args:
        make_env: `make_env(worlds, seed)` builds the environment; picklable.
        policy: its present weights. It may be a mixture with an expert.
        config: how many worlds and workers.
        horizon: steps of a batch.
        seed: of the workers.
        iteration: number of the first batch: it seeds the noise.
        state: a `state_dict` to continue from; it replaces `seed`.
        steps: how many steps are left of the run. The last batch is shortened to them. None: the run has no end.
    """

    def __init__(
        self,
        make_env: MakeEnv,
        policy: Policy | ExpertMixture,
        config: CollectorConfig,
        horizon: int,
        seed: int,
        iteration: int = 0,
        state: dict[str, Any] | None = None,
        steps: int | None = None,
    ) -> None:
        self.cpu_policy = copy.deepcopy(policy).cpu()
        self.iteration = iteration
        self.seed = seed if state is None else state["seed"]
        self.log = EpisodeLog(None if state is None else Episodes(**state["episodes"]))
        self.published: dict[int, dict[str, Tensor]] = {}  # iteration -> its weights, where batches are collected ahead
        self.worker: Worker | None = None
        self.pool: WorkerPool | None = None
        host: WorkerHost[Any] | None = None
        if isinstance(config, RayCollectorConfig):
            from trainers.cluster.ray_workers import RayHost

            host = RayHost(make_env, self.cpu_policy, config)
            count = host.count
        elif (count := workers(config)) > 1:
            host = ProcessHost(make_env, self.cpu_policy, config.batches_ahead)
        end = None if steps is None else iteration * horizon + steps
        specs = [WorkerSpec(i, config.worlds // count, horizon, self.seed, end) for i in range(count)]
        if host is None:
            self.worker = Worker(make_env, self.cpu_policy.act, specs[0], self.log.episodes)
        else:
            self.pool = WorkerPool(host, specs, config, self.log.episodes)
            self._ask_again((state or {}).get("ahead", [])[: config.batches_ahead])

    @property
    def processes(self) -> list[Any]:
        """The worker processes at this moment; none where this process or a cluster collects."""
        workers = [] if self.pool is None else self.pool.workers
        return [worker.process for worker in workers if hasattr(worker, "process")]

    @property
    def restarts(self) -> int:
        """How many workers have been replaced."""
        return 0 if self.pool is None else self.pool.restarts

    def sync(self, policy: Policy | ExpertMixture) -> None:
        """Copy the policy's weights. Batches that are requested from now on are collected with them."""
        self.cpu_policy.load_state_dict(policy.state_dict())
        if self.pool is not None:
            self.pool.host.publish()
            if ahead := self.pool.config.batches_ahead:
                recent = {k: weights for k, weights in self.published.items() if k >= self.iteration - ahead}
                self.published = recent | {self.iteration: copy.deepcopy(self.cpu_policy.state_dict())}

    def status(self) -> dict[str, str]:
        """The state of the workers, for display; {} unless a cluster collects."""
        return {} if self.pool is None else self.pool.host.status(self.pool.workers, self.pool.restarts, self.pool.age)

    def measures(self) -> dict[str, float]:
        """The values of the columns `columns(config)` of metrics.csv for the latest batch."""
        if self.pool is None or not columns(self.pool.config):
            return {}
        return {"time/batch_age": float(self.pool.age), "time/restarts": float(self.pool.restarts)}

    def next(self, stop: Callable[[], bool] = lambda: False) -> TensorDictBase:
        """The next batch. The batch after it reuses its memory.

        Args:
            stop: called while worker processes collect; True gives up the batch.

        Raises:
            Interrupted: `stop` returned True.
            CollectionError: a worker raised, or more than collector.restarts processes were lost.
        """
        torch.set_num_threads(1)  # the networks are too small for several cores at one batch of worlds
        if self.pool is not None:
            batch, began = self.pool.collect(Order(self.iteration, self.log.episodes, stop))
        else:
            assert self.worker is not None
            try:
                batch, began = self.worker.collect(self.iteration)
            except Exception as error:
                raise CollectionError(f"collecting a batch {raised(error)}") from error
        self.log.add(batch, began)
        self.iteration += 1
        return batch

    def state_dict(self) -> dict[str, Any] | None:
        """The state from which collection continues, bit for bit, after the latest batch; None before the first one."""
        episodes = self.log.episodes
        if episodes is None:
            return None
        return {"seed": self.seed, "episodes": episodes.state_dict(), "ahead": self._ahead()}

    def _ahead(self) -> list[dict[str, Any]]:
        """The requested batches whose weights are older than the present ones, each with its weights."""
        asked = {} if self.pool is None else self.pool.asked
        later = [(k, since) for k, (_, since) in sorted(asked.items()) if since < self.iteration <= k]
        return [{"iteration": k, "since": since, "weights": self.published[since]} for k, since in later]

    def _ask_again(self, ahead: Sequence[Mapping[str, Any]]) -> None:
        """Ask for the batches of an earlier `_ahead`."""
        assert self.pool is not None
        present = copy.deepcopy(self.cpu_policy.state_dict())
        for batch in ahead:
            if batch["since"] not in self.published:
                self.cpu_policy.load_state_dict(batch["weights"])
                self.pool.host.publish()
                self.published[batch["since"]] = batch["weights"]
            self.pool.ask(Order(batch["iteration"], self.log.episodes), batch["since"])
        self.cpu_policy.load_state_dict(present)

    def close(self) -> None:
        """End every worker process."""
        if self.pool is not None:
            self.pool.close()
        if self.worker is not None:
            self.worker.close()


def columns(config: CollectorConfig) -> tuple[str, ...]:
    """The columns of metrics.csv that describe collection on a cluster. Like timings, they differ between runs."""
    return ("time/batch_age", "time/restarts") if isinstance(config, RayCollectorConfig) else ()
