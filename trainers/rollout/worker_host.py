"""The interface of a pool to the place where its workers run: processes of this machine, or actors of a cluster."""

from __future__ import annotations

import io
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import torch
from tensordict import TensorDict, TensorDictBase

from trainers.rollout.episode_log import Beginning, Episodes
from trainers.rollout.worker import WorkerSpec

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
