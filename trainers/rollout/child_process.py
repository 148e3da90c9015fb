"""A process that is forked from the fork server, with a pipe to it. It can be killed at any time."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import torch

from trainers.rollout import fork_server
from trainers.utils.parent_death import signal_at_parent_death

KILL_SECONDS = 10.0  # to wait for the end of a process that was killed
EXIT_SECONDS = 1.0  # to wait for the exit code of a process whose pipe is closed


class ChildProcess:
    """Starts at once.

    Args:
        serve: called in the process with its end of the pipe and the arguments; it calls `detach` first.
        arguments: picklable; tensors are shared.
    """

    def __init__(self, serve: Callable[..., None], *arguments: Any) -> None:
        context: Any = fork_server.start()
        self.connection, theirs = context.Pipe()
        self.process = context.Process(target=serve, args=(theirs, *arguments), daemon=True)
        self.process.start()
        theirs.close()

    def send(self, message: object) -> None:
        """Send a message. If the process has ended, reading from the pipe reports it after the earlier answers."""
        with suppress(OSError):
            self.connection.send(message)

    def kill(self) -> None:
        """End the process, whatever it is doing."""
        self.process.kill()
        self.process.join(KILL_SECONDS)  # until the fork server, which may be stopped itself, says so
        self.connection.close()

    def ending(self) -> str:
        """How the process ended, as a clause. Its pipe is closed."""
        self.process.join(EXIT_SECONDS)
        code = self.process.exitcode
        if code is not None and code < 0:
            return f"was killed by signal {-code} ({signal.Signals(-code).name})"
        return f"ended with exit code {code}"


def detach() -> None:
    """Use one thread, ignore SIGINT, which a terminal sends to all processes, and end with the main process."""
    torch.set_num_threads(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal_at_parent_death(signal.SIGKILL)  # the parent is the fork server, which ends with the main process
    main = multiprocessing.parent_process()
    if main is None or not main.is_alive():  # it ended before the call
        os._exit(1)
