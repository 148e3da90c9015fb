"""The camera: what it sees and does not, that frames to learn from differ, and that the network learns and reads."""

import math
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pybullet as bullet
import pytest
import torch

from conf.schema import ConfigError
from human import camera
from human.body.person_camera import CameraFrame, Light, PersonCamera
from human.body.urdf_model import urdf
from human.camera import Setup, generate_frames, main, scatter
from human.config import HumanConfig
from human.pointing_arm import Unreachable
from human.ray_reader import SHIPPED_WEIGHTS, RayNetwork, RayReader, as_input, load, save
from human.synthetic_frames import FrameGenerator, perturb_camera, sample_light
from human.train_reader import angles_between, fit, ray_loss

ROOT = Path(__file__).resolve().parents[2]
TARGETS = [(0.33, -0.28, 0.025), (0.44, 0.0, 0.025), (0.55, 0.28, 0.025)]


@pytest.fixture(scope="module")
def place():
    return Setup.of([])


@pytest.fixture(scope="module")
def sight(place):
    sight = PersonCamera(place.human, place.furniture)
    yield sight
    sight.close()


@pytest.fixture(scope="module")
def few(place):
    """Some frames of two people."""
    return generate_frames(place, 64, np.random.default_rng(0), bodies=2)


def paint(sight, link, rgba):
    bullet.changeVisualShape(sight.body.body, link, rgbaColor=rgba, physicsClientId=sight.client)


# ----------------------------------------------------------------------------------------------- what is in a picture


def test_the_cone_along_the_finger_is_not_seen(place, sight, tmp_path):
    """The same picture as of a person who has none."""
    text = re.sub(r"<visual>(?:(?!</visual>).)*cone\.obj.*?</visual>", "", urdf(), flags=re.S)
    assert "cone.obj" not in text
    meshes = Path(bullet.getVisualShapeData(sight.body.body, physicsClientId=sight.client)[0][4].decode()).parent
    for mesh in meshes.glob("*.obj"):
        (tmp_path / mesh.name).write_bytes(mesh.read_bytes())
    (tmp_path / "human.urdf").write_text(text)
    without = PersonCamera(replace(place.human, urdf=str(tmp_path / "human.urdf")), place.furniture)
    for target in TARGETS:
        joints = sight.body.solve(target)
        assert np.array_equal(sight.picture(joints), without.picture(joints))
    without.close()
    paint(sight, sight.body.cone, (1, 0, 0, 1))
    shown = sight.picture(joints)
    paint(sight, sight.body.cone, (1, 0, 0, 0))
    assert (shown != sight.picture(joints)).any()


def pixel(camera, points):
    """(..., 2) columns and rows at which the camera sees points (..., 3), metres, workspace frame."""
    seen, _ = CameraFrame.of(camera).from_workspace(points, np.zeros(3))
    scale = camera.height / 2 / math.tan(math.radians(camera.fov) / 2)
    return seen[..., :2] / seen[..., 2:] * scale + np.array([camera.width, camera.height]) / 2


def test_labels_fit_the_picture(place, sight):
    """The tip of a painted finger is where its frame says."""
    links = [
        link for link in range(bullet.getNumJoints(sight.body.body, sight.client)) if _name(sight, link) == "r_index2"
    ]
    for target in TARGETS:
        joints = sight.body.solve(target)
        plain = sight.picture(joints)
        paint(sight, links[0], (0, 1, 0, 1))
        rows, columns = np.nonzero((sight.picture(joints) != plain).any(-1))
        paint(sight, links[0], (0.87, 0.67, 0.54, 1))
        seen = np.stack((columns, rows), 1) + 0.5
        tip, direction = sight.body.ray()
        expected = pixel(sight.camera, tip - direction * np.array([[0.051], [0.0]]))
        assert np.linalg.norm(seen.mean(0) - expected.mean(0)) < 2.5
        assert np.linalg.norm(seen - expected[1], axis=1).min() < 2.5


def _name(sight, link):
    return bullet.getJointInfo(sight.body.body, link, sight.client)[12].decode()


def test_rays_go_into_the_cameras_frame_and_back(sight):
    frame, rng = CameraFrame.of(sight.camera), np.random.default_rng(0)
    points, directions = rng.normal(size=(2, 5, 3))
    back = frame.to_workspace(*frame.from_workspace(points, directions))
    np.testing.assert_allclose(back, (points, directions), atol=1e-12)
    np.testing.assert_allclose(pixel(sight.camera, np.array(sight.camera.target)), (64, 64), atol=1e-9)


