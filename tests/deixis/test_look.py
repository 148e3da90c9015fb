"""`deixis look`: what is printed and drawn, several cameras at once, and bad input in one sentence."""

import json
import sys
from dataclasses import asdict
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from PIL import Image

from core.cameras import Camera, CameraFrame, project
from deixis import look
from envs.perception import Detections, View
from envs.perception.detections import COLOR_NAMES, NOUN_NAMES
from tests.helpers.refusals import refusal

FRONT = Camera(target=[0.44, 0.0, 0.1], distance=1.25, yaw=140.0, pitch=-48.0, fov=36.0, width=640, height=480)
SIDE = Camera(target=[0.44, 0.0, 0.1], distance=1.25, yaw=15.0, pitch=-48.0, fov=36.0, width=128, height=128)


def detections(*things):
    """Detections of (noun, color, position, standard deviation)."""
    count = len(things)
    nouns, colors = np.full((count, len(NOUN_NAMES)), 0.001), np.full((count, len(COLOR_NAMES)), 0.001)
    for row, (noun, color, _, _) in enumerate(things):
        nouns[row, NOUN_NAMES.index(noun)], colors[row, COLOR_NAMES.index(color)] = 0.99, 0.98
    return Detections(
        positions=np.array([each[2] for each in things]).reshape(count, 3),
        covariances=np.array([each[3] ** 2 * np.eye(3) for each in things]).reshape(count, 3, 3),
        nouns=nouns,
        colors=colors,
        sizes=np.full(count, 0.05),
        yaws=np.zeros(count),
        shares=np.zeros(count),
        targets=np.zeros(count),
        presence=np.linspace(0.99, 0.9, count),
    )


CUBE = ("cube", "red", [0.44, 0.05, 0.025], 0.001)
BALL = ("sphere", "blue", [0.5, -0.1, 0.025], 0.002)


class Stub:
    """A detector that sees a cube and a ball, and keeps the views that it was given."""

    def __call__(self, views):
        self.views = views
        return detections(CUBE, BALL)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, camera in (("front", FRONT), ("side", SIDE)):
        (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(asdict(camera)))
        noise = np.random.default_rng(0).integers(90, 160, (camera.height, camera.width, 3))
        Image.fromarray(noise.astype(np.uint8)).save(f"{name}.png")
    return tmp_path


def test_what_is_seen_is_printed_with_place_and_uncertainty_and_drawn(folder, capsys):
    look.main(["front.png", "--camera", "front.yaml"], Stub())
    first, cube, ball, last = capsys.readouterr().out.splitlines()
    assert first == "front.png: 2 things"
    assert cube.split()[:2] == ["red", "cube"]
    assert "x  0.440  y  0.050  z  0.025 m  within  2.8 mm (95 %)" in cube
    assert "blue sphere" in ball
    assert last == "drawn in seen.png"
    drawn = np.asarray(Image.open("seen.png"))
    assert drawn.shape == (480, 640, 3)
    pixel, _ = project(FRONT, CameraFrame.of(FRONT), np.array(CUBE[2]))
    column, row = pixel.astype(int)
    near = drawn[row - 40 : row + 40, column - 40 : column + 40].astype(int)
    assert ((near[..., 0] > 240) & (near[..., 1] < 10)).sum() > 50  # a red box


def test_pictures_of_several_cameras_are_given_to_the_detector_together_and_drawn_side_by_side(folder, capsys):
    stub = Stub()
    look.main(["front.png", "side.png", "--camera", "front.yaml", "--camera", "side.yaml", "--json"], stub)
    told = json.loads(capsys.readouterr().out)
    assert told["pictures"] == ["front.png", "side.png"]
    assert [each["name"] for each in told["seen"]] == ["red cube", "blue sphere"]
    assert told["seen"][0]["position"] == [0.44, 0.05, 0.025]
    assert told["seen"][0]["covariance"][0] == [1e-06, 0.0, 0.0]
    assert list(stub.views) == ["front.yaml", "side.yaml"]
    assert Image.open("seen.png").size == (1280, 640)


def test_a_large_picture_is_given_to_the_network_at_its_scale_and_points_keep_their_places(folder):
    frame = CameraFrame.of(FRONT)
    point = np.array([0.44, 0.05, 0.025])
    pixel, _ = project(FRONT, frame, point)
    picture = np.zeros((480, 640, 3), np.uint8)
    column, row = pixel.astype(int)
    picture[row - 6 : row + 7, column - 6 : column + 7] = 255
    small = look.for_network(View(picture, FRONT, frame))
    assert small.picture.shape == (small.camera.height, small.camera.width, 3)
    assert small.camera.height % 16 == 0
    assert small.camera.width % 16 == 0
    assert 110 < small.camera.height < 150
    weights = small.picture[..., 0].astype(float)
    rows, columns = np.indices(weights.shape) + 0.5
    middle = np.array([(columns * weights).sum(), (rows * weights).sum()]) / weights.sum()
    assert middle == pytest.approx(project(small.camera, frame, point)[0], abs=0.15)


def test_a_picture_of_the_simulator_is_given_to_the_network_as_it_is():
    view = View(np.zeros((128, 128, 3), np.uint8), SIDE, CameraFrame.of(SIDE))
    assert look.for_network(view) is view


def test_bad_input_is_refused_in_one_sentence(folder, monkeypatch, capsys):
    for name, camera in (
        ("away", {**asdict(FRONT), "yaw": -40.0, "distance": 0.1, "pitch": 10.0}),
        ("wrist", {**asdict(FRONT), "mount": "gripper"}),
        ("nowhere", {"width": 640, "height": 480, "fov": 36.0}),
        ("wide", {**asdict(FRONT), "fov": 300}),
        ("list", [1, 2]),
    ):
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(camera))
    monkeypatch.setitem(sys.modules, "envs.perception.detector", SimpleNamespace(load_detector=lambda weights: Stub()))
    Image.fromarray(np.zeros((480, 640, 3), np.uint8)).save("black.png")
    Image.fromarray(np.full((480, 640, 3), 255, np.uint8)).save("white.png")
    for picture, camera, said in [
        ("side.png", "front.yaml", "side.png has 128 x 128 pixels, but the camera of front.yaml takes 640 x 480"),
        ("front.png", "nowhere.yaml", "nowhere.yaml has no target, so it does not say where its camera is"),
        ("front.png", "away.yaml", "away.yaml sees no table"),
        ("front.png", "wrist.yaml", "wrist.yaml is a camera on the gripper"),
        ("front.png", "wide.yaml", "wide.yaml.fov=300"),
        ("front.png", "list.yaml", "list.yaml is no camera file"),
        ("front.png", "none.yaml", "none.yaml cannot be read"),
        ("none.png", "front.yaml", "none.png cannot be read"),
        ("black.png", "front.yaml", "is black"),
        ("white.png", "front.yaml", "is saturated"),
    ]:
        assert said in refusal(look.cli, monkeypatch, capsys, picture, "--camera", camera)
    assert "give each picture its camera file" in refusal(look.cli, monkeypatch, capsys, "front.png")
    assert "--camera: expected one argument" in refusal(look.cli, monkeypatch, capsys, "front.png", "--camera")
    twice = ("front.png", "front.png", "--camera", "front.yaml", "--camera", "front.yaml")
    assert "is given twice" in refusal(look.cli, monkeypatch, capsys, *twice)
    assert "did you mean 'table'" in refusal(
        look.cli, monkeypatch, capsys, "front.png", "--camera", "front.yaml", "--workspace", "tabel"
    )
    assert not (folder / "seen.png").exists()
