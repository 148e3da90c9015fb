"""The settings of the collection of batches, in processes of this machine or on a Ray cluster. Imports no torch."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

from conf.schema import Checked, ConfigError, did_you_mean, one_of, read, within


@dataclass(frozen=True)
class CollectorConfig(Checked):
    """Collection in workers, wherever they run."""

    name: str = one_of("local", "ray")
    workers: int = within(0, 256)  # processes; 0 = one per core if worlds divide evenly, 1 = only the main process
    worlds: int = within(1, 4096)  # over all workers
    # Seconds to wait for a batch of a worker process; None = twice the slowest of the latest batches, plus 4 s.
    timeout: float | None = within(0.1)
    restarts: int = within(0)  # worker processes that are replaced in a run, before it gives up

    @property
    def batches_ahead(self) -> int:
        """How many batches workers collect ahead of the one that the pool waits for."""
        return 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.workers and self.worlds % self.workers:
            raise ConfigError(f"worlds={self.worlds} cannot be shared evenly by collector.workers={self.workers}")


@dataclass(frozen=True, kw_only=True)
class LocalCollectorConfig(CollectorConfig):
    """Collection in processes of this machine."""

    overlap: bool  # worker processes collect the next batch during an update, with the weights from before it

    @property
    def batches_ahead(self) -> int:
        return int(self.overlap)


@dataclass(frozen=True, kw_only=True)
class RayCollectorConfig(CollectorConfig):
    """Collection in actors of a Ray cluster."""

    address: str | None  # HOST:PORT; None = RAY_ADDRESS, or a cluster of this machine; without one a Ray is started
    dashboard: bool  # of a Ray that is started
    cpus: float = within(0.001, 1024.0)  # cores that an actor reserves
    mode: str = one_of("sync", "async")
    ahead: int = within(1, 16)  # batches that async collects ahead

    @property
    def batches_ahead(self) -> int:
        return self.ahead if self.mode == "async" else 0


CLASSES: dict[str, type[CollectorConfig]] = {"local": LocalCollectorConfig, "ray": RayCollectorConfig}


def read_collector(node: Any) -> CollectorConfig:
    """The key collector of a composed config. Raises ConfigError."""
    name = node.get("name") if hasattr(node, "get") else node
    if name not in CLASSES:
        raise ConfigError(f"collector.name={name} is not known" + did_you_mean(str(name), CLASSES))
    return read(CLASSES[name], node, "collector")


def workers(config: CollectorConfig, runs: int = 1) -> int:
    """How many processes collect, each an equal share of the worlds. runs: number of runs that share the cores."""
    return config.workers or most_workers(config, cores() // runs)


def uses_processes(config: CollectorConfig) -> bool:
    """Whether processes of this machine collect, beside the main one."""
    return not isinstance(config, RayCollectorConfig) and workers(config) > 1


def most_workers(config: CollectorConfig, most: int) -> int:
    """The largest number of workers, up to `most`, that share the worlds evenly; at least 1."""
    return next(count for count in range(max(1, most), 0, -1) if config.worlds % count == 0)


def cores() -> int:
    """CPU cores this process may use, at least 1."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
