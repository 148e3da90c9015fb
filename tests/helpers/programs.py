"""Programs of the project, run in forks of this process: a fork has imported what a new process would import anew."""

from __future__ import annotations

import os
import runpy
import sys
from functools import partial
from pathlib import Path

from tools.forked import ProcessResult, call

ROOT = Path(__file__).resolve().parents[2]


def run_module(name: str, *words: str, folder: Path = ROOT, timeout: float = 120.0) -> ProcessResult:
    """Run `python -m name words` in a folder, in a fork. Import what it imports before, or each fork imports it."""
    return call(partial(_run, name, words), folder, timeout)


def _run(name: str, words: tuple[str, ...]) -> None:
    sys.modules.pop(name, None)  # as in a new process, the module has not run
    sys.argv = [name, *words]
    sys.path.insert(0, os.getcwd())
    runpy.run_module(name, run_name="__main__", alter_sys=True)
