"""Pretrained policies by name."""

from __future__ import annotations

from pathlib import Path

import pytest

from trainers.config import read_training
from trainers.export import policy_file
from trainers.run import checkpoint


def test_a_name_stands_for_the_folder_of_the_policy():
    assert "nl_reach_kuka" in policy_file.names()
    for path in ("nl_reach_kuka", "pretrained/nl_reach_kuka"):
        assert policy_file.folder_of(Path(path)) == policy_file.FOLDER / "nl_reach_kuka"
    assert policy_file.folder_of(Path("elsewhere/nl_reach_kuka")) is None


@pytest.mark.parametrize("name", policy_file.names())
def test_every_pretrained_policy_records_the_options_of_its_config(name):
    config = checkpoint.load(checkpoint.find(Path(name)))["config"]
    assert config["choices"]["robot"] == config["robot"]["name"]


@pytest.mark.parametrize("name", policy_file.names())
def test_the_config_of_every_pretrained_policy_is_read(name):
    saved = checkpoint.load(checkpoint.find(Path(name)))["config"]
    assert read_training(saved).algo.name == saved["algo"]["name"]
