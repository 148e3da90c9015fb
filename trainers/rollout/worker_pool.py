"""Workers that collect together, in processes or on a cluster.

A worker that is lost or stuck is replaced, and its part of the batch is collected again, with the same bits.
"""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import torch
from tensordict import TensorDictBase

from conf.schema import RunError
from trainers.collector_config import CollectorConfig
from trainers.rollout.episode_log import Beginning, Episodes
from trainers.rollout.evaluation import Interrupted
from trainers.rollout.worker import WorkerSpec
from trainers.rollout.worker_host import START_SECONDS, RemoteWorker, WorkerHost, WorkerLostError

POLL_SECONDS = 0.2  # between two looks at the signals and the deadlines
MARGIN_SECONDS = 4.0  # added to twice the slowest of the latest batches
RECENT_BATCHES = 50


class CollectionError(RunError):
    """A batch could not be collected. The run cannot continue."""


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
        self.host, self.specs, self.config = host, specs, config
        self.buffers: list[TensorDictBase] = []  # used in turns; none before the first batch
        self.durations: deque[float] = deque(maxlen=RECENT_BATCHES * len(specs))
        self.patience_factor = 1.0
        self.restarts = 0
        self.age = 0  # of the latest batch: how many iterations old its weights were
        # Iteration -> the weights with which its batch was requested, and their iteration.
        self.asked: dict[int, tuple[Any, int]] = {}
        self.workers = [self._start(spec, episodes) for spec in specs]

    def collect(self, order: Order) -> tuple[TensorDictBase, dict[int, Beginning]]:
        """The batch, whose memory the next one reuses, and the beginnings of its new episodes, by world.

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
        for iteration in range(order.iteration, order.iteration + self.config.batches_ahead + 1):
            if iteration not in self.asked and self.specs[0].steps(iteration):
                self.ask(replace(order, iteration=iteration), order.iteration)

    def _ready(self, indices: set[int]) -> list[int]:
        """The workers that have answered or ended, after at most POLL_SECONDS."""
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
        if not self.durations:
            return START_SECONDS
        return self.patience_factor * (2 * max(self.durations) + MARGIN_SECONDS)

    def _whole(self, iteration: int, parts: Sequence[TensorDictBase | None]) -> TensorDictBase:
        """The batch of all workers, in a buffer. The first batch allocates the buffers."""
        if not self.buffers:
            whole = torch.cat([part for part in parts if part is not None])
            self.buffers = [self.host.allocate(whole.clone()) for _ in range(self.host.buffers)]
            for index, worker in enumerate(self.workers):
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
