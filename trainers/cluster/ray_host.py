"""The host of workers in Ray actors: it starts them, spreads them over the nodes, and monitors them."""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Sequence
from typing import Any

from tensordict import TensorDictBase

from trainers.cluster.ray_session import RaySession
from trainers.cluster.ray_worker import HEARTBEAT, CollectorActor, RayWorker, to_arrays
from trainers.cluster.versions import versions
from trainers.collector_config import RayCollectorConfig, most_workers
from trainers.models.expert_mixture import ExpertMixture
from trainers.models.policy import Policy
from trainers.rollout.episode_log import Episodes
from trainers.rollout.worker import MakeEnv, WorkerSpec

NODE_SECONDS = 1.0  # between two looks at the nodes
SUSPECT_SECONDS = 30.0  # for which no worker is started on a node where one was silent
RATE_BATCHES = 8  # latest batches of a node, over which its frames per second are measured


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
        """A new actor, or the one that was prepared for this worker."""
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
        """The workers whose next batch has arrived, that have died or are silent, after at most `seconds`."""
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
        """The indices of workers for which an actor has started on a node with more free cores."""
        if time.monotonic() - self.looked_at > NODE_SECONDS:
            self._look(workers)
        return [index for index, (worker, _) in self.prepared.items() if worker.started()]

    def allocate(self, batch: TensorDictBase) -> TensorDictBase:
        """The batch itself."""
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
        """Where a worker is started, as options of an actor: on all nodes evenly.

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
