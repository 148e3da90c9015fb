"""A signal for this process when its parent ends."""

from __future__ import annotations

import ctypes
import sys

PR_SET_PDEATHSIG = 1  # of prctl(2)


def signal_at_parent_death(number: int) -> None:
    """Have the system send this signal to the process when its parent ends. Does nothing except on Linux."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, number)
