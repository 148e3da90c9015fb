"""The learner's ceiling: how many workers one main process can read, with batches of real sizes and no physics."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

import torch

from benchmarks.cluster import RowResult, row
from core.overrides import compose
from envs.config import read_env
from language import Tokenizer
from train import build_env
from trainers.algorithms.algorithm import build_algorithm
from trainers.cluster.ray_workers import HEARTBEAT, RayHost, RayWorker, to_arrays
from trainers.collect.rollouts import Order, WorkerPool
from trainers.collect.worker import Worker, WorkerSpec
from trainers.config import RayCollectorConfig, read_training

ROOT = Path(__file__).parents[2]
PLOT = "docs/cluster_ceiling.png"
COUNTS = (1, 2, 4, 8, 16, 32, 64, 128, 256)
WORLDS, HORIZON = 16, 64  # of each worker: 1,024 frames
FRAMES_PER_S = 1500.0  # of a worker's physics and policy on one core
BATCHES = 6
TIMEOUT = 60.0  # seconds: a busy machine is no reason to ask again for a batch
UPDATE_FRAMES = 4096  # of the batch that an update is timed with
PROCESSES = 2  # actors, which the workers share: a process for each of them would not fit into memory


class ReplayedActor:
    """Actor of many workers: each request sleeps as long as physics would take, and returns a recorded batch."""

    def __init__(self, recorded: Mapping[Any, Any], beginnings: dict[int, Any]) -> None:
        self.recorded, self.beginnings = recorded, beginnings
        self.seconds = WORLDS * HORIZON / FRAMES_PER_S
        self.busy = [threading.Lock() for _ in range(max(COUNTS))]  # of each worker, which does one thing at a time

    def where(self) -> tuple[str, int]:
        """Do what `CollectorActor.where` does."""
        import os

        import ray

        return ray.get_runtime_context().get_node_id(), os.getpid()

    def beat(self) -> None:
        """Do what `CollectorActor.beat` does."""

    def collect(self, worker: int, weights: Any) -> tuple[Mapping[Any, Any], dict[int, Any], float]:
        """Do what `CollectorActor.collect` does, with the recorded batch."""
        with self.busy[worker]:
            time.sleep(self.seconds)
        return self.recorded, self.beginnings, self.seconds


class ReplayedWorker(RayWorker):
    """A worker whose actor is shared: killing the worker does not end the actor."""

    def begin(self, episodes: Any) -> None:
        """Do nothing: there are no worlds."""

    def request(self, iteration: int, weights: Any) -> None:
        """Ask for a batch."""
        super().request(self.spec.index, weights)

    def kill(self) -> None:
        """Do nothing."""


class ReplayHost(RayHost):
    """Workers that replay a recorded batch."""

    def share(self, recorded: Mapping[Any, Any], beginnings: dict[int, Any]) -> None:
        """Start the actors."""
        ray = self.session.ray
        made = ray.remote(concurrency_groups={HEARTBEAT: 1}, max_concurrency=2 * max(COUNTS))(ReplayedActor)
        self.actors = [made.options(num_cpus=0).remote(recorded, beginnings) for _ in range(PROCESSES)]

    def start(self, spec: WorkerSpec, episodes: Any, buffer: Any) -> RayWorker:
        """Return a worker of a shared actor."""
        return ReplayedWorker(self.session, self.actors[spec.index % PROCESSES], spec)

    def moved(self, workers: Any) -> list[int]:
        """Return no worker: none moves."""
        return []


@dataclass(frozen=True)
class CeilingPoint:
    """The measurement with one number of workers. cpu_share: cores that the main process kept busy."""

    workers: int
    frames_per_s: float
    cpu_share: float

    @property
    def efficiency(self) -> float:
        """The share of the frames that the workers alone would deliver."""
        return self.frames_per_s / (self.workers * FRAMES_PER_S)

    def __str__(self) -> str:
        return f"{self.frames_per_s:.0f} ({self.efficiency:.2f}, {self.cpu_share:.2f})"


@row("ceiling", f"frames/s of 1 to 256 simulated workers, sync and async, and of an update; draws {PLOT}", 9)
def ceiling(tries: int, random: Random, folder: Path) -> RowResult:
    """Measure the first `tries` of the counts 1, 2, 4, ... 256, and draw the plot if these are all."""
    outcome = RowResult()
    config = compose(["collector=ray", f"collector.worlds={UPDATE_FRAMES // HORIZON}", "collector.cpus=0.001"])
    training, make = read_training(config), partial(build_env, read_env(config))
    env = make(WORLDS, 0)
    words = list(Tokenizer.default().vocabulary)
    policy, algorithm = build_algorithm(training, env.observation_spec, env.action_unit, words, env.hindsight)
    batch, beginnings = Worker(make, policy.act, WorkerSpec(0, WORLDS, HORIZON, 0)).collect(0)
    outcome.figures["bytes of a frame"] = batch.bytes() // batch.numel()
    recorded = to_arrays(dict(batch.items(include_nested=True, leaves_only=True)))
    algorithm.add_scenes(env.draw_scenes(algorithm.scenes_per_update, 0))
    whole = torch.cat([batch] * (UPDATE_FRAMES // batch.numel()))
    start, cpu = time.perf_counter(), time.process_time()
    algorithm.update(whole, 0.0)
    outcome.figures["update frames/s"] = round(UPDATE_FRAMES / (time.perf_counter() - start))
    outcome.figures["update frames/CPU s"] = round(UPDATE_FRAMES / (time.process_time() - cpu))
    assert isinstance(training.collector, RayCollectorConfig)
    curves: dict[str, list[CeilingPoint]] = {}
    for mode in ("sync", "async"):
        settings = replace(training.collector, mode=mode, workers=1, worlds=1, timeout=TIMEOUT)
        host = ReplayHost(make, policy, settings)
        host.share(recorded, beginnings)
        curves[mode] = []
        for count in COUNTS[:tries]:
            point = measured(host, replace(settings, workers=count, worlds=count * WORLDS))
            curves[mode].append(point)
            outcome.figures[f"{mode}, {count} workers: frames/s (efficiency, cores of the main process)"] = str(point)
            outcome.count()
        host.session.close()
    if tries == len(COUNTS):
        draw(curves, ROOT / PLOT)
    return outcome


def measured(host: ReplayHost, config: RayCollectorConfig) -> CeilingPoint:
    """Return the throughput of the pool, after the first batches."""
    host.count = config.workers
    specs = [WorkerSpec(i, WORLDS, HORIZON, 0) for i in range(config.workers)]
    pool = WorkerPool(host, specs, config, None)
    for iteration in range(2):
        pool.collect(Order(iteration))
    start, cpu = time.perf_counter(), time.process_time()
    for iteration in range(2, 2 + BATCHES):
        host.publish()
        pool.collect(Order(iteration))
    seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
    for worker in pool.workers:
        assert isinstance(worker, RayWorker)
        host.session.ray.wait(list(worker.answers), num_returns=max(1, len(worker.answers)), timeout=5)
    return CeilingPoint(config.workers, BATCHES * config.workers * WORLDS * HORIZON / seconds, cpu / seconds)


def draw(curves: Mapping[str, Sequence[CeilingPoint]], path: Path) -> None:
    """Return frames/s, efficiency and the main process's cores over the number of workers."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import ScalarFormatter

    figure = Figure(figsize=(11, 3.4), layout="constrained")
    rates, shares, cores = figure.subplots(1, 3, sharex=True)
    rates.plot(COUNTS, [FRAMES_PER_S * count for count in COUNTS], ":", color="grey", label="without any loss")
    for mode, points in curves.items():
        rates.plot(COUNTS, [point.frames_per_s for point in points], "o-", label=mode)
        shares.plot(COUNTS, [point.efficiency for point in points], "o-", label=mode)
        cores.plot(COUNTS, [point.cpu_share for point in points], "o-", label=mode)
    shares.axhline(0.8, linestyle=":", color="grey")
    for axes, title in ((rates, "frames/s"), (shares, "efficiency"), (cores, "cores the main process uses")):
        axes.set_xscale("log", base=2)
        axes.set_xticks(COUNTS)
        axes.xaxis.set_major_formatter(ScalarFormatter())
        axes.set(title=title, xlabel="simulated workers")
        axes.grid(alpha=0.3)
    rates.set_yscale("log")
    shares.set_ylim(0, 1.05)
    cores.set_ylim(0)
    rates.legend()
    figure.savefig(path, dpi=110)
