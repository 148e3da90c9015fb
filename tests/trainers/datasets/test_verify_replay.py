"""Replays of recordings, and the differences that they report."""

from __future__ import annotations

import shutil

import h5py
import pytest

import record
import train
from core.errors import ConfigError
from core.overrides import compose
from tests.helpers.recordings import FORMATS, record_formats
from tests.helpers.tiny_run import TINY

pytestmark = pytest.mark.slow


MOVED_OBJECTS = ["task=nl_pick_and_place", "robot=panda"]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    train.run(compose([*TINY, "task.max_steps=12"]), folder)
    return folder


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    return record_formats(tmp_path_factory.mktemp("recorded"))


@pytest.mark.parametrize("form", FORMATS)
def test_a_replay_is_equal_bit_for_bit(recorded, capsys, form):
    record.main([f"replay={recorded[form]}"])
    assert "3 episodes" in (said := capsys.readouterr().out)
    assert "all states as recorded, bit for bit" in said


def test_recordings_of_a_policy_and_of_moved_objects_replay_bit_for_bit(run, tmp_path, capsys):
    record.main([f"checkpoint={run}", "episodes=2", "format=lerobot", f"out={tmp_path / 'policy'}"])
    record.main(["expert=true", "episodes=1", "format=minari", f"out={tmp_path / 'placed'}", *MOVED_OBJECTS])
    for name in ("policy", "placed"):
        record.main([f"replay={tmp_path / name}"])
    assert capsys.readouterr().out.count("bit for bit") == 2


def test_a_replay_reports_the_greatest_difference(recorded, tmp_path):
    copy = shutil.copytree(recorded["minari"], tmp_path / "copy")
    with h5py.File(copy / "data/main_data.hdf5", "a") as file:
        kept = file["episode_1/actions"][0]
        file["episode_1/actions"][0] = -kept
    with pytest.raises(ConfigError, match=r"1 of 3 episodes differ .* of episode 1, by \d.* with tolerance=0"):
        record.main([f"replay={copy}"])
    with h5py.File(copy / "data/main_data.hdf5", "a") as file:
        file["episode_1/actions"][0] = kept
        file["episode_1/rewards"][0] += 1e-3
    with pytest.raises(ConfigError, match=r"the most in reward of episode 1, by 0\.001"):
        record.main([f"replay={copy}"])
    record.main([f"replay={copy}", "tolerance=0.01"])
