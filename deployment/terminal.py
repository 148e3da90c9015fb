"""The keys of a person at the terminal who watches an arm: stop, and the dead-man key."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Callable
from typing import Any

from deployment.safe_arm import SafeArm

STOP = " "
HELP = "space or Ctrl-C: stop and end; any other key, held down: the dead-man key"


class Terminal:
    """Reads single keys, without Enter, while it is entered; without a terminal there is only Ctrl-C.

    Called with the arm, between its commands, it does what the keys say. stop: returns whether the program is to end.
    """

    def __init__(self, stop: Callable[[], bool]) -> None:
        self._stop, self._pressed = stop, False
        self._before: Any = None
        self.is_there = os.name == "posix" and sys.stdin is not None and sys.stdin.isatty()

    @property
    def ended(self) -> bool:
        """Whether the person has stopped the arm."""
        return self._pressed or self._stop()

    def __enter__(self) -> Terminal:
        if self.is_there:
            import termios
            import tty

            self._before = termios.tcgetattr(sys.stdin)
            tty.setcbreak(sys.stdin.fileno())
        return self

    def __exit__(self, *error: object) -> None:
        if self._before is not None:
            import termios

            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._before)

    def __call__(self, arm: SafeArm) -> None:
        keys = self._keys()
        self._pressed = self._pressed or STOP in keys
        if self.ended:
            arm.safety.stop("a person stopped it")
        elif keys:
            arm.safety.press(arm.clock.now())

    def _keys(self) -> str:
        """Return the keys that were pressed since the last call."""
        if not self.is_there or not select.select([sys.stdin], [], [], 0)[0]:
            return ""
        pressed: Any = os.read(sys.stdin.fileno(), 1024)
        return pressed.decode(errors="replace")
