"""Batches for training: collected by one worker in this process, or by a pool of workers outside of it."""

from __future__ import annotations

import copy
import sys
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import wait
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
import torch
from tensordict import TensorDictBase
from torch import Tensor

from core.errors import Interrupted, RunError
from trainers.collect.worker import (
    START_SECONDS,
    Beginning,
    EpisodeLog,
    Episodes,
    MakeEnv,
    RemoteWorker,
    Worker,
    WorkerLostError,
    WorkerProcess,
    WorkerSpec,
    raised,
)
from trainers.config import CollectorConfig, RayCollectorConfig, workers
from trainers.models.policy import ExpertMixture, Policy

POLL_SECONDS = 0.2  # between two looks at the signals and the deadlines
MARGIN_SECONDS = 4.0  # added to twice the slowest of the latest batches
RECENT_BATCHES = 50


W = TypeVar("W", bound=RemoteWorker)


class CollectionError(RunError):
    """A batch could not be collected. The run cannot continue."""


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
        *,
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
            if self.pool.ahead:
                recent = {k: weights for k, weights in self.published.items() if k >= self.iteration - self.pool.ahead}
                self.published = recent | {self.iteration: copy.deepcopy(self.cpu_policy.state_dict())}

    def status(self) -> dict[str, str]:
        """Return the state of the workers, for display; {} unless a cluster collects."""
        return {} if self.pool is None else self.pool.host.status(self.pool.workers, self.pool.restarts, self.pool.age)

    def measures(self) -> dict[str, float]:
        """Return the values of the columns `collector_columns(config)` of metrics.csv for the latest batch."""
        if self.pool is None or not collector_columns(self.pool.config):
            return {}
        return {"time/batch_age": float(self.pool.age), "time/restarts": float(self.pool.restarts)}

    def next(self, stop: Callable[[], bool] = lambda: False) -> TensorDictBase:
        """Return the next batch. The batch after it reuses its memory.

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
        """Return the state from which collection continues, bit for bit; None before the first batch."""
        episodes = self.log.episodes
        if episodes is None:
            return None
        return {"seed": self.seed, "episodes": episodes.state_dict(), "ahead": self._ahead()}

    def _ahead(self) -> list[dict[str, Any]]:
        """Return the requested batches whose weights are older than the present ones, each with its weights."""
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


def collector_columns(config: CollectorConfig) -> tuple[str, ...]:
    """Return the columns of metrics.csv that describe collection on a cluster.

    Like timings, they differ between runs.
    """
    return ("time/batch_age", "time/restarts") if isinstance(config, RayCollectorConfig) else ()


@dataclass(frozen=True)
class Order:
    """A batch to collect.

    iteration: seeds the noise. episodes: of all worlds before the batch, which the successor of a lost worker
    continues; None at first. stop: called while the pool waits; True gives up.
    """

    iteration: int
    episodes: Episodes | None = None
    stop: Callable[[], bool] = lambda: False


class WorkerPool:
    """Collects batches (worlds of all workers, steps) outside of this process.

    Workers may collect batches ahead: during an update they collect the next ones, with the weights at the time of the
    request. So each batch depends on the weights of a known iteration, however slow a worker is.

    Args:
        host: where the workers run.
        specs: of the workers, in the order of their worlds.
        config: how long it waits for a worker, how many it replaces, and how many batches are collected ahead.
        episodes: of all worlds, to continue; None to begin new ones.
    """

    def __init__(
        self, host: WorkerHost[Any], specs: Sequence[WorkerSpec], config: CollectorConfig, episodes: Episodes | None
    ) -> None:
        self.host, self.specs, self.config, self.ahead = host, specs, config, config.batches_ahead
        self.buffers: list[TensorDictBase] = []  # used in turns; none before the first batch
        self.durations: deque[float] = deque(maxlen=RECENT_BATCHES * len(specs))
        self.patience_factor = 1.0
        self.restarts = 0
        self.age = 0  # of the latest batch: how many iterations old its weights were
        # Iteration -> the weights with which its batch was requested, and their iteration.
        self.asked: dict[int, tuple[Any, int]] = {}
        self.workers = [self._start(spec, episodes) for spec in specs]

    def collect(self, order: Order) -> tuple[TensorDictBase, dict[int, Beginning]]:
        """Return the batch, whose memory the next one reuses, and the beginnings of its new episodes, by world.

        Raises:
            Interrupted: `stop` returned True.
            CollectionError: more than collector.restarts workers were lost.
        """
        parts: dict[int, TensorDictBase | None] = {}
        beginnings: dict[int, Beginning] = {}
        self._move(order)
        self._request_all(order)
        waiting_since = time.monotonic()
        while len(parts) < len(self.workers):
            if order.stop():
                raise Interrupted
            ready = self._ready(set(range(len(self.workers))) - set(parts))
            for index in ready:
                worker = self.workers[index]
                starting = not worker.answered
                try:
                    parts[index], began = worker.receive()
                except WorkerLostError as error:
                    self._replace(index, str(error), order)
                else:
                    beginnings |= {self._first_world(index) + i: state for i, state in began.items()}
                    if not starting:
                        self.durations.append(worker.collect_seconds)
            if ready:
                waiting_since = time.monotonic()  # answers that take long to read do not make the others late
            else:
                self._replace_overdue(set(range(len(self.workers))) - set(parts), order, waiting_since)
        self.age = order.iteration - self.asked[order.iteration][1]
        return self._whole(order.iteration, [parts[index] for index in range(len(self.workers))]), beginnings

    def ask(self, order: Order, since: int) -> None:
        """Ask for a batch with the weights that the host has now. since: the iteration of these weights."""
        self.asked[order.iteration] = self.host.weights, since
        for index in range(len(self.workers)):
            self._request(index, order, [order.iteration])

    def _request_all(self, order: Order) -> None:
        """Ask for the batches that have not been asked for: this one, and those ahead of it."""
        self.asked = {k: asked for k, asked in self.asked.items() if k >= order.iteration}
        for iteration in range(order.iteration, order.iteration + self.ahead + 1):
            if iteration not in self.asked and self.specs[0].steps(iteration):
                self.ask(replace(order, iteration=iteration), order.iteration)

    def _ready(self, indices: set[int]) -> list[int]:
        """Return the workers that have answered or ended, after at most POLL_SECONDS."""
        waited = [self.workers[index] for index in sorted(indices)]
        return [worker.spec.index for worker in self.host.wait(waited, POLL_SECONDS)]

    def close(self) -> None:
        """End every worker."""
        for worker in self.workers:
            worker.kill()
        self.host.close()

    @property
    def patience(self) -> float:
        """Seconds to wait for a batch before a worker counts as stuck."""
        if self.config.timeout is not None:
            return self.config.timeout
        expected = 2 * max(self.durations) + MARGIN_SECONDS if self.durations else START_SECONDS
        return self.patience_factor * expected

    def _whole(self, iteration: int, parts: Sequence[TensorDictBase | None]) -> TensorDictBase:
        """Return the batch of all workers, in a buffer. The first batch allocates the buffers."""
        if not self.buffers:
            whole = torch.cat([part for part in parts if part is not None])
            self.buffers = [self.host.allocate(whole.clone()) for _ in range(self.host.buffers)]
            # A worker that ends while it opens them has this process print a traceback: none does without a use.
            asked_later = self.specs[0].steps(iteration + self.ahead + 1) > 0
            for index, worker in enumerate(self.workers if asked_later else ()):
                with suppress(WorkerLostError):  # the next request notices it, and its successor has the buffers
                    worker.use_buffers(self._slices(index))
        buffer, steps = iteration % len(self.buffers), self.specs[0].steps(iteration)
        for index, part in enumerate(parts):
            if part is not None:
                self._slices(index)[buffer][:, :steps].update_(part)
        return self.buffers[buffer][:, :steps]

    def _first_world(self, index: int) -> int:
        return sum(spec.worlds for spec in self.specs[:index])

    def _slices(self, index: int) -> list[TensorDictBase]:
        first = self._first_world(index)
        return [buffer[first : first + self.specs[index].worlds] for buffer in self.buffers]

    def _start(self, spec: WorkerSpec, episodes: Episodes | None) -> RemoteWorker:
        part = None if episodes is None else episodes.part(self._first_world(spec.index), spec.worlds)
        started: RemoteWorker = self.host.start(spec, part, self._slices(spec.index))
        return started

    def _request(self, index: int, order: Order, iterations: Sequence[int]) -> None:
        try:
            for iteration in iterations:
                self.workers[index].request(iteration, self.asked[iteration][0])
        except WorkerLostError as error:
            self._replace(index, str(error), order)

    def _move(self, order: Order) -> None:
        """Restart workers for which the host has a better place. The batches that they were collecting are lost."""
        for index in self.host.moved(self.workers):
            self.workers[index].kill()
            self.workers[index] = self._start(self.specs[index], order.episodes)
            self._request(index, order, sorted(k for k in self.asked if k >= order.iteration))

    def _replace_overdue(self, indices: set[int], order: Order, waiting_since: float) -> None:
        patience = self.patience
        for index in sorted(indices):
            if self.workers[index].overdue(patience, waiting_since):
                self.patience_factor *= 2  # it may only have been slow: the machine is busier than it was
                self._replace(index, f"did not answer for {patience:.1f} s", order)

    def _replace(self, index: int, cause: str, order: Order) -> None:
        """Kill a worker, start its successor and ask it for the same batches."""
        self.workers[index].kill()
        if order.stop():  # the signal that stops the run may have ended the worker too
            raise Interrupted
        limit = self.config.restarts
        if self.restarts >= limit:
            raise CollectionError(
                f"collector worker {index} {cause}; collector.restarts={limit} allows no more restarts"
            )
        self.restarts += 1
        again = f"it is replaced and its batch is collected again ({self.restarts} of at most {limit} times)"
        print(f"warning: collector worker {index} {cause}; {again}", file=sys.stderr, flush=True)
        self.workers[index] = self._start(self.specs[index], order.episodes)
        self._request(index, order, sorted(self.asked))


class WorkerHost(Protocol, Generic[W]):
    """Starts workers, and waits for them.

    weights: a reference to the weights for the next requests. buffers: how many batches are in use at a time.
    """

    @property
    def weights(self) -> Any: ...

    @property
    def buffers(self) -> int: ...

    def publish(self) -> None:
        """The policy's weights have changed."""

    def start(self, spec: WorkerSpec, episodes: Episodes | None, buffers: Sequence[TensorDictBase]) -> W:
        """Return a new worker, whose batches are written to `buffers` if it can.

        episodes: of its worlds, to continue.
        """

    def wait(self, workers: Sequence[W], seconds: float) -> list[W]:
        """Return the workers that have answered, ended or become silent, after at most `seconds`."""

    def moved(self, workers: Sequence[W]) -> list[int]:
        """Return the indices of workers that are to be started again because there is a better place for them."""

    def allocate(self, batch: TensorDictBase) -> TensorDictBase:
        """Return a buffer for batches, with the contents of the first one."""

    def status(self, workers: Sequence[W], restarts: int, age: int) -> dict[str, str]:
        """Return the state of the workers, for display: values by their labels.

        age: of the latest batch, in iterations.
        """

    def close(self) -> None:
        """Release the host's resources. The workers have been killed."""


