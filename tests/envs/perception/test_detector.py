import numpy as np
import pytest
import torch

from core.errors import ConfigError
from envs.perception.detections import COLOR_NAMES, NOUN_NAMES, Detections
from envs.perception.detector import fuse, load_detector
from envs.perception.network import HEADS, SightNetwork
from envs.perception.weights_file import load, save
from envs.perception_training.conditions import judge_setup


@pytest.fixture(scope="module")
def detector():
    return load_detector()


def thing(place, *, noun="cube", color="red", sight=(0.0, 0.0, 1.0), blur=0.001, along=0.005, presence=0.9):
    """One detection, whose place is less certain along the line of sight."""
    sight = np.array(sight) / np.linalg.norm(sight)
    return Detections(
        positions=np.array([place], float),
        covariances=(blur**2 * np.eye(3) + along**2 * np.outer(sight, sight))[None],
        nouns=0.02 + 0.8 * np.eye(len(NOUN_NAMES))[[NOUN_NAMES.index(noun)]],
        colors=0.02 + 0.8 * np.eye(len(COLOR_NAMES))[[COLOR_NAMES.index(color)]],
        sizes=np.array([0.05]),
        yaws=np.zeros(1),
        shares=np.zeros(1),
        targets=np.zeros(1),
        presence=np.array([presence]),
    )


def test_fresh_scenes_are_seen_as_they_are(detector):
    judged = judge_setup(detector, ("task=nl_reach",), scenes=20, seed=4)
    told = judged.summary()
    assert told["median_mm"] < 3
    assert told["p95_mm"] < 8
    assert told["noun"] == told["color"] == 1.0
    assert judged.missed <= 1


def test_see_through_targets_are_told_from_objects(detector):
    assert judge_setup(detector, ("task=nl_pick_and_place",), scenes=15, seed=5).summary()["target"] > 0.95


def test_two_cameras_see_the_place_where_their_lines_of_sight_cross():
    front, side = (1.0, 0.0, -1.0), (0.0, 1.0, -1.0)
    cameras = [np.array([-0.6, 0.0, 1.0]), np.array([0.4, -1.0, 1.0])]
    true = np.array([0.4, 0.0, 0.03])
    along = [np.array(each) / np.linalg.norm(each) for each in (front, side)]
    seen = [thing(true + 0.01 * ray, sight=ray, along=0.02) for ray in along]
    both = fuse(seen, cameras)
    assert len(both) == 1
    assert np.linalg.norm(both.positions[0] - true) < 0.004
    assert both.presence[0] > 0.98


def test_a_thing_that_one_camera_takes_to_be_higher_is_not_seen_twice():
    cameras = [np.array([-0.6, 0.0, 1.0]), np.array([0.4, -1.0, 1.0])]
    true = np.array([0.4, 0.0, 0.03])
    to_first = (true - cameras[0]) / np.linalg.norm(true - cameras[0])
    high = thing(true - 0.1 * to_first, sight=to_first)
    right = thing(true, sight=true - cameras[1])
    both = fuse([high, right], cameras)
    assert len(both) == 1
    assert np.linalg.norm(both.positions[0] - true) < 0.01


def test_things_of_other_colours_stay_apart():
    cameras = [np.array([-0.6, 0.0, 1.0]), np.array([0.4, -1.0, 1.0])]
    red, blue = thing((0.4, 0.0, 0.03)), thing((0.4, 0.05, 0.03), color="blue")
    assert len(fuse([red, blue], cameras)) == 2


def test_what_one_camera_sees_faintly_is_not_there():
    assert len(fuse([thing((0.4, 0.0, 0.03), presence=0.2)], [np.array([0.0, 0.0, 1.0])])) == 0


def test_nothing_is_seen_by_no_camera():
    assert len(fuse([Detections.none(), Detections.none()], [np.zeros(3), np.ones(3)])) == 0


def test_a_network_comes_back_from_its_file(tmp_path):
    torch.manual_seed(0)
    network = SightNetwork().eval()
    save(tmp_path / "sight.safetensors", network)
    pictures, cameras = torch.rand(1, 3, 64, 64), torch.rand(1, 15)
    with torch.no_grad():
        one, other = network(pictures, cameras), load(tmp_path / "sight.safetensors")(pictures, cameras)
    assert one.shape == (1, sum(HEADS.values()), 16, 16)
    torch.testing.assert_close(one, other, atol=0.05, rtol=0.05)


def test_files_that_are_no_weights_are_refused(tmp_path):
    wrong = tmp_path / "wrong.safetensors"
    wrong.write_bytes(b"no weights")
    with pytest.raises(ConfigError, match="is damaged, or is no file of weights"):
        load(wrong)
    with pytest.raises(ConfigError, match="cannot be read"):
        load(tmp_path / "missing.safetensors")
