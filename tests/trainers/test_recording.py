"""Demonstrations in the formats of others: what is in them, and that they come about again."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import imageio.v3 as imageio
import minari
import numpy as np
import pytest
from pyarrow import parquet

import record
import train
from conf.overrides import compose
from conf.schema import ConfigError
from envs import make_env
from envs.experts import expert
from tests.helpers.tiny_run import TINY
from trainers.datasets import dataset, lerobot_stats
from trainers.datasets.demonstrations import demonstrate
from trainers.datasets.parquet import Shards, as_column
from trainers.rollout.evaluation import Interrupted

ROOT = Path(record.__file__).parent
POINTED = ["task=nl_reach_gesture", "gesture.switch=1.0", "gesture.noise_deg=3"]
PLACED = ["task=nl_pick_and_place", "robot=panda"]
FORMATS = ("lerobot", "minari")


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    train.run(compose([*TINY, "task.max_steps=12"]), folder)
    return folder


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A recording of three episodes of the expert with a finger, in each format."""
    folder = tmp_path_factory.mktemp("recorded")
    for form in FORMATS:
        record.main(["expert=true", "episodes=3", f"format={form}", f"out={folder / form}-v3", "seed=5", *POINTED])
    return {form: folder / f"{form}-v3" for form in FORMATS}


@pytest.fixture(scope="module")
def episodes():
    """The same episodes, as they came."""
    env = make_env(POINTED)
    yield list(demonstrate(env, expert(env), 3, 5))
    env.close()


@pytest.mark.parametrize("form", FORMATS)
def test_what_is_read_is_what_came(recorded, episodes, form):
    about, kept = dataset.read(recorded[form])
    last = None if form == "minari" else -1  # LeRobot has no place for what is seen after the last action
    for theirs, ours in zip(kept, episodes, strict=True):
        assert (theirs.seed, theirs.sentence) == (ours.seed, ours.sentence)
        np.testing.assert_array_equal(theirs.actions, ours.actions)
        for name in ("observations", "labels", "outcomes"):
            kept_values, values = getattr(theirs, name), getattr(ours, name)
            assert kept_values.keys() == values.keys()
            for key, value in values.items():
                wanted = value if name == "outcomes" else value[:last]
                np.testing.assert_array_equal(kept_values[key].reshape(wanted.shape), wanted)
    assert about["episodes"] == len(episodes) == 3
    assert about["steps"] == sum(map(len, episodes))
    assert about["success_at_end"] == np.mean([episode.success for episode in episodes])


def test_the_finger_moves_on_in_what_is_recorded(episodes):
    """Else a replay that ignores it would not be noticed."""
    assert any(len(np.unique(episode.labels["referent"])) > 1 for episode in episodes)
    assert {"gesture", "instruction", "robot", "objects", "objects_mask", "hold"} <= episodes[0].observations.keys()


@pytest.mark.parametrize("form", FORMATS)
def test_a_recording_comes_about_again_bit_for_bit(recorded, capsys, form):
    record.main([f"replay={recorded[form]}"])
    assert "3 episodes" in (said := capsys.readouterr().out)
    assert "all states as recorded, bit for bit" in said


def test_a_policy_and_things_that_are_moved_come_about_again_too(run, tmp_path, capsys):
    record.main([f"checkpoint={run}", "episodes=2", "format=lerobot", f"out={tmp_path / 'policy'}"])
    record.main(["expert=true", "episodes=1", "format=minari", f"out={tmp_path / 'placed'}", *PLACED])
    for name in ("policy", "placed"):
        record.main([f"replay={tmp_path / name}"])
    assert capsys.readouterr().out.count("bit for bit") == 2


def test_minari_itself_gives_back_the_environment_and_the_same_states(recorded, episodes, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(recorded["minari"].parent))
    loaded = minari.load_dataset("minari-v3")
    assert (loaded.total_episodes, loaded.total_steps) == (3, sum(map(len, episodes)))
    env = loaded.recover_environment()
    told = loaded.storage.get_episode_metadata(range(3))
    for episode, metadata in zip(loaded.iterate_episodes(), told, strict=True):
        seen, info = env.reset(seed=metadata["seed"])
        assert info["sentence"] == metadata["sentence"]
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


