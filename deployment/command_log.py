"""The log of every command: JSON lines, each on the disk before the next command is sent."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from deployment.arm import ArmState
from deployment.safety import Decision

MAX_SHOWN = 200  # characters of something that a policy wanted and that is no list of numbers


class CommandLog:
    """Writes a line for each decision, and for each change that happens between them.

    file: the JSON lines; None: nothing is kept. Raises OSError where it cannot be written: an arm is not driven without
    its log.
    """

    def __init__(self, file: Path | None = None) -> None:
        if file is not None:
            file.parent.mkdir(parents=True, exist_ok=True)
        self._file = None if file is None else file.open("w", encoding="utf-8", buffering=1)  # flushes each line

    def __call__(self, time: float, measured: ArmState | None, wanted: Any, decision: Decision) -> None:
        """Write one line: time (s), measured, wanted and sent angles (rad), opening, and the reasons."""
        if self._file is None:
            return
        line = {
            "time": round(time, 6),
            "measured": None if measured is None else _numbers(measured.angles),
            "measured_at": None if measured is None else round(measured.time, 6),
            "wanted": None if wanted is None else _numbers(wanted),
            "sent": None if decision.angles is None else _numbers(decision.angles),
            "opening": round(decision.opening, 6),
            "reasons": list(decision.reasons),
        }
        self._file.write(json.dumps(line) + "\n")

    def close(self) -> None:
        """Close the file. Idempotent."""
        if self._file is not None:
            self._file.close()


def _numbers(value: Any) -> list[float] | str:
    """Return finite numbers in a row as a list, and how anything else looks."""
    try:
        array = np.asarray(value, np.float64)
    except (TypeError, ValueError, OverflowError):
        return repr(value)[:MAX_SHOWN]
    if array.ndim != 1 or not np.isfinite(array).all():
        return repr(value)[:MAX_SHOWN]
    return array.round(6).tolist()