def test_light_and_camera_change_the_picture_and_the_same_again_does_not(sight):
    joints, rng = sight.body.solve(TARGETS[1]), np.random.default_rng(0)
    plain = sight.picture(joints)
    assert np.array_equal(plain, sight.picture(joints))
    assert not np.array_equal(plain, sight.picture(joints, light=sample_light(rng)))
    assert not np.array_equal(plain, sight.picture(joints, camera=perturb_camera(sight.camera, rng)))
    assert np.array_equal(plain, sight.picture(joints, light=Light()))


def test_what_is_spared_was_never_seen(place, sight):
    spared = PersonCamera(place.human, place.furniture)
    spared.hide_invisible_shapes()
    for target in [*TARGETS, (0.2, 0.4, 0.0), (0.7, -0.4, 0.1)]:
        joints = sight.body.solve(target)
        assert np.array_equal(spared.picture(joints), sight.picture(joints))
    spared.close()


def test_frames_to_learn_from_are_all_different_and_the_same_for_the_same_seed(place, few):
    flat = few.pictures.reshape(len(few.pictures), -1)
    assert len(np.unique(flat, axis=0)) == len(flat)
    np.testing.assert_allclose(np.linalg.norm(few.directions, axis=1), 1)
    again = generate_frames(place, 5, np.random.default_rng(0), bodies=2)
    assert np.array_equal(again.pictures, few.pictures[:5])
    assert np.array_equal(again.tips, few.tips[:5])


def test_people_to_learn_from_are_built_differently(place):
    studio = FrameGenerator(place.human, (), place.objects.object_area, np.random.default_rng(0), bodies=3)
    eyes = [body.eyes[2] for body in studio.bodies]
    studio.close()
    assert max(eyes) - min(eyes) > 0.01


# ------------------------------------------------------------------------------------------------------- the network


def test_a_handful_of_frames_is_learned(few):
    every = np.arange(len(few.tips))

    def loss(network):
        with torch.no_grad():
            return float(ray_loss(network(as_input(few.pictures)), few, every))

    before = loss(fit(few, 1, seed=0))
    assert loss(fit(few, 25, seed=0)) < 0.6 * before


def test_training_gives_the_same_bits_for_the_same_seed(few):
    one, again, other = (fit(few, 2, seed).state_dict() for seed in (3, 3, 4))
    assert all(torch.equal(value, again[name]) for name, value in one.items())
    assert not all(torch.equal(value, other[name]) for name, value in one.items())


def test_shipped_weights_read_fresh_pictures(place, sight):
    reader, rng = RayReader(place.human), np.random.default_rng(9)
    arms = [sight.body.solve(each) for each in scatter(place, 6, rng)] + [sight.body.solve(t) for t in TARGETS]
    tips, directions = reader.read(np.stack([sight.picture(joints) for joints in arms]))
    true = []
    for joints in arms:
        sight.body.pose(joints)
        true.append(sight.body.ray())
    true_tips, true_directions = (np.stack(each) for each in zip(*true, strict=True))
    assert np.median(angles_between(directions, true_directions)) < 3
    assert np.median(np.linalg.norm(tips - true_tips, axis=1)) < 0.03
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-6)


def test_a_picture_is_read_the_same_beside_any_others(place, few):
    reader = RayReader(place.human)
    alone, together = reader.read(few.pictures[3:4]), reader.read(few.pictures[:6])
    assert all(np.array_equal(one[0], all_[3]) for one, all_ in zip(alone, together, strict=True))


def test_weights_are_small_and_not_pickled():
    assert SHIPPED_WEIGHTS.stat().st_size < 500_000
    assert b"pickle" not in SHIPPED_WEIGHTS.read_bytes()


# ------------------------------------------------------------------------------------------------- the weights' file


@pytest.fixture
def weights(tmp_path, place):
    path = tmp_path / "weights.npz"
    save(path, RayNetwork(128), place.human)
    return path


