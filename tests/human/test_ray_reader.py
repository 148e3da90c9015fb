"""The ray reader: accuracy of the shipped weights, and invalid weight files."""

from dataclasses import replace

import numpy as np
import pytest

from core.errors import ConfigError
from human.camera import angles_between, scatter
from human.config import HumanConfig
from human.ray_reader import SHIPPED_WEIGHTS, RayNetwork, RayReader, load, save

TARGETS = [(0.33, -0.28, 0.025), (0.44, 0.0, 0.025), (0.55, 0.28, 0.025)]


def test_shipped_weights_read_new_pictures_within_3_degrees_and_3_cm(camera_setup, person_camera):
    reader, rng = RayReader(camera_setup.human), np.random.default_rng(9)
    arms = [person_camera.body.solve(each) for each in scatter(camera_setup, 6, rng)] + [
        person_camera.body.solve(t) for t in TARGETS
    ]
    tips, directions = reader.read(np.stack([person_camera.picture(joints) for joints in arms]))
    true = []
    for joints in arms:
        person_camera.body.pose(joints)
        true.append(person_camera.body.ray())
    true_tips, true_directions = (np.stack(each) for each in zip(*true, strict=True))
    assert np.median(angles_between(directions, true_directions)) < 3
    assert np.median(np.linalg.norm(tips - true_tips, axis=1)) < 0.03
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-6)


@pytest.mark.slow
def test_the_ray_of_a_picture_does_not_depend_on_other_pictures(camera_setup, frames):
    reader = RayReader(camera_setup.human)
    alone, together = reader.read(frames.pictures[3:4]), reader.read(frames.pictures[:6])
    assert all(np.array_equal(one[0], all_[3]) for one, all_ in zip(alone, together, strict=True))


def test_shipped_weights_are_small_and_not_pickled():
    assert SHIPPED_WEIGHTS.stat().st_size < 500_000
    assert b"pickle" not in SHIPPED_WEIGHTS.read_bytes()


@pytest.fixture
def weights(tmp_path, camera_setup):
    path = tmp_path / "weights.npz"
    save(path, RayNetwork(128), camera_setup.human)
    return path


def _truncated(data):
    return data[: len(data) // 2]


def _flipped(data):
    return data[: len(data) // 2] + bytes([data[len(data) // 2] ^ 16]) + data[len(data) // 2 + 1 :]


@pytest.mark.parametrize("spoil", [_truncated, _flipped, lambda data: b"", lambda data: b"not weights at all"])
def test_damaged_weights_are_refused(weights, camera_setup, spoil):
    load(weights, camera_setup.human)
    weights.write_bytes(spoil(weights.read_bytes()))
    with pytest.raises(ConfigError, match=r"^gesture\.weights=\S+ is damaged, or holds other weights: [^\n]+$"):
        RayReader(camera_setup.human, weights)


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
def test_weights_with_other_arrays_are_refused(weights, camera_setup, change):
    with np.load(weights) as archive:
        arrays = {name: archive[name] for name in archive.files}
    change(arrays)
    np.savez(weights, **arrays)
    with pytest.raises(ConfigError, match=r"gesture\.weights"):
        RayReader(camera_setup.human, weights)


def test_missing_weights_are_refused(camera_setup, tmp_path):
    with pytest.raises(ConfigError, match=r"^gesture\.weights=\S+none\.npz is not a file; train it: "):
        RayReader(camera_setup.human, tmp_path / "none.npz")


@pytest.mark.parametrize(
    "change", [{"width": 96, "height": 96}, {"fov": 45.0}, {"yaw": -30.0}, {"target": [1.0, 0.3, 0.26]}]
)
def test_weights_for_another_camera_are_refused(camera_setup, weights, change):
    moved = replace(camera_setup.human, camera=replace(camera_setup.human.camera, **change))
    with pytest.raises(ConfigError, match=r"gesture\.weights=.*workspace\.human\.camera.*human\.camera train"):
        RayReader(moved, weights)


def test_weights_fit_if_person_and_camera_move_together(camera_setup, weights):
    there = HumanConfig(
        urdf=None,
        rest=camera_setup.human.rest,
        position=[camera_setup.human.position[0], camera_setup.human.position[1] + 1, camera_setup.human.position[2]],
        yaw=camera_setup.human.yaw,
        camera=replace(camera_setup.human.camera, target=[1.0, 1.04, 0.26]),
    )
    load(weights, there)


def test_weights_that_describe_more_than_they_hold_are_refused_before_they_are_read(weights, camera_setup):
    with np.load(weights) as archive:
        arrays = {name: archive[name] for name in archive.files}
    np.savez_compressed(weights, **arrays, bomb=np.zeros(2**27, np.uint8))
    assert weights.stat().st_size < 2**20
    with pytest.raises(ConfigError, match="describes more than 200 arrays or 32 MiB"):
        load(weights, camera_setup.human)


@pytest.mark.parametrize("name", ["lens", "stand"])
@pytest.mark.parametrize("value", [np.zeros(0), np.zeros((3, 2)), np.full(6, np.inf), np.array("text")])
def test_weights_with_another_camera_array_are_refused(weights, camera_setup, name, value):
    with np.load(weights) as archive:
        arrays = {each: archive[each] for each in archive.files}
    np.savez(weights, **(arrays | {name: value}))
    with pytest.raises(ConfigError, match=r"gesture\.weights"):
        load(weights, camera_setup.human)
