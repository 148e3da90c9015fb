"""What a sweep came to: one table at its end, and an exit code that knows of failures."""

from __future__ import annotations

import sys
from typing import Any

from hydra.core.utils import JobReturn
from hydra.experimental.callback import Callback

HEADER = ("run", "success", "ci95", "wrong object", "frames", "seconds")


class Table(Callback):
    """Collects what each job returned (eval.json's values, or {"error": ...}) and prints it after a multirun."""

    def __init__(self) -> None:
        self._rows: list[tuple[str, ...]] = []
        self._failed = False

    def on_job_end(self, config: Any, job_return: JobReturn, **_: Any) -> None:
        name = " ".join(job_return.overrides or []) or "default"
        result = job_return._return_value
        if not isinstance(result, dict) or "error" in result:
            self._failed = True
            error = result["error"] if isinstance(result, dict) else result
            self._rows.append((name, f"failed: {error}", "", "", "", ""))
            return
        low, high = result["ci95"]
        self._rows.append(
            (
                name,
                f"{result['success_at_end']:.3f}",
                f"{low:.3f}-{high:.3f}",
                f"{result['wrong_object']:.3f}",
                f"{result['frames']}",
                f"{result['wall_s']:.0f}",
            )
        )

    def on_multirun_end(self, config: Any, **_: Any) -> None:
        print("\n" + table([HEADER, *self._rows]))
        if self._failed:
            sys.exit(1)


def table(rows: list[tuple[str, ...]]) -> str:
    """Rows of words as aligned columns, a line under the first."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
    return "\n".join([lines[0], "  ".join("-" * width for width in widths), *lines[1:]])
