"""A Ray cluster that is joined or started, and the check that its nodes compute the same as this machine.

Ray is imported here alone.
"""

from __future__ import annotations

import os
import platform
import shutil
import signal
import socket
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from core.errors import ConfigError, RunError
from core.system import cores, package_versions

ROOT = Path(__file__).parents[2]
OWN = ("conf", "core", "envs", "human", "language", "trainers")  # packages of this project
SUFFIXES = (".py", ".yaml")

CURRENT_CLUSTER = Path("/tmp/ray/ray_current_cluster")  # `ray start` writes its address there
CONNECT_SECONDS = 3.0
CHECK_SECONDS = 60.0  # for a node to start a process and to import this project
SHARED_MEMORY = Path("/dev/shm")
STORE_BYTES = (512 * 2**20, 4 * 2**30)  # of a Ray that is started here, at least and at most
LOOPBACK = "127.0.0.1"
# Of a Ray that is started here: a killed actor that does not end by itself holds its cores for this long, and actors
# have the priority of other processes. Ray's default gives them a low one: any other process would stall a run.
SYSTEM_CONFIG = {"kill_worker_timeout_milliseconds": 500, "worker_niceness": 0}


@dataclass(frozen=True)
class Node:
    """A machine of the cluster. cpus: that Ray may give away."""

    id: str
    address: str
    cpus: float


