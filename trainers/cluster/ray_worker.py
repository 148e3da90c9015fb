"""A worker in a Ray actor, which may be on any node of the cluster and can be lost at any time."""

from __future__ import annotations

import os
import time
import warnings
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase

from conf.schema import ConfigError
from trainers.cluster.ray_session import RaySession
from trainers.cluster.versions import difference, versions
from trainers.models.expert_mixture import ExpertMixture
from trainers.models.policy import Policy
from trainers.rollout.episode_log import Beginning, Episodes
from trainers.rollout.worker import MakeEnv, Worker, WorkerSpec
from trainers.rollout.worker_host import Failure, RequestClock, WorkerLostError

HEARTBEAT = "heartbeat"  # concurrency group: its thread answers while another one collects
BEAT_SECONDS = 1.0  # between two questions
SILENCE_SECONDS = 6.0  # without an answer, after which an actor counts as lost

Arrays = Mapping[Any, NDArray[Any]]  # a nested key or a parameter's name -> its values


def to_arrays(values: Mapping[str, torch.Tensor]) -> Arrays:
    """The tensors as arrays, which Ray's object store shares without copies."""
    return {name: value.detach().cpu().numpy() for name, value in values.items()}


def to_tensor(array: NDArray[Any]) -> torch.Tensor:
    """A tensor that shares the memory of an array, which may be read-only: it must not be written to."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return torch.from_numpy(array)


class CollectorActor:
    """The worker in a Ray actor. It is built at the first request of a batch, or before.

    Args:
        own: versions of the process that reads the batches.
        make_env: builds the worker's environment.
        policy: the whole policy; its weights come with each request.
        spec: which worker it is.
    """

    def __init__(
        self, own: Mapping[str, str], make_env: MakeEnv, policy: Policy | ExpertMixture, spec: WorkerSpec
    ) -> None:
        self.difference = difference(own, versions())
        self.make_env, self.policy, self.spec = make_env, policy, spec
        self.worker: Worker | None = None
        self.error: Exception | None = None

    def where(self) -> tuple[str, int]:
        """The id of the node, and that of this process. It is answered once the actor has started."""
        import ray

        return ray.get_runtime_context().get_node_id(), os.getpid()

    def beat(self) -> None:
        """Answered by a thread of its own, as long as the process runs."""

    def begin(self, episodes: Episodes | None) -> None:
        """Build the worlds. The next request of a batch reports an exception, if one was raised."""
        try:
            torch.set_num_threads(1)
            if self.difference:
                raise ConfigError(f"the node differs from the main process's: {self.difference}")
            self.worker = Worker(self.make_env, self.policy.act, self.spec, episodes)
        except Exception as error:
            self.error = error

    def collect(self, iteration: int, weights: Arrays) -> tuple[Arrays, dict[int, Beginning], float] | Failure:
        """As `Worker.collect` with these weights, the batch as arrays by their keys; and the seconds that it took.

        Raises ConfigError.
        """
        start = time.monotonic()
        torch.set_num_threads(1)  # a setting of each thread
        try:
            if self.error is not None:
                raise self.error
            assert self.worker is not None
            self.policy.load_state_dict({name: to_tensor(value) for name, value in weights.items()})
            batch, beginnings = self.worker.collect(iteration)
        except ConfigError:
            raise
        except Exception as error:
            self.error = error
            return Failure.of(error)
        return to_arrays(dict(batch.items(include_nested=True, leaves_only=True))), beginnings, time.monotonic() - start


class RayWorker(RequestClock):
    """The main process's side of an actor: a `RemoteWorker`.

    Args:
        session: of the cluster.
        actor: of a `CollectorActor`, which may still be starting.
        spec: which worker it is.
    """

    def __init__(self, session: RaySession, actor: Any, spec: WorkerSpec) -> None:
        super().__init__()
        self.ray, self.actor, self.spec = session.ray, actor, spec
        self.answers: deque[Any] = deque()  # references to the batches that were asked for, the next one first
        self.node_id: str | None = None  # None while it is starting
        self.pid: int | None = None
        self.place = actor.where.remote()
        self.beat: Any = None
        self.beat_at = 0.0
        self.silence = 0.0  # seconds since an unanswered question
        self.unresponsive = False  # whether it was given up although Ray counts it as alive

    def begin(self, episodes: Episodes | None) -> None:
        """Have the worlds built, and these episodes continued."""
        self.actor.begin.remote(episodes)

    def request(self, iteration: int, weights: Any) -> None:
        """Ask for the batch of this iteration. weights: a reference to those of the policy."""
        self.requested_at = time.monotonic()
        self.answers.append(self.actor.collect.remote(iteration, weights))

    def use_buffers(self, buffers: Sequence[TensorDictBase]) -> None:
        """Nothing: batches come through the object store."""

    def receive(self) -> tuple[TensorDictBase, Mapping[int, Beginning]]:
        """The batch, in read-only memory, and the beginnings that `Worker.collect` returns.

        Raises:
            WorkerLostError: the actor has died, is silent or has raised an exception.
            ConfigError: it refused its environment's configuration.
        """
        if not self.ready() and self.silence:
            raise WorkerLostError(f"gave no sign of life for {self.silence:.1f} s")
        try:
            answer = self.ray.get(self.answers[0])
        except self.ray.exceptions.RayError as error:
            cause = getattr(error, "cause", None)
            if isinstance(cause, ConfigError):
                raise ConfigError(f"{cause} (on a node of the cluster)") from None
            raise WorkerLostError(f"was lost: {_reason(error)}") from None
        if isinstance(answer, Failure):
            raise answer.error()
        arrays, beginnings, self.collect_seconds = answer
        self.answers.popleft()
        self.answered = True
        values = {key: to_tensor(array) for key, array in arrays.items()}
        return TensorDict(values, values["action"].shape[:2]), beginnings

    def ready(self) -> bool:
        """Whether the next batch, or the exception in its place, is there."""
        return bool(self.ray.wait([self.answers[0]], timeout=0)[0])

    def listen(self) -> bool:
        """Ask whether the actor lives. Returns False once it has been silent for too long."""
        now = time.monotonic()
        if self.node_id is None:
            self._find_place()
            return True
        if self.beat is None and now - self.beat_at >= BEAT_SECONDS:
            self.beat, self.beat_at = self.actor.beat.options(concurrency_group=HEARTBEAT).remote(), now
        elif self.beat is not None and self.ray.wait([self.beat], timeout=0)[0]:
            self.beat = None  # an answer, or an error that the batch has, too
        self.silence = now - self.beat_at if self.beat is not None and now - self.beat_at > SILENCE_SECONDS else 0.0
        self.unresponsive = self.unresponsive or bool(self.silence)
        return not self.silence

    def overdue(self, patience: float, waiting_since: float) -> bool:
        overdue = super().overdue(patience, waiting_since)
        self.unresponsive = self.unresponsive or overdue
        return overdue

    def kill(self) -> None:
        """End the actor, whatever it is doing. It is not started again."""
        self.ray.kill(self.actor, no_restart=True)
        self.answers.clear()

    def started(self) -> bool:
        """Whether the actor's process runs."""
        if self.node_id is None:
            self._find_place()
        return self.node_id is not None

    def _find_place(self) -> None:
        try:
            if self.ray.wait([self.place], timeout=0)[0]:
                self.node_id, self.pid = self.ray.get(self.place)
        except self.ray.exceptions.RayError:
            pass  # the request of a batch reports why


def _reason(error: Exception) -> str:
    """The cause in a Ray error of many lines, as one clause."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    told = next((line for line in lines if "because" in line), lines[0] if lines else type(error).__name__)
    clause = told.partition("because ")[2] or told
    return clause.partition(" Worker exit type")[0].partition(". ")[0].rstrip(".")