def test_a_lerobot_dataset_has_the_published_layout(recorded, episodes):
    folder, steps = recorded["lerobot"], sum(map(len, episodes))
    info = json.loads((folder / "meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"], info["robot_type"]) == ("v3.0", 20, "kuka")
    assert (info["total_episodes"], info["total_frames"], info["splits"]) == (3, steps, {"train": "0:3"})
    place = {"chunk_index": 0, "file_index": 0}
    rows = parquet.read_table(folder / info["data_path"].format(**place)).to_pydict()
    assert set(rows) == set(info["features"])
    for name, feature in info["features"].items():
        width = feature["shape"][0]
        assert all(np.size(value) == width for value in rows[name])
        assert feature["names"] is None or len(feature["names"]) == width
    assert rows["index"] == list(range(steps))
    assert rows["timestamp"][:3] == [0.0, np.float32(0.05), np.float32(0.1)]
    told = parquet.read_table(folder / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [row["dataset_to_index"] - row["dataset_from_index"] for row in told] == list(map(len, episodes))
    assert [row["tasks"] for row in told] == [[episode.sentence] for episode in episodes]
    tasks = parquet.read_table(folder / "meta/tasks.parquet")
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == [tasks.column_names[1]]
    said = dict(zip(*(tasks[i].to_pylist() for i in (0, 1)), strict=True))
    assert [said[task] for task in dict.fromkeys(rows["task_index"])] == list(
        dict.fromkeys(e.sentence for e in episodes)
    )


def test_its_statistics_are_those_of_all_steps(recorded, episodes):
    known = json.loads((recorded["lerobot"] / "meta/stats.json").read_text())["action"]
    actions = np.concatenate([episode.actions for episode in episodes]).astype(np.float64)
    for name, value in (("min", actions.min(0)), ("max", actions.max(0)), ("mean", actions.mean(0))):
        np.testing.assert_allclose(known[name], value)
    np.testing.assert_allclose(known["std"], actions.std(0))
    assert known["count"] == [len(actions)]
    parts = [lerobot_stats.of_values(actions[:7]), lerobot_stats.of_values(actions[7:])]
    np.testing.assert_allclose(lerobot_stats.merge(*parts)["std"], actions.std(0))


def test_lerobot_itself_reads_it(recorded, episodes):
    library = pytest.importorskip("lerobot.datasets.lerobot_dataset")
    loaded = library.LeRobotDataset("deixis/recorded", root=recorded["lerobot"])
    assert (loaded.num_episodes, loaded.num_frames) == (3, sum(map(len, episodes)))
    np.testing.assert_array_equal(loaded[2]["observation.state"].numpy(), episodes[0].observations["robot"][2])
    assert loaded[0]["task"] == episodes[0].sentence


def test_pictures_are_of_the_episode_and_change_nothing_in_it(tmp_path):
    few = ["expert=true", "episodes=1", "workspace.camera.width=65", "workspace.camera.height=48", "camera=true"]
    for form in FORMATS:
        record.main([*few, f"format={form}", f"out={tmp_path / form}"])
        record.main([f"replay={tmp_path / form}"])  # in a world without anything to be drawn
    (episode,) = minari.MinariDataset(tmp_path / "minari" / "data").iterate_episodes()
    pictures = episode.observations["camera"]
    assert pictures.shape == (len(episode) + 1, 48, 65, 3)
    assert abs(pictures[0].astype(int) - pictures[-1]).max() > 50  # the arm has moved
    (path,) = (tmp_path / "lerobot").rglob("*.mp4")
    film = imageio.imread(path)
    assert film.shape == (len(episode), 48, 64, 3)
    assert abs(film.astype(int) - pictures[:-1, :, :64]).mean() < 6
    (feature,) = [
        f for f in json.loads((tmp_path / "lerobot/meta/info.json").read_text())["features"].values() if "info" in f
    ]
    assert feature["shape"] == [48, 64, 3]


def test_a_replay_tells_what_is_not_as_recorded(recorded, tmp_path):
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


@pytest.mark.parametrize("form", FORMATS)
def test_an_interrupted_recording_leaves_nothing(tmp_path, form):
    env = make_env()
    about = {"config": {}, "actor": "", "instruction": "", "robot": "", "fps": 20, "names": {}, "gym": None}
    asked = iter([False, True])
    with pytest.raises(Interrupted):
        dataset.write(tmp_path / "it", form, env, expert(env), 5, 0, about, stop=lambda: next(asked))
    env.close()
    assert not list(tmp_path.iterdir())


def test_tables_go_on_in_another_file(tmp_path):
    shards = Shards(tmp_path, files=2, megabytes=0.01)
    values = np.random.default_rng(0).random((5, 100, 9))
    places = [shards.write({"values": as_column(value)}) for value in values]
    shards.close()
    assert places == [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0)] or len(set(places)) > 2
    assert len(list(tmp_path.rglob("*.parquet"))) == len(set(places))
    for place in set(places):
        rows = parquet.read_table(tmp_path / "chunk-{:03d}/file-{:03d}.parquet".format(*place))["values"].to_pylist()
        mine = [value for value, where in zip(values, places, strict=True) if where == place]
        np.testing.assert_array_equal(rows, np.concatenate(mine))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "checkpoint=<run dir or file> is missing"),
        (["checkpoint=/nowhere"], "checkpoint=/nowhere does not exist"),
        (["expert=true", "format=hdf"], "format=hdf is not known; choose from lerobot, minari"),
        (["expert=true", "episodes=0"], "episodes=0"),
        (["expert=true", "task=nl_pus"], "did you mean 'nl_push'"),
        (["expert=true", "task.slots=3"], "task.slots is not a known key"),
        (["checkpoint={run}", "robot=panda"], "trained with robot=kuka"),
        (["checkpoint={run}", "gesture=ray", "workspace=collabtable"], "gesture is .* and gesture it was trained with"),
        (["expert=true", "out={run}"], "exists already"),
        (["replay=/nowhere"], "/nowhere does not exist"),
        (["replay={run}"], "not a recording of this project: it has no deixis.json"),
        (["replay={run}", "episodes=3"], "episodes=3: replay=<dir> takes no other key"),
    ],
)
def test_bad_input_gets_one_clear_message(run, words, said):
    with pytest.raises(ConfigError, match=said) as error:
        record.main([word.format(run=run) for word in words])
    assert "\n" not in str(error.value)


def test_a_format_without_its_library_is_refused_with_the_remedy(monkeypatch, tmp_path):
    for library, form in (("minari", "minari"), ("pyarrow", "lerobot")):
        monkeypatch.setitem(sys.modules, library, None)
        with pytest.raises(
            ConfigError, match=rf"need {library}, which is not installed: pip install -e \"\.\[record\]\""
        ):
            record.main(["expert=true", f"format={form}", f"out={tmp_path / 'it'}"])
    assert not list(tmp_path.iterdir())


def test_record_prints_its_help_and_refuses_bad_input_in_one_line():
    words = [sys.executable, "record.py"]
    told = subprocess.run([*words, "--help"], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert "format=lerobot" in told.stdout
    refused = subprocess.run([*words, "episodes=2"], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert (refused.returncode, refused.stderr.count("\n")) == (1, 1)
    assert refused.stderr.startswith("error: checkpoint=")
