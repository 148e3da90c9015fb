"""Policy files: round trip, damage and foreign files."""

from __future__ import annotations

import shutil

import pytest
import torch
from safetensors.torch import save_file

import evaluate
from core.errors import ConfigError
from trainers.export import policy_file
from trainers.run import checkpoint
from trainers.run.checkpoint import CheckpointError


@pytest.fixture(scope="module")
def policy(tmp_path_factory):
    """A directory with a small policy file."""
    folder = tmp_path_factory.mktemp("policy")
    payload = {"config": {"seed": 0}, "vocabulary": ["<pad>"], "widths": {"robot": [4]}}
    weights = {"w": torch.linspace(0, 1, 1000), "log_std": torch.zeros(3)}
    packed = policy_file.pack(payload | {"algorithm": {"policy": weights}}, checkpoint.FORMAT)
    (folder / policy_file.NAME).write_bytes(packed)
    return folder


def test_pack_and_unpack_round_trip(policy):
    payload = policy_file.unpack(policy / policy_file.NAME)
    assert payload["config"] == {"seed": 0}
    assert payload["format"] == checkpoint.FORMAT
    assert torch.equal(payload["algorithm"]["policy"]["w"], torch.linspace(0, 1, 1000))


@pytest.mark.parametrize("damage", ["weight", "text", "header", "cut", "words", "empty"])
def test_a_damaged_policy_is_refused(policy, tmp_path, damage):
    path = shutil.copytree(policy, tmp_path / "copy") / "policy.safetensors"
    data = bytearray(path.read_bytes())
    place = {"weight": len(data) - 7, "text": data.index(b"seed") + 9, "header": 3}.get(damage, 0)
    data[place] ^= 2
    path.write_bytes({"cut": data[:-100], "words": b"hello", "empty": b""}.get(damage, data))
    with pytest.raises(ConfigError, match="is damaged") as error:
        evaluate.main([f"checkpoint={path.parent}"])
    assert "\n" not in str(error.value)


def test_another_safetensors_file_is_refused(tmp_path):
    save_file({"w": torch.zeros(3)}, tmp_path / "other.safetensors", {"format": "pt"})
    with pytest.raises(CheckpointError, match="not a checkpoint of this project: its metadata has no deixis"):
        checkpoint.load(tmp_path / "other.safetensors")
