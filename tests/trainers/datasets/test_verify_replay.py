"""Replays of recordings, and the differences that they report."""

from __future__ import annotations

import shutil

import h5py
import pytest

import record
from core.errors import ConfigError
from tests.helpers.recordings import FORMATS

pytestmark = pytest.mark.slow


MOVED_OBJECTS = ["task=nl_pick_and_place", "robot=panda"]


@pytest.mark.parametrize("form", FORMATS)
def test_a_replay_is_equal_bit_for_bit(recordings, capsys, form):
    record.main([f"replay={recordings[form]}"])
    assert "3 episodes" in (said := capsys.readouterr().out)
    assert "all states as recorded, bit for bit" in said


def test_recordings_of_a_policy_and_of_moved_objects_replay_bit_for_bit(tiny_run, tmp_path, capsys):
    record.main([f"checkpoint={tiny_run}", "episodes=2", "format=lerobot", f"out={tmp_path / 'policy'}"])
    record.main(["expert=true", "episodes=1", "format=minari", f"out={tmp_path / 'placed-v0'}", *MOVED_OBJECTS])
    for name in ("policy", "placed-v0"):
        record.main([f"replay={tmp_path / name}"])
    assert capsys.readouterr().out.count("bit for bit") == 2


def test_a_replay_reports_the_greatest_difference(recordings, tmp_path):
    copy = shutil.copytree(recordings["minari"], tmp_path / "copy")
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
