"""Nodes of a cluster on one machine: network namespaces with addresses of their own. Needs root."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from types import TracebackType

from trainers.cluster.ray_session import CURRENT_CLUSTER

BRIDGE, SUBNET = "deixis-br", "10.77.0"
PORT = 6379
SETTINGS = {
    "RAY_AUTH_MODE": "disabled",  # nothing but the namespaces reaches the head
    "RAY_worker_niceness": "0",  # Ray's default, 15, gives actors only time that other processes leave
    # How soon the head counts a silent node as dead: after about 4 s.
    "RAY_health_check_initial_delay_ms": "1000",
    "RAY_health_check_period_ms": "1000",
    "RAY_health_check_timeout_ms": "1000",
    "RAY_health_check_failure_threshold": "3",
}
START_SECONDS = 60.0


class Network:
    """Namespaces deixis-0 (the head's) to deixis-<nodes>, joined by a bridge. They are removed at the end."""

    def __init__(self, nodes: int) -> None:
        self.names = [f"deixis-{i}" for i in range(nodes + 1)]

    def __enter__(self) -> Network:
        self._remove()
        _ip("link", "add", BRIDGE, "type", "bridge")
        _ip("link", "set", BRIDGE, "up")
        for i, name in enumerate(self.names):
            _ip("netns", "add", name)
            _ip("link", "add", f"deixis-v{i}", "type", "veth", "peer", "name", "eth0", "netns", name)
            _ip("link", "set", f"deixis-v{i}", "master", BRIDGE, "up")
            _ip("-n", name, "addr", "add", f"{SUBNET}.{i + 1}/24", "dev", "eth0")
            _ip("-n", name, "link", "set", "eth0", "up")
            _ip("-n", name, "link", "set", "lo", "up")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._remove()
        with suppress(OSError):
            if CURRENT_CLUSTER.read_text().startswith(address(0)):
                CURRENT_CLUSTER.unlink()

    def _remove(self) -> None:
        listed = subprocess.run(["ip", "netns", "list"], capture_output=True, text=True).stdout
        for name in [line.split()[0] for line in listed.splitlines() if line.startswith("deixis-")]:
            kill_all(name)
            subprocess.run(["ip", "netns", "del", name], check=False)
        for link in (*(f"deixis-v{i}" for i in range(len(self.names))), BRIDGE):
            subprocess.run(["ip", "link", "del", link], capture_output=True, check=False)


def address(index: int) -> str:
    """Return the address of a namespace."""
    return f"{SUBNET}.{index + 1}"


def start_node(index: int, cpus: int) -> subprocess.Popen:
    """Start Ray in a namespace: the head in deixis-0, otherwise a node that joins it."""
    head = ["--head", f"--port={PORT}", "--include-dashboard=false"]
    place = head if index == 0 else [f"--address={address(0)}:{PORT}"]
    options = [f"--node-ip-address={address(index)}", f"--num-cpus={cpus}", f"--object-store-memory={200 * 2**20}"]
    options += ["--disable-usage-stats", "--block"]
    words = [sys.executable, "-m", "ray.scripts.scripts", "start", *place, *options]
    environment = {**os.environ, **SETTINGS, "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0"}
    environment.pop("RAY_ADDRESS", None)
    inside = ["ip", "netns", "exec", f"deixis-{index}"]
    null = subprocess.DEVNULL
    process = subprocess.Popen([*inside, *words], env=environment, start_new_session=True, stdout=null, stderr=null)
    deadline = time.monotonic() + START_SECONDS
    while index == 0 and not _listens() and time.monotonic() < deadline:
        time.sleep(0.2)
    return process


def _listens() -> bool:
    """Return whether the head answers. Called in its namespace."""
    with suppress(OSError), socket.create_connection((address(0), PORT), 1.0):
        return True
    return False


def kill_all(name: str, number: int = signal.SIGKILL) -> None:
    """Send a signal to every process of a namespace but this one."""
    pids = subprocess.run(["ip", "netns", "pids", name], capture_output=True, text=True).stdout.split()
    for pid in pids:
        if int(pid) != os.getpid():
            with suppress(ProcessLookupError):
                os.kill(int(pid), number)


def cut(index: int, up: bool = False) -> None:
    """Disconnect a namespace from the others, or connect it again."""
    _ip("-n", f"deixis-{index}", "link", "set", "eth0", "up" if up else "down")


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True)
