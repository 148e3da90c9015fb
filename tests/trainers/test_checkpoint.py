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


def test_round_trip_leaves_no_other_file(path):
    loaded = checkpoint.load(path)
    assert loaded["counters"] == {"frames": 7}
    assert torch.equal(loaded["algorithm"]["policy"]["w"], torch.arange(5000.0))
    assert [p.name for p in path.parent.iterdir()] == ["last.pt"]


def test_one_killed_in_mid_write_leaves_the_former_whole(path):
    code = (
        "import os, sys, torch; from pathlib import Path; from trainers import checkpoint\n"
        "class Half:\n"
        "    def __reduce__(self): os.kill(os.getpid(), 9)\n"
        "checkpoint.save(Path(sys.argv[1]), {'algorithm': torch.zeros(10**6), 'bomb': Half()})"
    )
    assert subprocess.run([sys.executable, "-c", code, str(path)], cwd=os.getcwd()).returncode == -9
    assert checkpoint.load(path)["counters"] == {"frames": 7}


def test_an_error_in_mid_write_leaves_the_former_whole_and_no_rubbish(path):
    with pytest.raises((pickle.PicklingError, AttributeError, TypeError)):
        checkpoint.save(path, {"a": torch.zeros(10), "b": lambda: 0})
    assert checkpoint.load(path)["counters"] == {"frames": 7}
    assert [p.name for p in path.parent.iterdir()] == ["last.pt"]


def test_a_full_disk_is_seen_beforehand(path, monkeypatch):
    monkeypatch.setattr(checkpoint, "SPARE", 2**60)
    with pytest.raises(CheckpointError, match="MiB are needed"):
        checkpoint.save(path, PAYLOAD)
    assert checkpoint.load(path)["counters"] == {"frames": 7}


@pytest.mark.parametrize("damage", ["flip", "cut", "text", "empty"])
def test_a_damaged_file_is_refused(path, damage):
    data = bytearray(path.read_bytes())
    if damage == "flip":
        data[len(data) // 2] ^= 16
    new = {"flip": data, "cut": data[: len(data) // 2], "text": b"hello", "empty": b""}[damage]
    path.write_bytes(bytes(new))
    with pytest.raises(CheckpointError, match="damaged"):
        checkpoint.load(path)


class Hostile:
    def __reduce__(self):
        return os.mkdir, ("owned",)


@pytest.mark.parametrize("zipped", [True, False])
def test_nothing_in_a_file_is_run(tmp_path, monkeypatch, zipped):
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
    [([1], "no checkpoint of ours"), ({"format": 99}, "format 99"), ({"format": 1}, "lacks config")],
)
def test_files_of_others_are_refused(tmp_path, value, message):
    torch.save(value, tmp_path / "x.pt")
    with pytest.raises(CheckpointError, match=message):
        checkpoint.load(tmp_path / "x.pt")


def test_finding(path, tmp_path):
    assert checkpoint.find(tmp_path) == checkpoint.find(tmp_path / "checkpoints") == checkpoint.find(path) == path
    assert checkpoint.find(tmp_path, "best") == path
    with pytest.raises(CheckpointError, match="does not exist"):
        checkpoint.find(tmp_path / "nothing")
    (tmp_path / "bare").mkdir()
    with pytest.raises(CheckpointError, match=r"holds no checkpoints/last\.pt"):
        checkpoint.find(tmp_path / "bare")


def test_another_robot_or_vocabulary_is_named():
    checkpoint.check_fits(PAYLOAD, ["<pad>", "red"], PAYLOAD["widths"])
    with pytest.raises(CheckpointError, match=r"vocabulary.*lacks \['blue'\]"):
        checkpoint.check_fits(PAYLOAD, ["<pad>", "red", "blue"], PAYLOAD["widths"])
    with pytest.raises(CheckpointError, match=r"robot is \[4\] there and \[9\] here"):
        checkpoint.check_fits(PAYLOAD, ["<pad>", "red"], {**PAYLOAD["widths"], "robot": [9]})
