"""Programs run in forks of this process: a fork has the libraries that a new process would import for seconds."""

from __future__ import annotations

import importlib
import os
import runpy
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from tools.forked import ProcessResult, call

ROOT = Path(__file__).resolve().parents[2]
TIMEOUT = 240.0  # seconds


def run_module(name: str, *words: str, folder: Path = ROOT, timeout: float = TIMEOUT) -> ProcessResult:
    """Run `python -m name words` in a folder, in a fork. Import what it imports before, or each fork imports it."""
    return call(partial(_run, name, words), folder, timeout)


def run_module_from(paths: Sequence[Path], name: str, *words: str, folder: Path) -> ProcessResult:
    """Run `python -m name words` as `run_code_from` runs code."""
    return call(partial(_run_from, paths, partial(_run, name, words)), folder, TIMEOUT)


def run_code_from(paths: Sequence[Path], code: str, folder: Path) -> ProcessResult:
    """Run code where these paths have the project and its plugins, in a fork that imports them anew."""
    return call(partial(_run_from, paths, partial(exec, code, {"__name__": "__main__"})), folder, TIMEOUT)


def _run(name: str, words: tuple[str, ...]) -> None:
    sys.modules.pop(name, None)  # as in a new process, the module has not run
    sys.argv = [name, *words]
    sys.path.insert(0, os.getcwd())
    runpy.run_module(name, run_name="__main__", alter_sys=True)


def _run_from(paths: Sequence[Path], function: partial) -> None:
    ours = {path.stem for path in ROOT.iterdir()}
    for name in [name for name in sys.modules if name.partition(".")[0] in ours]:
        del sys.modules[name]
    sys.path[:] = [*map(str, paths), *(path for path in sys.path if path and Path(path).resolve() != ROOT)]
    os.environ["PYTHONPATH"] = os.pathsep.join(map(str, paths))  # of processes that the program starts
    importlib.invalidate_caches()
    function()
