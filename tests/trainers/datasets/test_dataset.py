"""Recordings: what is read equals what was recorded."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from core.errors import ConfigError, Interrupted
from envs import make_env
from envs.experts import expert
from tests.helpers.recordings import FORMATS
from trainers.datasets import dataset
from trainers.datasets.demonstrations import demonstrate

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("form", FORMATS)
def test_reading_returns_what_was_recorded(recordings, recorded_episodes, form):
    metadata, read_episodes = dataset.read(str(recordings[form]))
    last = None if form == "minari" else -1  # LeRobot does not store the observation after the last action
    for read, expected in zip(read_episodes, recorded_episodes, strict=True):
        assert (read.seed, read.sentence) == (expected.seed, expected.sentence)
        np.testing.assert_array_equal(read.actions, expected.actions)
        for name in ("observations", "labels", "outcomes"):
            read_values, values = getattr(read, name), getattr(expected, name)
            assert read_values.keys() == values.keys()
            for key, value in values.items():
                wanted = value if name == "outcomes" else value[:last]
                np.testing.assert_array_equal(read_values[key].reshape(wanted.shape), wanted)
    assert metadata["episodes"] == len(recorded_episodes) == 3
    assert metadata["steps"] == sum(map(len, recorded_episodes))
    assert metadata["success_at_end"] == np.mean([episode.success for episode in recorded_episodes])


@pytest.mark.parametrize("form", FORMATS)
def test_a_file_that_is_cut_is_damaged_not_a_traceback(recordings, tmp_path, form):
    folder = Path(shutil.copytree(recordings[form], tmp_path / recordings[form].name))
    for data in (*folder.rglob("*.parquet"), *folder.rglob("*.hdf5")):
        data.write_bytes(data.read_bytes()[:100])
    with pytest.raises(ConfigError, match=f"{folder.name} is damaged: ") as error:
        list(dataset.read(folder)[1])
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("form", FORMATS)
def test_an_interrupted_recording_leaves_no_directory(tmp_path, form):
    env = make_env()
    about = {"config": {}, "actor": "", "instruction": "", "robot": "", "fps": 20, "names": {}, "gym": None}
    asked = iter([False, True])
    with pytest.raises(Interrupted):
        dataset.write(
            tmp_path / "it", form, env, demonstrate(env, expert(env), 5, 0), 5, 0, about, stop=lambda: next(asked)
        )
    env.close()
    assert not list(tmp_path.iterdir())
