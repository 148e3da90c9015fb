"""Command-line words that resume a sweep."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from core.errors import ConfigError
from trainers.sweeps.arguments import expand_resume


def started_sweep(folder: Path, *overrides: str) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "sweep.yaml").write_text(json.dumps([{"overrides": ["seed=9"]}, {"overrides": overrides}]))
    return folder


@pytest.mark.slow
def test_resume_alone_takes_the_overrides_of_the_last_start(tmp_path):
    folder = started_sweep(tmp_path, "scenario='1','2'", "seed=0,1")
    expected = ["--multirun", "scenario='1','2'", "seed=0,1", f"hydra.sweep.dir={folder}"]
    assert expand_resume(["-m", f"sweep.resume={folder}"]) == expected
    assert expand_resume([f"sweep.resume={folder}"]) == expected
    assert expand_resume([f"sweep.resume={folder}", "sweep.jobs=1"]) == [*expected[:-1], "sweep.jobs=1", expected[-1]]


def test_resume_accepts_other_overrides(tmp_path):
    folder = started_sweep(tmp_path, "seed=0,1")
    words = ["-m", "seed=0,1,2", f"sweep.resume={folder}"]
    assert expand_resume(words) == ["--multirun", "seed=0,1,2", f"hydra.sweep.dir={folder}"]
    assert expand_resume(["robot=panda", "sweep.resume=null"]) == ["robot=panda", "sweep.resume=null"]


def test_a_damaged_sweep_file_is_named(tmp_path):
    (tmp_path / "sweep.yaml").write_text("- overrides: [a\n- {")
    with pytest.raises(ConfigError, match=r"sweep\.yaml is damaged"):
        expand_resume([f"sweep.resume={tmp_path}"])


def test_a_sweep_file_that_names_other_keys_is_refused(tmp_path):
    folder = started_sweep(tmp_path, "seed=0,1", "+hydra.callbacks.x._target_=joblib.load")
    with pytest.raises(ConfigError, match=r"sweep\.yaml is refused: \+hydra\.callbacks\.x\._target_=joblib\.load adds"):
        expand_resume([f"sweep.resume={folder}"])
    words = expand_resume([f"sweep.resume={folder}", "seed=0"])
    assert words == ["--multirun", "seed=0", f"hydra.sweep.dir={folder}"]
