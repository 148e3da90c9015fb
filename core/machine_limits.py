"""Limits of the machine, looked at before the work: open files, processes, shared memory and disk space.

Each function raises ConfigError with what is needed, what there is, and what helps.
"""

from __future__ import annotations

import math
import os
import shutil
import sys
import tempfile
import threading
from contextlib import suppress
from pathlib import Path

from core.errors import ConfigError

SHARED_MEMORY = Path("/dev/shm")  # of Linux; other systems keep shared memory elsewhere
MIB = 2**20


def require_files(count: int) -> None:
    """Check that the process may open so many files. The limit is raised where the system allows it."""
    try:
        import resource
    except ImportError:  # Windows has no such limit
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft < hard and soft != resource.RLIM_INFINITY:
        with suppress(OSError, ValueError):  # a system that allows less than it says
            resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, max(soft, count, 2**16)), hard))
        soft = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if soft != resource.RLIM_INFINITY and soft < count:
        raise ConfigError(
            f"{count} open files are needed, and {soft} are allowed: raise the limit (ulimit -n {count}), or give "
            "fewer collector.workers"
        )


def require_docstrings() -> None:
    """Check that Python keeps docstrings: TensorDict joins some when it is imported."""
    if sys.flags.optimize > 1:
        raise ConfigError(
            "python -OO leaves out docstrings, without which TensorDict cannot be imported: use python -O"
        )


def require_threads(count: int) -> None:
    """Check that so many threads and processes can be started, by starting that many threads that only wait."""
    ended, threads = threading.Event(), []
    try:
        for _ in range(count):
            thread = threading.Thread(target=ended.wait, daemon=True)
            thread.start()
            threads.append(thread)
    except RuntimeError:
        raise ConfigError(
            f"{count} threads and processes are needed, and {len(threads)} can be started: raise the limit "
            "(ulimit -u), or close other programs"
        ) from None
    finally:
        ended.set()
        for thread in threads:
            thread.join()


def require_shared_memory(size: int) -> None:
    """Check that processes can share so many bytes of memory."""
    if not SHARED_MEMORY.is_dir():
        return
    help_ = "give collector.workers=1, or more shared memory (docker run --shm-size=1g)"
    try:
        with tempfile.TemporaryFile(dir=SHARED_MEMORY):
            free = shutil.disk_usage(SHARED_MEMORY).free
    except OSError as error:
        raise ConfigError(f"{SHARED_MEMORY} cannot be used: {error.strerror}; {help_}") from None
    if free < size:
        raise ConfigError(
            f"worker processes need {size / MIB:.1f} MiB of shared memory, and {SHARED_MEMORY} has {free / MIB:.1f} "
            f"free: {help_}"
        )


def require_disk(folder: Path, size: int, purpose: str) -> None:
    """Check that a folder, which exists or whose parent does, has so many bytes of free space.

    Args:
        folder: where files are to be written.
        size: bytes.
        purpose: what they are for, for the message.
    """
    place = next((each for each in (folder.absolute(), *folder.absolute().parents) if each.is_dir()), Path("/"))
    free = shutil.disk_usage(place).free
    if free < size:
        raise ConfigError(
            f"{folder}: {purpose} {size / MIB:.0f} MiB of free disk space, {free / MIB:.0f} are free; free some, or "
            "choose another place"
        )
    if not os.access(place, os.W_OK):
        raise ConfigError(f"{folder}: nothing can be written in {place}; choose another place")
    largest = _largest_file()
    if largest < size:
        raise ConfigError(
            f"{folder}: {purpose} files of up to {size / MIB:.0f} MiB, and {largest / MIB:.1f} are allowed: raise the "
            "limit (ulimit -f)"
        )


def _largest_file() -> float:
    """Return how many bytes a file may have."""
    try:
        import resource
    except ImportError:
        return math.inf
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
    return math.inf if limit == resource.RLIM_INFINITY else limit
