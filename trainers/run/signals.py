"""Signals that ask a program to stop."""

from __future__ import annotations

import os
import signal

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
