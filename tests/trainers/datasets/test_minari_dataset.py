"""Minari datasets: rebuilt environments, and images in both formats."""

from __future__ import annotations

import json
import re
from pathlib import Path

import imageio.v3 as imageio
import minari
import numpy as np
import pytest
from torchrl.data.datasets import MinariExperienceReplay

import record
from tests.helpers.recordings import FORMATS

pytestmark = pytest.mark.slow


def test_minari_rebuilds_the_environment_and_its_states(recordings, recorded_episodes, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(recordings["minari"].parent))
    loaded = minari.load_dataset("minari-v3")
    assert (loaded.total_episodes, loaded.total_steps) == (3, sum(map(len, recorded_episodes)))
    env = loaded.recover_environment()
    assert env.spec.id == loaded.spec.env_spec.id == "Deixis/NLReachGesture-v0"
    episode_metadata = loaded.storage.get_episode_metadata(range(3))
    for episode, metadata in zip(loaded.iterate_episodes(), episode_metadata, strict=True):
        seen, info = env.reset(seed=metadata["seed"])
        assert env.unwrapped.sentence == metadata["sentence"]
        for t, action in enumerate(episode.actions):
            for key, value in seen.items():
                np.testing.assert_array_equal(episode.observations[key][t], value)
            assert loaded.observation_space["robot"].contains(episode.observations["robot"][t])
            seen, reward, terminated, truncated, info = env.step(action)
            came = (episode.rewards[t], episode.terminations[t], episode.truncations[t])
            assert came == (np.float32(reward), terminated, truncated)
        np.testing.assert_array_equal(episode.observations["objects"][-1], seen["objects"])
        assert metadata["success"] == info["is_success"]
    env.close()


def test_torchrl_reads_the_recording(recordings, recorded_episodes, monkeypatch, tmp_path):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(recordings["minari"].parent))
    data = MinariExperienceReplay("minari-v3", 16, root=tmp_path, load_from_local_minari=True, download=False)
    frames, first = data[:], minari.load_dataset("minari-v3")[0]
    assert len(frames) == sum(map(len, recorded_episodes))
    for key, values in first.observations.items():  # names and shapes: TorchRL 0.14.1 has zeros as values
        assert frames["observation", key].shape[1:] == frames["next", "observation", key].shape[1:] == values.shape[1:]
        assert data.metadata["observation_space"][key].shape == values.shape[1:]
    assert frames["next", "info", "success"].shape == frames["next", "info", "referent"].shape == frames.shape


def test_a_replay_buffer_is_filled_with_the_recording(recordings, recorded_episodes):
    text = (Path(__file__).parents[3] / "docs" / "recording.md").read_text()
    (code,) = (block for block in re.findall(r"```python\n(.*?)```", text, re.S) if "ReplayBuffer" in block)
    scope = {"dataset": minari.MinariDataset(recordings["minari"] / "data")}
    exec(code, scope)
    frames, first = scope["buffer"][:], scope["dataset"][0]
    assert len(frames) == sum(map(len, recorded_episodes))
    for key, values in first.observations.items():
        np.testing.assert_array_equal(frames[key][: len(first)], values[:-1])
        np.testing.assert_array_equal(frames["next", key][: len(first)], values[1:])
    np.testing.assert_array_equal(frames["action"][: len(first)], first.actions)
    np.testing.assert_array_equal(frames["next", "reward"][: len(first), 0], first.rewards)
    assert frames["next", "done"].sum() == len(recorded_episodes)


def test_images_show_the_episode_and_do_not_change_it(tmp_path):
    few = [
        "expert=true",
        "episodes=1",
        "workspace.cameras.film.width=65",
        "workspace.cameras.film.height=48",
        "cameras=[film]",
    ]
    for form in FORMATS:
        record.main([*few, f"format={form}", f"out={tmp_path / form}-v0"])
        record.main([f"replay={tmp_path / form}-v0"])  # in a world without anything to be drawn
    (episode,) = minari.MinariDataset(tmp_path / "minari-v0" / "data").iterate_episodes()
    pictures = episode.observations["film"]
    assert pictures.shape == (len(episode) + 1, 48, 65, 3)
    assert abs(pictures[0].astype(int) - pictures[-1]).max() > 50  # the arm has moved
    (path,) = (tmp_path / "lerobot-v0").rglob("*.mp4")
    film = imageio.imread(path)
    assert film.shape == (len(episode), 48, 64, 3)
    assert abs(film.astype(int) - pictures[:-1, :, :64]).mean() < 6
    (feature,) = [
        f for f in json.loads((tmp_path / "lerobot-v0/meta/info.json").read_text())["features"].values() if "info" in f
    ]
    assert feature["shape"] == [48, 64, 3]
