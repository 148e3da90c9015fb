"""What Linux has and Windows lacks: a stand-in of Windows runs the programs, and clusters are refused there."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from core.errors import ConfigError
from tests.helpers.tiny_run import TINY
from trainers.cluster.supervised_run import run_apart

ROOT = Path(__file__).resolve().parents[2]
# Imported by every interpreter at its start. The modules and functions below do not exist on Windows.
STAND_IN = """
import importlib.abc, multiprocessing, os, subprocess, sys, types

class Hidden(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name in ("fcntl", "termios"):
            raise ImportError(name)

sys.meta_path.insert(0, Hidden())
for name in ("fcntl", "termios"):
    sys.modules.pop(name, None)
for name in ("getuid", "geteuid", "sched_getaffinity", "killpg", "setsid"):
    delattr(os, name)
multiprocessing.context._concrete_contexts.pop("forkserver")
multiprocessing.get_all_start_methods = lambda: ["spawn"]

def locking(descriptor, mode, count):
    place = os.environ["LOCKED"] + "/" + str(os.fstat(descriptor).st_ino)
    try:
        os.mkdir(place)
    except FileExistsError:
        raise PermissionError(13, "Permission denied") from None

sys.modules["msvcrt"] = types.SimpleNamespace(LK_NBLCK=2, locking=locking)
"""


@pytest.fixture
def windows(tmp_path):
    """Runs a program as on Windows; returns (exit code, what it printed)."""
    (tmp_path / "site").mkdir()
    (tmp_path / "locked").mkdir()
    (tmp_path / "site" / "sitecustomize.py").write_text(STAND_IN, encoding="utf-8")
    paths = os.pathsep.join([str(tmp_path / "site"), str(ROOT)])
    environment = os.environ | {"PYTHONPATH": paths, "USERNAME": "me", "LOCKED": str(tmp_path / "locked")}

    def run(*words):
        done = subprocess.run(
            [sys.executable, *words], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        return done.returncode, done.stdout + done.stderr

    return run


@pytest.mark.slow
def test_a_run_trains_and_keeps_others_out_of_its_folder(windows, tmp_path):
    words = (str(ROOT / "train.py"), *TINY, "collector.overlap=true", f"hydra.run.dir={tmp_path / 'run'}")
    code, printed = windows(*words)
    assert code == 0, printed
    assert (tmp_path / "run" / "eval.json").is_file()
    code, printed = windows(str(ROOT / "train.py"), f"resume={tmp_path / 'run'}")
    assert code == 1
    assert printed.strip().splitlines()[-1].startswith(f"error: a run is running in {tmp_path / 'run'} already")


def test_a_cluster_is_refused_where_processes_have_no_groups(monkeypatch):
    monkeypatch.delattr(os, "killpg")
    with pytest.raises(ConfigError, match="from Linux or macOS only; here, take collector=local"):
        run_apart(lambda: None, ROOT / "evaluate.py", [], "")
