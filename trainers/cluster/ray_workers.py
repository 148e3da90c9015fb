"""Collection on a Ray cluster: workers in actors, which may be on any node and can be lost at any time."""

from __future__ import annotations

import os
import time
import warnings
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase

from core.errors import ConfigError
from trainers.cluster.ray_session import RaySession, difference, versions
from trainers.collect.worker import (
    Beginning,
    Episodes,
    Failure,
    MakeEnv,
    RequestClock,
    Worker,
    WorkerLostError,
    WorkerSpec,
)
from trainers.config import RayCollectorConfig, most_workers
from trainers.models.policy import ExpertMixture, Policy

HEARTBEAT = "heartbeat"  # concurrency group: its thread answers while another one collects
BEAT_SECONDS = 1.0  # between two questions
SILENCE_SECONDS = 6.0  # without an answer, after which an actor counts as lost

Arrays = Mapping[Any, NDArray[Any]]  # a nested key or a parameter's name -> its values


NODE_SECONDS = 1.0  # between two looks at the nodes
SUSPECT_SECONDS = 30.0  # for which no worker is started on a node where one was silent
RATE_BATCHES = 8  # latest batches of a node, over which its frames per second are measured


def to_arrays(values: Mapping[str, torch.Tensor]) -> Arrays:
    """Return the tensors as arrays, which Ray's object store shares without copies."""
    return {name: value.detach().cpu().numpy() for name, value in values.items()}