def _truncated(data):
    return data[: len(data) // 2]


def _flipped(data):
    return data[: len(data) // 2] + bytes([data[len(data) // 2] ^ 16]) + data[len(data) // 2 + 1 :]


@pytest.mark.parametrize("spoil", [_truncated, _flipped, lambda data: b"", lambda data: b"not weights at all"])
def test_damaged_weights_are_refused(weights, place, spoil):
    load(weights, place.human)
    weights.write_bytes(spoil(weights.read_bytes()))
    with pytest.raises(ConfigError, match=r"^gesture\.weights=\S+ is damaged, or holds other weights: [^\n]+$"):
        RayReader(place.human, weights)


@pytest.mark.parametrize(
    "change",
    [
        lambda arrays: arrays.pop("lens"),
        lambda arrays: arrays.pop("layers.0.weight"),
        lambda arrays: arrays.update({"layers.0.weight": np.zeros((2, 2))}),
        lambda arrays: arrays.update(middle=np.array([0, np.nan, 0])),
        lambda arrays: arrays.update(middle=np.array([print], dtype=object)),
        lambda arrays: arrays.update(stray=np.zeros(3)),
    ],
)
def test_other_arrays_are_refused(weights, place, change):
    with np.load(weights) as archive:
        arrays = {name: archive[name] for name in archive.files}
    change(arrays)
    np.savez(weights, **arrays)
    with pytest.raises(ConfigError, match=r"gesture\.weights"):
        RayReader(place.human, weights)


def test_missing_weights_are_refused(place, tmp_path):
    with pytest.raises(ConfigError, match=r"^gesture\.weights=\S+none\.npz is not a file; train it: "):
        RayReader(place.human, tmp_path / "none.npz")


@pytest.mark.parametrize(
    "change", [{"width": 96, "height": 96}, {"fov": 45.0}, {"yaw": -30.0}, {"target": [1.0, 0.3, 0.26]}]
)
def test_weights_for_another_camera_are_refused(place, weights, change):
    moved = replace(place.human, camera=replace(place.human.camera, **change))
    with pytest.raises(ConfigError, match=r"gesture\.weights=.*workspace\.human\.camera.*human\.camera train"):
        RayReader(moved, weights)


def test_weights_fit_wherever_person_and_camera_are_put_together(place, weights):
    there = HumanConfig(
        urdf=None,
        rest=place.human.rest,
        position=[place.human.position[0], place.human.position[1] + 1, place.human.position[2]],
        yaw=place.human.yaw,
        camera=replace(place.human.camera, target=[1.0, 1.04, 0.26]),
    )
    load(weights, there)


# --------------------------------------------------------------------------------------------------- the command line


def test_training_and_trying_from_the_command_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(camera, "VALIDATION_BODIES", 1)
    monkeypatch.setattr("human.synthetic_frames.BODIES", 2)
    out = tmp_path / "deep" / "weights.npz"
    main(["train", f"out={out}", "frames=70", "epochs=2"])
    assert "epoch 2/2: loss" in capsys.readouterr().out
    found = main(["evaluate", f"weights={out}", "scenes=5", "objects=3"])
    assert found["true_ray"] == 1
    assert main(["evaluate", f"weights={out}", "scenes=3", "aim=area"])["true_ray"] == 1
    assert "frames/s rendered and read" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "nothing is not a command"),
        (["trian"], "did you mean 'train'"),
        (["train", "frames"], "key=value"),
        (["train", "frames=0"], "frames=0 is out of range"),
        (["train", "frames=many"], "frames=many"),
        (["train", "epoch=3"], "did you mean 'epochs'"),
        (["train", "out=/proc/none/x.npz"], "out=/proc/none/x.npz can't be written"),
        (["train", "workspace.human.camera.width=100"], "a multiple of 16"),
        (["evaluate", "aim=sky"], "aim=sky is not known"),
        (["evaluate", "workspace=table"], "has no person"),
        (["evaluate", "workspace.human.camera=null"], "needs workspace.human.camera"),
        (["evaluate", "workspace.human.camra.yaw=3"], "is not a known key"),
        (["evaluate", "weights=nowhere.npz"], "gesture.weights=nowhere.npz is not a file"),
        (["evaluate", "objects=12", "task.spacing=0.4"], "do not fit"),
    ],
)
def test_bad_words_are_told_in_one_line(words, message, tmp_path):
    if words and words[0] == "train" and not any(word.startswith("out=") for word in words):
        words = [*words, f"out={tmp_path / 'w.npz'}"]
    with pytest.raises(ConfigError) as caught:
        main(words)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_places_that_nobody_can_point_at_are_told_in_one_line(place, monkeypatch):
    def refuse(self, target, style="finger"):
        raise Unreachable("target: the person can't point there")

    monkeypatch.setattr("human.body.Body.solve", refuse)
    with pytest.raises(ConfigError, match=r"^workspace\.object_area=\[.*holds places out of reach: target"):
        main(["evaluate", "scenes=1"])
    with pytest.raises(ConfigError, match=r"^workspace\.object_area=\[.*can't point at any of 1000 places$"):
        generate_frames(place, 1, np.random.default_rng(0), bodies=1)


def test_training_leaves_the_weights_that_come_with_the_project_alone(place, monkeypatch, tmp_path):
    before = SHIPPED_WEIGHTS.stat().st_mtime_ns
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(camera, "VALIDATION_BODIES", 1)
    monkeypatch.setattr("human.synthetic_frames.BODIES", 1)
    main(["train", "frames=2", "epochs=1"])
    load(tmp_path / "pointing.npz", place.human)
    assert SHIPPED_WEIGHTS.stat().st_mtime_ns == before


def test_errors_end_with_exit_code_1_and_without_a_traceback():
    command = [sys.executable, "-m", "human.camera", "evaluate", "scenes=-1"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("error: scenes=-1 is out of range")
    assert "Traceback" not in done.stderr
