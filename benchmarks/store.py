"""What benchmarks store: sections of a JSON file, each with its command and machine."""

from __future__ import annotations

import json
import os
import platform
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np


def machine() -> dict[str, Any]:
    """Return the machine of a measurement. load_before: its mean load over the last minute."""
    return {
        "python": platform.python_version(),
        "processor": platform.machine(),
        "cores": len(os.sched_getaffinity(0)),
        "load_before": round(os.getloadavg()[0], 2),
        "numpy": np.__version__,
    }


def lines_of(result: dict[str, Any], prefix: str = "") -> list[tuple[str, str]]:
    """Return the (name, value) lines of a nested result; a name is the path of keys."""
    lines = []
    for key, value in result.items():
        path = f"{prefix} {key}".strip().replace("_", " ")
        lines += lines_of(value, path) if isinstance(value, dict) else [(path, _text(value))]
    return lines


def _text(value: Any) -> str:
    if isinstance(value, list):
        return "\n".join(value) or "none"
    return f"{value:,}" if isinstance(value, int | float) else str(value)


def write_section(path: Path, module: str, section: str, result: dict[str, Any]) -> None:
    """Replace one section of the JSON file, with the command and the machine; make the file if it is missing."""
    sections = json.loads(path.read_text()) if path.exists() else {}
    words = ["FOLDER" if before == "--data" else word for before, word in pairwise(sys.argv)]
    command = " ".join(["python -m", module, *words])
    sections[section] = {"command": command, "machine": machine(), **result}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(sections, indent=1, ensure_ascii=True) + "\n")
