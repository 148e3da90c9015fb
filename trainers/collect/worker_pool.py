"""The interface of a pool to the place where its workers run: processes of this machine, or actors of a cluster."""

from __future__ import annotations

import io
import sys
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Generic, Protocol, TypeVar

import torch
from tensordict import TensorDict, TensorDictBase

from core.errors import Interrupted, RunError
from trainers.collect.worker import Beginning, Episodes, WorkerSpec
from trainers.config import CollectorConfig

START_SECONDS = 120.0  # to start a worker, to build its worlds and to replay their episodes


class WorkerLostError(Exception):
    """A worker has ended, raised an exception or does not answer. The text says which.

    frame: the input of the environment's step that raised, if its exception has a `frame`.
    """

    frame: TensorDictBase | None = None


def raised(error: BaseException) -> str:
    """An exception as a clause: "raised ValueError: <the first line of its text>"."""
    return f"raised {type(error).__name__}: {(str(error).splitlines() or [''])[0]}"


@dataclass(frozen=True)
class Failure:
    """The answer of a worker that raised an exception: its text, and its `frame` if it has one.

    frame: written by `torch.save`. Tensors that are sent as they are cannot be read once their process has ended.
    """

    text: str
    frame: bytes | None

    @classmethod
    def of(cls, error: Exception) -> Failure:
        """Of an exception that a worker raised."""
        frame = getattr(error, "frame", None)
        if frame is None:
            return cls(raised(error), None)
        torch.save(frame.to_dict(), file := io.BytesIO())
        return cls(raised(error), file.getvalue())

    def error(self) -> WorkerLostError:
        """The error to raise in the main process."""
        error = WorkerLostError(self.text)
        if self.frame is not None:
            error.frame = TensorDict.from_dict(torch.load(io.BytesIO(self.frame), weights_only=True))
        return error


class RemoteWorker(Protocol):
    """A worker outside of this process. Requests are answered in their order.

    answered: whether a batch was received; until then it may still be starting. collect_seconds: seconds that it took
    to collect the batch received last.
    """

    spec: WorkerSpec
    answered: bool
    collect_seconds: float

    def request(self, iteration: int, weights: Any) -> None:
        """Ask for the batch of this iteration with these weights of the host. Raises WorkerLostError."""

    def use_buffers(self, buffers: Sequence[TensorDictBase]) -> None:
        """Have the batches that are requested from now on written to these buffers in turn, if the worker can.

        Raises WorkerLostError.
        """

    def receive(self) -> tuple[TensorDictBase | None, Mapping[int, Beginning]]:
        """The batch, None if it is in its buffer, and the beginnings from `Worker.collect`. Raises WorkerLostError."""

    def overdue(self, patience: float, waiting_since: float) -> bool:
        """Whether it has not answered for `patience` seconds, or more if it is starting.

        waiting_since: as `time.monotonic` has it. The seconds count from then, or from a later request.
        """

    def kill(self) -> None:
        """End it, whatever it is doing."""


class RequestClock:
    """The part of a `RemoteWorker` that is the same on any machine: since when its answer is waited for.

    requested_at: when a batch was asked for last, as `time.monotonic` has it; 0 before.
    """

    def __init__(self) -> None:
        self.answered = False
        self.requested_at = self.collect_seconds = 0.0

    def overdue(self, patience: float, waiting_since: float) -> bool:
        """As `RemoteWorker.overdue`."""
        limit = patience + (0.0 if self.answered else START_SECONDS)
        return time.monotonic() - max(waiting_since, self.requested_at) > limit


W = TypeVar("W", bound=RemoteWorker)


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
        """A new worker, whose batches are written to `buffers` if it can. episodes: of its worlds, to continue."""

    def wait(self, workers: Sequence[W], seconds: float) -> list[W]:
        """The workers that have answered, ended or become silent, after at most `seconds`."""

    def moved(self, workers: Sequence[W]) -> list[int]:
        """The indices of workers that are to be started again because there is a better place for them."""

    def allocate(self, batch: TensorDictBase) -> TensorDictBase:
        """A buffer for batches, with the contents of the first one."""

    def status(self, workers: Sequence[W], restarts: int, age: int) -> dict[str, str]:
        """The state of the workers, for display: values by their labels. age: of the latest batch, in iterations."""

    def close(self) -> None:
        """Release the host's resources. The workers have been killed."""


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
