"""Checkpoints that are whole and hold something wrong."""

from __future__ import annotations

import pytest
import torch

from trainers.run import checkpoint
from trainers.run.checkpoint import CheckpointError

PAYLOAD = {
    "config": {"seed": 0, "robot": {"name": "kuka"}},
    "vocabulary": ["<pad>", "red"],
    "widths": {"robot": [4], "action": [3]},
    "algorithm": {"policy": {"w": torch.arange(5.0)}, "optimizer": {"state": {0: {"exp_avg": torch.ones(2)}}}},
    "counters": {"frames": 7},
    "rng": torch.get_rng_state(),
}


def with_value(key, value):
    """The payload with another value under a dotted key."""
    *outer, last = key.split(".")
    changed = node = dict(PAYLOAD)
    for name in outer:
        node[name] = dict(node[name])
        node = node[name]
    node[last] = value
    return changed


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("vocabulary", 5, "vocabulary=5 must be a list of distinct words"),
        ("vocabulary", ["red", "red"], "vocabulary=.* must be a list of distinct words"),
        ("algorithm", [], r"algorithm=\[\] must be a group"),
        ("algorithm", {"policy": {"w": 5}}, "algorithm.policy.w=5 must be a tensor"),
        ("algorithm.policy.w", torch.tensor([1.0, float("nan")]), "not finite in algorithm.policy.w"),
        ("algorithm.optimizer", {"state": {0: {"m": torch.tensor(float("inf"))}}}, "not finite in algorithm.optimizer"),
        ("rng", torch.zeros(3), "rng=.* must be the state of torch's generator"),
        ("rng", torch.zeros(5056, dtype=torch.uint8), "rng=.* must be the state of torch's generator"),
        ("counters", {}, r"counters=\{\} must be a group with the number of frames"),
        ("counters", {"frames": -1}, "counters=.* must be a group with the number of frames"),
        ("widths", {"robot": "4"}, "widths=.* must be a list of whole numbers"),
        ("config", ["seed"], "config=.* must be a group of keys"),
        ("config.seed", "${oc.env:HOME}", r"config.*seed=\$\{oc.env:HOME\}; interpolations"),
        ("config.robot._target_", "os.system", "the key robot.'_target_'"),
        ("config.seed", torch.zeros(2), "seed of type Tensor"),
    ],
)
def test_wrong_content_is_named_with_its_key(tmp_path, key, value, message):
    checkpoint.save(tmp_path / "x.pt", with_value(key, value))
    with pytest.raises(CheckpointError, match=message.replace("config.*seed", "seed")) as caught:
        checkpoint.load(tmp_path / "x.pt")
    assert str(tmp_path / "x.pt") in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_good_checkpoint_is_read(tmp_path):
    checkpoint.save(tmp_path / "x.pt", PAYLOAD)
    assert checkpoint.load(tmp_path / "x.pt")["counters"] == {"frames": 7}
