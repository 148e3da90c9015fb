"""The keys of a person at the terminal who watches an arm: stop, and the dead-man key."""

from __future__ import annotations

import math
import os
import select
import sys
from collections.abc import Callable
from typing import Any

from deployment.safe_arm import SafeArm

STOP = " "
FRESH = 0.1  # seconds between two looks at the keys beyond which waiting ones are no sign of a hand at the dead-man key
HELP = "space or Ctrl-C: stop and end; any other key, held down: the dead-man key"


class Terminal:
    """Reads single keys, without Enter, while it is entered; without a terminal there is only Ctrl-C.

    Called with the arm, between its commands, it does what the keys say. Keys that were pressed while nobody looked
    tell nothing of now: they count as stop, but not as the dead-man key. stop: returns whether the program is to end.
    """

    def __init__(self, stop: Callable[[], bool]) -> None:
        self._stop, self._pressed = stop, False
        self._before: Any = None
        self._looked = -math.inf  # at the keys, seconds of the arm's clock
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
        now, before = arm.clock.now(), self._looked
        self._looked, keys = now, self._keys()
        self._pressed = self._pressed or STOP in keys
        if self.ended:
            arm.safety.stop("a person stopped it")
        elif keys and now - before <= FRESH:
            arm.safety.press(now)

    def _keys(self) -> str:
        """Return the keys that were pressed since the last call."""
        pressed = b""
        while self.is_there and select.select([sys.stdin], [], [], 0)[0]:
            more = os.read(sys.stdin.fileno(), 1024)
            if not more:  # the terminal was closed
                break
            pressed += more
        return pressed.decode(errors="replace")
