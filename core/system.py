"""Keeps the messages of PyBullet's C++ code out of the terminal."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType

from core.schema import ConfigError


@contextmanager
def suppress_stdout() -> Iterator[None]:
    """Discards the output of C code to stdout and stderr inside the block. No effect on Windows."""
    if os.name != "posix":
        yield
        return
    flush = ctypes.CDLL(None).fflush
    sys.stdout.flush()
    flush(None)
    saved, null = [os.dup(1), os.dup(2)], os.open(os.devnull, os.O_WRONLY)
    for descriptor in (1, 2):
        os.dup2(null, descriptor)
    try:
        yield
    finally:
        flush(None)  # otherwise the C library prints its buffer after the streams are restored
        for descriptor, copy in zip((1, 2), saved, strict=True):
            os.dup2(copy, descriptor)
            os.close(copy)
        os.close(null)


PR_SET_PDEATHSIG = 1  # of prctl(2)


def signal_at_parent_death(number: int) -> None:
    """Have the system send this signal to the process when its parent ends. Does nothing except on Linux."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, number)


def import_optional(*names: str, extra: str = "record") -> list[ModuleType]:
    """Import modules that an extra of the package installs.

    Args:
        names: dotted names of the modules.
        extra: name of the extra, for the error message.

    Raises:
        ConfigError: a module is missing; the message says how to install it.
    """
    try:
        return [import_module(name) for name in names]
    except ImportError as error:
        missing = (error.name or str(error)).partition(".")[0]
        raise ConfigError(
            f'recordings in this format need {missing}, which is not installed: pip install -e ".[{extra}]"'
        ) from None


# Signals to end a program: from a terminal (SIGINT, SIGHUP), a scheduler (SIGTERM; SIGUSR1 as SLURM's warning).
NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGUSR1")
HANDLED = [getattr(signal, name) for name in NAMES if hasattr(signal, name)]


class StopSignal:
    """Records signals that ask the program to stop, instead of letting them interrupt it. A context manager.

    Calling it returns whether one of them was received, so that a loop can stop between two steps. `signal` is its
    number, 0 before. A second SIGINT ends the program at once.
    """

    def __init__(self) -> None:
        self.signal = 0

    def __enter__(self) -> StopSignal:
        self._previous = {number: signal.signal(number, self._record) for number in HANDLED}
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