def to_tensor(array: NDArray[Any]) -> torch.Tensor:
    """Return a tensor that shares the memory of an array, which may be read-only: it must not be written to."""
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
        """Return the id of the node, and that of this process. It is answered once the actor has started."""
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
        """Return the batch, in read-only memory, and the beginnings that `Worker.collect` returns.

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
        """Return whether the next batch, or the exception in its place, is there."""
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
        """Return whether the actor's process runs."""
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
    """Return the cause in a Ray error of many lines, as one clause."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    told = next((line for line in lines if "because" in line), lines[0] if lines else type(error).__name__)
    clause = told.partition("because ")[2] or told
    return clause.partition(" Worker exit type")[0].partition(". ")[0].rstrip(".")


class RayHost:
    """Starts workers as actors of a Ray cluster.

    Args:
        make_env: builds a worker's environment; picklable.
        policy: on the CPU; `publish` sends its weights.
        config: the cluster, and how many cores an actor reserves.

    Attributes:
        count: number of workers.
        buffers: 1: a batch is copied while the pool waits for it.

    Raises:
        ConfigError: there is no such cluster, it has too few cores, or a node has other versions.
    """

    buffers = 1

    def __init__(self, make_env: MakeEnv, policy: Policy | ExpertMixture, config: RayCollectorConfig) -> None:
        self.policy, self.config = policy, config
        self.session = RaySession(config.address, config.dashboard)
        try:
            self.count = config.workers or most_workers(config, int(self.session.free_cpus / config.cpus))
            self.session.check_cpus("collector.workers", self.count, config.cpus)
            self.session.check_nodes()
        except BaseException:
            self.session.close()
            raise
        ray = self.session.ray
        self.actor_class = ray.remote(concurrency_groups={HEARTBEAT: 1})(CollectorActor)
        self.shared = [ray.put(each) for each in (versions(), make_env, policy)]
        self.weights: Any = None
        self.publish()
        self.starts: Counter[int] = Counter()  # of each worker
        self.prepared: dict[int, tuple[RayWorker, str]] = {}  # workers that start on a better node, and its id
        self.latest: dict[int, RayWorker] = {}  # by its number
        self.suspects: dict[str, float] = {}  # node id -> when a worker there was given up
        self.nodes = self.session.nodes
        self.looked_at = time.monotonic()
        self.received: dict[str, deque[tuple[float, int]]] = {}  # node id -> when, and frames, of its latest batches

    def publish(self) -> None:
        """Put the policy's weights into the object store, from where each node reads them once."""
        self.weights = self.session.ray.put(to_arrays(self.policy.state_dict()))

    def start(self, spec: WorkerSpec, episodes: Episodes | None, buffers: Sequence[TensorDictBase]) -> RayWorker:
        """Return a new actor, or the one that was prepared for this worker."""
        before = self.latest.get(spec.index)
        if before is not None and before.unresponsive and before.node_id is not None:
            self.suspects[before.node_id] = time.monotonic()
        if spec.index in self.prepared:
            worker, _ = self.prepared.pop(spec.index)
        else:
            worker = self._start(spec, self._place())
        worker.begin(episodes)
        self.latest[spec.index] = worker
        return worker

    def wait(self, workers: Sequence[RayWorker], seconds: float) -> list[RayWorker]:
        """Return the workers whose next batch has arrived, that have died or are silent, after at most `seconds`."""
        waited = {worker.answers[0]: worker for worker in workers}
        ready, _ = self.session.ray.wait(list(waited), num_returns=1, timeout=seconds)
        if ready:
            ready, _ = self.session.ray.wait(list(waited), num_returns=len(waited), timeout=0)
        found = [waited[reference] for reference in ready]
        for worker in workers:
            if not worker.listen() and worker not in found:
                found.append(worker)
        for worker in found:
            self._count(worker)
        return found

    def moved(self, workers: Sequence[RayWorker]) -> list[int]:
        """Return the indices of workers for which an actor has started on a node with more free cores."""
        if time.monotonic() - self.looked_at > NODE_SECONDS:
            self._look(workers)
        return [index for index, (worker, _) in self.prepared.items() if worker.started()]

    def allocate(self, batch: TensorDictBase) -> TensorDictBase:
        """Return the batch itself."""
        return batch

    def close(self) -> None:
        """Leave the cluster."""
        for worker, _ in self.prepared.values():
            worker.kill()
        self.session.close()

    def status(self, workers: Sequence[RayWorker], restarts: int, age: int) -> dict[str, str]:
        """Workers alive, restarts, age of the batch and frames per second of each node, for display."""
        alive = sum(worker.node_id is not None for worker in workers)
        values = {"workers": f"{alive}/{len(workers)}", "restarts": str(restarts), "age": str(age)}
        addresses = {node.id: node.address for node in self.nodes}
        for node_id, batches in self.received.items():
            if len(batches) > 1 and node_id in addresses:
                seconds = max(batches[-1][0] - batches[0][0], 1e-9)
                values[addresses[node_id]] = f"{sum(frames for _, frames in list(batches)[1:]) / seconds:.0f}/s"
        return values

    def _start(self, spec: WorkerSpec, place: dict[str, Any]) -> RayWorker:
        self.starts[spec.index] += 1
        name = f"deixis worker {spec.index}" + f", start {self.starts[spec.index]}" * (self.starts[spec.index] > 1)
        actor = self.actor_class.options(name=name, **place).remote(*self.shared, spec)
        return RayWorker(self.session, actor, spec)

    def _place(self) -> dict[str, Any]:
        """Return where a worker is started, as options of an actor: on all nodes evenly.

        After a loss, a worker starts on the remaining nodes: not on a node where a worker was silent, which Ray may
        still count as alive, and without reserved cores if there are too few.
        """
        place: dict[str, Any] = {"num_cpus": self.config.cpus, "scheduling_strategy": "SPREAD"}
        suspects = self._present_suspects()
        sound = [node for node in self.session.nodes if node.id not in suspects]
        if sound and sum(node.cpus for node in sound) < self.count * self.config.cpus - 1e-6:
            place["num_cpus"] = 0
        if sound and suspects:
            node = max(sound, key=lambda node: node.cpus)
            place = {"num_cpus": 0, "scheduling_strategy": self.session.on(node, soft=True)}
        return place

    def _present_suspects(self) -> set[str]:
        return {node for node, at in self.suspects.items() if time.monotonic() - at < SUSPECT_SECONDS}

    def _look(self, workers: Sequence[RayWorker]) -> None:
        """Start an actor on each node with idle cores for a worker of a node with more workers than cores."""
        self.looked_at, self.nodes = time.monotonic(), self.session.nodes
        for index in [i for i, (_, node_id) in self.prepared.items() if node_id not in {n.id for n in self.nodes}]:
            self.prepared.pop(index)[0].kill()
        homes = {worker.spec.index: worker.node_id for worker in workers}
        homes |= {index: node_id for index, (_, node_id) in self.prepared.items()}
        by_node = {node.id: [index for index, home in homes.items() if home == node.id] for node in self.nodes}
        crowded = [index for node in self.nodes for index in by_node[node.id][max(1, int(node.cpus)) :]]
        suspects = self._present_suspects()
        for node in [each for each in self.nodes if each.id not in suspects]:
            for _ in range(int(node.cpus) - len(by_node[node.id])):
                if crowded and crowded[-1] not in self.prepared:
                    index = crowded.pop()
                    place = {"num_cpus": self.config.cpus, "scheduling_strategy": self.session.on(node)}
                    self.prepared[index] = self._start(workers[index].spec, place), node.id

    def _count(self, worker: RayWorker) -> None:
        if worker.node_id is not None:
            batches = self.received.setdefault(worker.node_id, deque(maxlen=RATE_BATCHES * self.count))
            batches.append((time.monotonic(), worker.spec.worlds * worker.spec.horizon))