class ProcessHost:
    """Starts workers as processes of this machine.

    Args:
        make_env: builds a worker's environment; picklable.
        policy: on the CPU; `publish` copies its weights.
        ahead: how many batches workers collect ahead of the one that the pool waits for.

    Attributes:
        weights: the number of the copy that has the latest weights. A copy is overwritten once all batches that were
            asked for with it have been received.
        buffers: how many batches are in use at a time: the one that is learned from, and those ahead.
    """

    def __init__(self, make_env: MakeEnv, policy: Policy | ExpertMixture, ahead: int) -> None:
        self.make_env, self.policy = make_env, policy
        self.policies = [copy.deepcopy(policy).share_memory() for _ in range(1 + ahead)]
        self.weights, self.buffers = 0, 1 + ahead

    def publish(self) -> None:
        """Copy the policy's weights to the copy that has been in use for longest."""
        self.weights = (self.weights + 1) % len(self.policies)
        self.policies[self.weights].load_state_dict(self.policy.state_dict())

    def start(self, spec: WorkerSpec, episodes: Episodes | None, buffers: Sequence[TensorDictBase]) -> WorkerProcess:
        """Return a new process."""
        return WorkerProcess(self.make_env, self.policies, spec, episodes=episodes, buffers=buffers)

    def wait(self, workers: Sequence[WorkerProcess], seconds: float) -> list[WorkerProcess]:
        """Return the workers that have answered or ended, after at most `seconds`."""
        waited: dict[Any, WorkerProcess] = {worker.connection: worker for worker in workers}
        return [waited[connection] for connection in wait(list(waited), seconds)]

    def moved(self, workers: Sequence[WorkerProcess]) -> list[int]:
        """None: there is one machine."""
        return []

    def allocate(self, batch: TensorDictBase) -> TensorDictBase:
        """Return the batch in shared memory."""
        return batch.share_memory_()

    def status(self, workers: Sequence[WorkerProcess], restarts: int, age: int) -> dict[str, str]:
        """Nothing: the progress bar is for the results."""
        return {}

    def close(self) -> None:
        """Nothing: the pool has ended the processes."""


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
        """Return the returns and lengths of the running episodes, as plain values."""
        return {"running": None if self._running is None else self._running.tolist()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue the episodes of a `state_dict`."""
        self._running = None if state["running"] is None else np.array(state["running"])

    def measure(self, batch: TensorDictBase) -> dict[str, float]:
        """Return means over the episodes that end in a batch (worlds, steps), and over all steps for the reward terms.

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
        """Return returns and lengths (2, ended) of the episodes that ended, in the order of the steps.

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
