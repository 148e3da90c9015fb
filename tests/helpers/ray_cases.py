"""A Ray for tests, and what is left of it."""

from __future__ import annotations

import os
import time
from pathlib import Path

from trainers.cluster import ray_session
from trainers.cluster.ray_session import RaySession


def start_ray(cpus: int) -> RaySession:
    """Start a Ray with so many cores, whatever this machine has."""
    before, ray_session.cores = ray_session.cores, lambda: cpus
    try:
        return RaySession("local")
    finally:
        ray_session.cores = before


def end_ray(session: RaySession) -> None:
    """End a Ray that was started here, and check that nothing of it is left."""
    session.close()
    assert left_over(str(session.folder)) == []
    assert session.folder is not None
    assert not session.folder.exists()


def left_over(text: str, seconds: float = 10.0) -> list[str]:
    """Command lines of other processes that name `text`, after the second or two that they take to end."""
    deadline = time.monotonic() + seconds
    while (found := _command_lines(text)) and time.monotonic() < deadline:
        time.sleep(0.1)
    return found


def _command_lines(text: str) -> list[str]:
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            try:
                line = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
            except (FileNotFoundError, ProcessLookupError):
                continue
            if text in line:
                found.append(line)
    return found


def listening(port: int) -> str:
    """The local address of the socket that listens on a port, as the kernel writes it in hexadecimal."""
    for table in ("tcp", "tcp6"):
        for line in (Path("/proc/net") / table).read_text().splitlines()[1:]:
            local, state = line.split()[1], line.split()[3]
            if state == "0A" and int(local.split(":")[1], 16) == port:
                return local.split(":")[0]
    raise LookupError(port)
