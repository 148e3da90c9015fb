"""The machine that a program runs on: its cores and versions, signals, streams, and modules that may be missing."""

from __future__ import annotations

import ctypes
import os
import platform
import signal
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from types import ModuleType

from core.errors import ConfigError

PACKAGES = ("torch", "torchrl", "tensordict", "pybullet", "numpy")
FORKS = {"pybullet": "pybullet-arm64"}  # packages that are installed in place of another one
# Signals to end a program: from a terminal (SIGINT, SIGHUP), a scheduler (SIGTERM; SIGUSR1 as SLURM's warning).
STOP_SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGUSR1") if hasattr(signal, name)]
PR_SET_PDEATHSIG = 1  # of prctl(2)


def cores() -> int:
    """Return the number of CPU cores that this process may use, at least 1."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def system_info() -> dict[str, str]:
    """Return the number of cores, processor, operating system, and versions of Python and `PACKAGES`, as text."""
    info = {"cores": str(cores()), "cpu": _cpu_model(), "system": f"{platform.system()} {platform.machine()}"}
    info["python"] = platform.python_version()
    return info | package_versions()


def package_versions() -> dict[str, str]:
    """Return the versions of `PACKAGES`; of a fork that is in place of one, with its name in parentheses."""
    from importlib.metadata import PackageNotFoundError, version  # 50 ms to import

    found = {}
    for package in PACKAGES:
        found[package] = "not installed"
        for name in (FORKS.get(package, package), package):
            with suppress(PackageNotFoundError):
                found[package] = version(name) + ("" if name == package else f" ({name})")
    return found


def _cpu_model() -> str:
    """Return the model name from /proc/cpuinfo, or what `platform` reports on other systems."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or "unknown"


def import_optional(*names: str, extra: str = "record", what: str = "recordings in this format") -> list[ModuleType]:
    """Import modules that an extra of the package installs.

    Args:
        names: dotted names of the modules.
        extra: name of the extra, for the error message.
        what: needs them, in the plural, for the error message.

    Raises:
        ConfigError: a module is missing; the message says how to install it.
    """
    try:
        return [import_module(name) for name in names]
    except ImportError as error:
        missing = (error.name or str(error)).partition(".")[0]
        raise ConfigError(f'{what} need {missing}, which is not installed: pip install -e ".[{extra}]"') from None


@contextmanager
def suppress_stdout() -> Iterator[None]:
    """Discard what C code, such as PyBullet's, writes to stdout and stderr in the block. No effect on Windows."""
    if os.name != "posix":
        yield
        return
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        with _redirected(null):
            yield
    finally:
        os.close(null)


@contextmanager
def captured_stdout() -> Iterator[list[str]]:
    """Collect what C code writes to stdout and stderr in the block: the only entry of the list, once the block ends.

    The list stays empty on Windows.
    """
    texts: list[str] = []
    if os.name != "posix":
        yield texts
        return
    with tempfile.TemporaryFile() as file:
        try:
            with _redirected(file.fileno()):
                yield texts
        finally:
            file.seek(0)
            texts.append(file.read().decode(errors="replace"))


@contextmanager
def _redirected(target: int) -> Iterator[None]:
    """Send stdout and stderr of this process to another file descriptor."""
    flush = ctypes.CDLL(None).fflush
    sys.stdout.flush()
    flush(None)
    saved = [os.dup(1), os.dup(2)]
    for descriptor in (1, 2):
        os.dup2(target, descriptor)
    try:
        yield
    finally:
        flush(None)  # otherwise the C library prints its buffer after the streams are restored
        for descriptor, copy in zip((1, 2), saved, strict=True):
            os.dup2(copy, descriptor)
            os.close(copy)


def signal_at_parent_death(number: int | None = None) -> None:
    """Have the system send this signal, by default SIGKILL, to the process when its parent ends.

    Does nothing except on Linux.
    """
    if sys.platform == "linux":
        number = signal.SIGKILL if number is None else number
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, number)


class StopSignal:
    """Records signals that ask the program to stop, instead of letting them interrupt it. A context manager.

    Calling it returns whether one of them was received, so that a loop can stop between two steps. A second SIGINT
    ends the program at once.

    Attributes:
        signal: the number of the signal that was received; 0 before.
    """

    def __init__(self) -> None:
        self.signal = 0

    def __enter__(self) -> StopSignal:
        self._previous = {number: signal.signal(number, self._record) for number in STOP_SIGNALS}
        return self

    def __exit__(self, *error: object) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)

    def __call__(self) -> bool:
        return bool(self.signal)

    def _record(self, number: int, _frame: object) -> None:
        if number == self.signal == signal.SIGINT:
            signal.signal(number, signal.SIG_DFL)
            os.kill(os.getpid(), number)
        self.signal = number
