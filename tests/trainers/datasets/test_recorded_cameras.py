"""Pictures of several cameras in recordings: written, read back, calibrated, and refused by name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.cameras import Camera, CameraFrame, calibration_of, project
from core.errors import ConfigError
from core.overrides import compose
from envs.config import read_env
from envs.experts import expert
from envs.workspace_env import WorkspaceEnv
from record import parse
from tests.helpers.recordings import FORMATS
from trainers.datasets import dataset
from trainers.datasets.demonstrations import demonstrate

NAMES = ["film", "front", "wrist"]
SMALL = [f"{key}={size}" for camera in ("film", "front") for key, size in
         ((f"workspace.cameras.{camera}.width", 48), (f"workspace.cameras.{camera}.height", 33))]  # fmt: skip


@pytest.fixture(scope="module")
def env():
    env = WorkspaceEnv(read_env(compose(["task=nl_reach", *SMALL])).without_curriculum(), render=True)
    yield env
    env.close()


@pytest.fixture(scope="module")
def episode(env):
    return next(demonstrate(env, expert(env), 1, 3, NAMES))


@pytest.mark.parametrize("form", FORMATS)
def test_pictures_of_every_camera_are_written_and_read_back(env, episode, form, tmp_path):
    cameras = env.config.workspace.named_cameras("cameras", NAMES)
    about = {"config": {}, "actor": "", "instruction": "", "robot": "", "fps": 20, "names": {}, "gym": None}
    dataset.write(tmp_path / "it-v0", form, env, iter([episode]), 1, 3, about, cameras)
    metadata, (read,) = dataset.read(tmp_path / "it-v0", NAMES)
    assert metadata["cameras"] == {name: calibration_of(camera) for name, camera in cameras.items()}
    assert read.observations.keys() == episode.observations.keys()
    assert list(read.images) == NAMES
    for name, pictures in read.images.items():
        assert len(pictures) == len(episode) + (form == "minari")
        height, width, _ = pictures[0].shape
        for one, other in zip(pictures, episode.images[name], strict=False):
            assert abs(one.astype(int) - other[:height, :width]).mean() < 8
    with pytest.raises(ConfigError, match=r"cameras=\[frnt\]: .* has no camera frnt; did you mean 'front'"):
        dataset.read(tmp_path / "it-v0", ["frnt"])


def test_a_seed_gives_the_same_pictures_and_the_wrist_moves(env, episode):
    again = next(demonstrate(env, expert(env), 1, 3, ["wrist", "front"]))
    for name, pictures in again.images.items():
        assert np.array_equal(pictures, episode.images[name])
    assert (again.images["wrist"][0] != again.images["wrist"][-1]).mean() > 0.05


@pytest.mark.parametrize("mount", ["workspace", "gripper"])
def test_a_calibration_projects_places_as_the_camera_does(mount):
    angles = {"yaw": 140.0, "pitch": -48.0, "roll": 11.0}
    camera = Camera(target=[0.4, 0.1, 0.2], distance=1.1, fov=30.0, width=64, height=48, mount=mount, **angles)
    known, points = calibration_of(camera), np.array([[0.4, 0.1, 0.2], [0.5, 0.0, 0.1]])
    seen = (points - known["place"]) @ np.transpose(known["axes"]) @ np.transpose(known["matrix"])
    pixels, _ = project(camera, CameraFrame.of(camera, (np.zeros(3), np.eye(3))), points)
    np.testing.assert_allclose(seen[:, :2] / seen[:, 2:], pixels)


def test_films_have_a_camera_that_is_fixed_in_the_workspace(env):
    workspace = env.config.workspace
    with pytest.raises(ConfigError, match=r"cameras=\['front'\] must have film"):
        replace(workspace, cameras={"front": workspace.cameras["front"]})
    with pytest.raises(ConfigError, match=r"cameras.film.mount=gripper must be workspace"):
        replace(workspace, cameras={"film": replace(workspace.film, mount="gripper")})


def test_a_camera_with_the_name_of_an_observation_is_refused(env, tmp_path):
    cameras = {"robot": env.config.workspace.film}
    with pytest.raises(ConfigError, match=r"cameras=\[robot\]: robot is the name of an observation"):
        dataset.write(tmp_path / "it-v0", "minari", env, iter([]), 1, 3, {"gym": None}, cameras)


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (["cameras=[front, wrist]"], ["front", "wrist"]),
        (["cameras=top"], ["top"]),
        (["cameras=[]"], []),
    ],
)
def test_cameras_are_named_on_the_command_line(words, names):
    assert parse(["expert=true", *words])[0].cameras == names
