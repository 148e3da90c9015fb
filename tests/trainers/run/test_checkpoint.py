"""Checkpoint files: atomic writes, damage, hostile content, and checks against the environment."""

import os
import pickle
import subprocess
import sys

import pytest
import torch

from trainers.run import checkpoint
from trainers.run.checkpoint import CheckpointError

PAYLOAD = {
    "config": {"seed": 0},
    "vocabulary": ["<pad>", "red"],
    "widths": {"robot": [4], "objects": [3, 13], "instruction": [6], "action": [3]},
    "algorithm": {"policy": {"w": torch.arange(5000.0)}},
    "counters": {"frames": 7},
    "rng": torch.get_rng_state(),
}


@pytest.fixture
def path(tmp_path):
    target = tmp_path / "checkpoints" / "last.pt"
    checkpoint.save(target, PAYLOAD)
    return target


def test_save_and_load_round_trip_and_leave_no_other_file(path):
    loaded = checkpoint.load(path)
    assert loaded["counters"] == {"frames": 7}
    assert torch.equal(loaded["algorithm"]["policy"]["w"], torch.arange(5000.0))
    assert [p.name for p in path.parent.iterdir()] == ["last.pt"]


@pytest.mark.slow
def test_a_kill_during_a_write_keeps_the_previous_file(path):
    code = (
        "import os, sys, torch; from pathlib import Path; from core.platform_tuning import lean_imports\n"
        "with lean_imports(): from trainers.run import checkpoint\n"
        "class Half:\n"
        "    def __reduce__(self): os.kill(os.getpid(), 9)\n"
        "checkpoint.save(Path(sys.argv[1]), {'algorithm': torch.zeros(10**6), 'bomb': Half()})"
    )
    assert subprocess.run([sys.executable, "-c", code, str(path)], cwd=os.getcwd()).returncode == -9
    assert checkpoint.load(path)["counters"] == {"frames": 7}


def test_an_error_during_a_write_keeps_the_previous_file_and_no_temporary_one(path):
    with pytest.raises((pickle.PicklingError, AttributeError, TypeError)):
        checkpoint.save(path, {"a": torch.zeros(10), "b": lambda: 0})
    assert checkpoint.load(path)["counters"] == {"frames": 7}
    assert [p.name for p in path.parent.iterdir()] == ["last.pt"]


def test_a_full_disk_is_refused_before_anything_is_written(path, monkeypatch):
    monkeypatch.setattr(checkpoint, "MIN_FREE_BYTES", 2**60)
    with pytest.raises(CheckpointError, match=r"a checkpoint needs .* MiB of free disk space"):
        checkpoint.save(path, PAYLOAD)
    assert checkpoint.load(path)["counters"] == {"frames": 7}


@pytest.mark.parametrize("damage", ["flip", "cut", "text", "empty"])
def test_a_damaged_file_is_refused(path, damage):
    data = bytearray(path.read_bytes())
    if damage == "flip":
        data[len(data) // 2] ^= 16
    new = {"flip": data, "cut": data[: len(data) // 2], "text": b"hello", "empty": b""}[damage]
    path.write_bytes(bytes(new))
    with pytest.raises(CheckpointError, match="damaged") as alone:
        checkpoint.load(path)
    assert "best.pt" not in str(alone.value)
    best = path.with_name("best.pt")
    checkpoint.save(best, PAYLOAD)
    with pytest.raises(CheckpointError, match=f"damaged.*; {best} is there: give it in place of the run$"):
        checkpoint.load(path)
    assert checkpoint.load(best)["counters"] == {"frames": 7}


class Hostile:
    def __reduce__(self):
        return os.mkdir, ("owned",)


@pytest.mark.parametrize("zipped", [True, False])
def test_loading_executes_nothing_in_the_file(tmp_path, monkeypatch, zipped):
    monkeypatch.chdir(tmp_path)
    if zipped:
        torch.save({**PAYLOAD, "format": 1, "extra": Hostile()}, "bad.pt")
    else:
        (tmp_path / "bad.pt").write_bytes(pickle.dumps(Hostile()))
    with pytest.raises(CheckpointError):
        checkpoint.load(tmp_path / "bad.pt")
    assert not (tmp_path / "owned").exists()


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ([1], "not a checkpoint of this project"),
        ({"format": 99}, "format 99"),
        ({"format": 1}, "this version reads format 2"),
        ({"format": 2}, "lacks config"),
    ],
)
def test_a_file_that_is_not_a_checkpoint_is_refused(tmp_path, value, message):
    torch.save(value, tmp_path / "x.pt")
    with pytest.raises(CheckpointError, match=message):
        checkpoint.load(tmp_path / "x.pt")


def test_find_takes_a_run_its_checkpoints_folder_or_a_file(path, tmp_path):
    assert checkpoint.find(tmp_path) == checkpoint.find(tmp_path / "checkpoints") == checkpoint.find(path) == path
    assert checkpoint.find(tmp_path, "best") == path
    with pytest.raises(CheckpointError, match="does not exist"):
        checkpoint.find(tmp_path / "nothing")
    (tmp_path / "bare").mkdir()
    with pytest.raises(CheckpointError, match=r"has no checkpoints/last\.pt"):
        checkpoint.find(tmp_path / "bare")


def test_check_fits_names_the_other_vocabulary_or_width():
    checkpoint.check_fits(PAYLOAD, ["<pad>", "red"], PAYLOAD["widths"])
    with pytest.raises(CheckpointError, match=r"vocabulary.*lacks \['blue'\]"):
        checkpoint.check_fits(PAYLOAD, ["<pad>", "blue", "red"], PAYLOAD["widths"])
    with pytest.raises(CheckpointError, match=r"before \['blue'\] were added to the vocabulary.* evaluate.py"):
        checkpoint.check_fits(PAYLOAD, ["<pad>", "red", "blue"], PAYLOAD["widths"])
    with pytest.raises(CheckpointError, match=r"robot is \[4\] there and \[9\] here"):
        checkpoint.check_fits(PAYLOAD, ["<pad>", "red"], {**PAYLOAD["widths"], "robot": [9]})
