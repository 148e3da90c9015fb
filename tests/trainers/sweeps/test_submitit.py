"""A sweep that submitit's local executor runs: the launcher of SLURM without SLURM."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import train
from tests.helpers.tiny_run import TINY
from trainers.sweeps.runs import find_runs

ROOT = Path(train.__file__).parent


@pytest.mark.slow
def test_a_job_of_submitit_leaves_a_result_and_the_sweep_a_report(tmp_path):
    pytest.importorskip("hydra_plugins.hydra_submitit_launcher")
    words = ["-m", "seed=3", "task=reach", *TINY, "hydra/launcher=submitit_local", f"hydra.sweep.dir={tmp_path}"]
    done = subprocess.run(
        [sys.executable, str(ROOT / "train.py"), *words], cwd=tmp_path, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr[-500:]
    (run,) = find_runs(tmp_path)
    assert run.result is not None
    assert run.seed == 3
    assert "report: " in done.stdout