class RaySession:
    """Joins a cluster, or starts a Ray on this machine.

    Args:
        address: HOST:PORT of the cluster's head; None for the one in RAY_ADDRESS, or the cluster that `ray start` has
            started on this machine. Without one, a Ray is started, which ends with this session.
        dashboard: whether a Ray that is started has its dashboard, on loopback.

    Raises:
        ConfigError: Ray is not installed, the cluster is out of reach, or its version differs from this process's.
    """

    def __init__(self, address: str | None = None, dashboard: bool = False) -> None:
        self.ray = import_ray()
        self.folder: Path | None = None  # of a Ray that was started here
        self.joined = self.ray.is_initialized()  # connected elsewhere in this process, and closed there
        if self.joined:
            return
        found = _find_address(address)
        options = {"log_to_driver": False, "logging_level": "error", "configure_logging": True}
        unnamed = address is None and "RAY_ADDRESS" not in os.environ
        with _signal_handlers():
            if found is None or not self._join(found, options, or_none=unnamed):
                self._start(options, dashboard)

    @property
    def nodes(self) -> list[Node]:
        """The nodes that are alive, sorted by their addresses."""
        alive = [node for node in self.ray.nodes() if node["Alive"]]
        found = [Node(node["NodeID"], node["NodeManagerAddress"], node["Resources"].get("CPU", 0.0)) for node in alive]
        return sorted(found, key=lambda node: (node.address, node.id))

    @property
    def cpus(self) -> float:
        """The cores of all nodes, whoever uses them."""
        return sum(node.cpus for node in self.nodes)

    @property
    def free_cpus(self) -> float:
        """The cores that no task or actor has reserved."""
        return float(self.ray.available_resources().get("CPU", 0.0))

    def on(self, node: Node, soft: bool = False) -> Any:
        """Return the scheduling strategy for a task on this node. soft: elsewhere if the node has died."""
        from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

        return NodeAffinitySchedulingStrategy(node.id, soft=soft)

    def check_cpus(self, key: str, count: int, each: float) -> None:
        """Check that the cluster has enough cores for actors or tasks that run at the same time.

        Args:
            key: of `count` in the config.
            count: of actors or tasks.
            each: cores of each.

        Raises:
            ConfigError: it has too few.
        """
        free, wanted = self.free_cpus, count * each
        if wanted <= free + 1e-6:
            return
        fit = int((free + 1e-6) // each)
        raise ConfigError(
            f"{key}={count} at {each:g} cores each need {wanted:g} cores, and the Ray cluster has {free:g} free of "
            f"{self.cpus:g}; add nodes, or give {key}={max(1, fit)}"
            + (f" or collector.cpus={free / count:.2g}" if key.startswith("collector.") and free else "")
        )

    def check_nodes(self) -> None:
        """Raise ConfigError if a node has other versions than this process, or lacks this project."""
        own = versions()
        task = self.ray.remote(num_cpus=0, max_retries=0)(versions)
        asked = {task.options(scheduling_strategy=self.on(node)).remote(): node for node in self.nodes}
        answered, silent = self.ray.wait(list(asked), num_returns=len(asked), timeout=CHECK_SECONDS)
        for reference in answered:
            node = asked[reference]
            try:
                theirs = self.ray.get(reference)
            except self.ray.exceptions.RayError as error:
                reason = str(error).strip().splitlines()[-1].strip()
                raise ConfigError(f"node {node.address} cannot import this project: {reason}") from None
            if text := difference(own, theirs):
                raise ConfigError(f"node {node.address} differs from this machine: {text}; install the same on both")
        for reference in silent:
            raise ConfigError(f"node {asked[reference].address} has not answered for {CHECK_SECONDS:g} s")

    def check_own_node(self) -> None:
        """Raise RunError if the node of this machine is dead: tasks of this process would wait for it forever."""
        own = self.ray.get_runtime_context().get_node_id()
        if any(node["NodeID"] == own and not node["Alive"] for node in self.ray.nodes()):
            raise RunError("Ray has ended on this machine: its raylet or its agent has died")

    def close(self) -> None:
        """Leave the cluster, or end the Ray that was started here and remove its files."""
        if self.joined:
            return
        with _signal_handlers():
            self.ray.shutdown()
        if self.folder is not None:
            shutil.rmtree(self.folder, ignore_errors=True)
            latest = self.folder.with_name("session_latest")
            if latest.is_symlink() and not latest.exists():
                latest.unlink(missing_ok=True)

    def _start(self, options: dict[str, Any], dashboard: bool) -> None:
        with _loopback(self.ray):
            context = self.ray.init(
                address="local",
                num_cpus=cores(),
                include_dashboard=dashboard,
                dashboard_host=LOOPBACK,
                object_store_memory=_store_bytes(),
                _node_ip_address=LOOPBACK,
                _system_config=SYSTEM_CONFIG,
                **options,
            )
        self.folder = Path(context.address_info["session_dir"])

    def _join(self, address: str, options: dict[str, Any], or_none: bool) -> bool:
        """Return whether the cluster was joined. or_none: False is returned where it has ended. Raises ConfigError."""
        try:
            self.ray.init(address=address, **options)
            return True
        except (RuntimeError, ConnectionError, ValueError, TimeoutError) as error:
            self.ray.shutdown()
            if "token" in str(error).lower():
                raise ConfigError(
                    f"collector.address={address} asks for a token: set RAY_AUTH_MODE=token here, and put the head's "
                    "token into ~/.ray/auth_token"
                ) from None
            if or_none and isinstance(error, ConnectionError):
                return False
            reason = " ".join(str(error).split()).partition(". ")[0].rstrip(".")
            raise ConfigError(
                f"collector.address={address} cannot be joined from this machine: {reason}; run "
                f"`ray start --address={address}` here with the Python of this program first"
            ) from None


def import_ray() -> Any:
    """Return the module. No usage statistics are sent. Raises ConfigError if it is not installed."""
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")  # its future default; silences a warning
    try:
        import ray
    except ImportError:
        raise ConfigError('a cluster needs ray, which is not installed: pip install -e ".[cluster]"') from None
    return ray


def versions() -> dict[str, str]:
    """By name: Python's and the libraries' versions, and for Deixis a checksum of its sources."""
    found = {"Deixis": f"sources {_checksum():08x}", "Python": ".".join(platform.python_version_tuple()[:2])}
    return found | {name: version.partition("+")[0] for name, version in package_versions().items()}


def difference(own: Mapping[str, str], theirs: Mapping[str, str]) -> str:
    """Return the first difference as text; "" if there is none."""
    names = [name for name in own if own[name] != theirs.get(name)]
    return f"{names[0]} {theirs.get(names[0])} there, {own[names[0]]} here" if names else ""


def _checksum() -> int:
    checksum = 0
    for package in OWN:
        for file in sorted((ROOT / package).rglob("*")):
            if file.suffix in SUFFIXES:
                checksum = zlib.crc32(file.relative_to(ROOT).as_posix().encode() + file.read_bytes(), checksum)
    return checksum


def _store_bytes() -> int:
    """Size of the object store: half of the free shared memory. Pages are taken when they are used.

    Batches that do not fit go through the disk.
    """
    free = shutil.disk_usage(SHARED_MEMORY).free if SHARED_MEMORY.is_dir() else 0
    low, high = STORE_BYTES
    return max(low, min(high, free // 2))


def _find_address(address: str | None) -> str | None:
    """Return the address to join, which something listens at; "auto": that of this machine. None to start a Ray.

    Raises ConfigError.
    """
    named = address or os.environ.get("RAY_ADDRESS")
    if named in ("auto", "local", None):
        here = ""
        with suppress(OSError):
            here = CURRENT_CLUSTER.read_text().strip()
        found = bool(here) and named != "local" and _listens(here)
        if named == "auto" and not found:
            raise ConfigError("collector.address=auto finds no cluster on this machine; run `ray start --head` first")
        return "auto" if found else None
    assert named is not None
    source = f"collector.address={named}" if address else f"RAY_ADDRESS={named}"
    host, _, port = named.rpartition(":")
    if not host or not port.isdecimal() or not 0 < int(port[:6]) < 65536:
        raise ConfigError(f"{source} must be HOST:PORT, like 10.0.0.1:6379")
    if not _listens(named):
        raise ConfigError(f"{source} is out of reach: nothing there has answered for {CONNECT_SECONDS:g} s")
    return named


def _listens(address: str) -> bool:
    host, _, port = address.rpartition(":")
    try:
        socket.create_connection((host.strip("[]"), int(port)), CONNECT_SECONDS).close()
    except (OSError, ValueError):
        return False
    return True


@contextmanager
def _loopback(ray: Any) -> Iterator[None]:
    """Keep 127.0.0.1 as the node's address, so that Ray's servers listen there only.

    Ray replaces it by the machine's address, except where it supports no clusters, as on macOS.
    """
    constants = ray._private.ray_constants
    before = constants.ENABLE_RAY_CLUSTER
    constants.ENABLE_RAY_CLUSTER = False
    try:
        yield
    finally:
        constants.ENABLE_RAY_CLUSTER = before


@contextmanager
def _signal_handlers() -> Iterator[None]:
    """Keep this process's signal handlers; Ray replaces that of SIGTERM."""
    before: dict[int, Callable | int | None] = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            with suppress(ValueError):  # another thread than the main one
                signal.signal(number, handler)
