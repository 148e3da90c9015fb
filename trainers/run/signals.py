"""Signals that ask a program to stop."""

from __future__ import annotations

import signal


class StopSignal:
    """Records SIGINT and SIGTERM instead of letting them interrupt the program. A context manager.

    Calling it tells whether one of them was received, so that a loop can stop between two steps. `signal` is its
    number, 0 before.
    """

    def __init__(self) -> None:
        self.signal = 0

    def __enter__(self) -> StopSignal:
        self._previous = {number: signal.signal(number, self._record) for number in (signal.SIGINT, signal.SIGTERM)}
        return self

    def __exit__(self, *error: object) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)

    def __call__(self) -> bool:
        return bool(self.signal)

    def _record(self, number: int, _frame: object) -> None:
        self.signal = number
