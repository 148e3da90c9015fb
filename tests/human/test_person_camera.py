"""Pictures of the person, and the camera's frame."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pybullet as bullet

from core.cameras import CameraFrame, Light
from human.body.person_camera import PersonCamera
from human.body.urdf_model import urdf
from human.synthetic_frames import perturb_camera, sample_light

TARGETS = [(0.33, -0.28, 0.025), (0.44, 0.0, 0.025), (0.55, 0.28, 0.025)]


def paint(person_camera, link, rgba):
    bullet.changeVisualShape(person_camera.body.body, link, rgbaColor=rgba, physicsClientId=person_camera.client)


def test_pictures_do_not_show_the_cone_along_the_finger(camera_setup, person_camera, tmp_path):
    """The same picture as of a person who has none."""
    text = re.sub(r"<visual>(?:(?!</visual>).)*cone\.obj.*?</visual>", "", urdf(), flags=re.S)
    assert "cone.obj" not in text
    meshes = Path(
        bullet.getVisualShapeData(person_camera.body.body, physicsClientId=person_camera.client)[0][4].decode()
    ).parent
    for mesh in meshes.glob("*.obj"):
        (tmp_path / mesh.name).write_bytes(mesh.read_bytes())
    (tmp_path / "human.urdf").write_text(text)
    without = PersonCamera(replace(camera_setup.human, urdf=str(tmp_path / "human.urdf")), camera_setup.furniture)
    for target in TARGETS:
        joints = person_camera.body.solve(target)
        assert np.array_equal(person_camera.picture(joints), without.picture(joints))
    without.close()
    paint(person_camera, person_camera.body.cone, (1, 0, 0, 1))
    shown = person_camera.picture(joints)
    paint(person_camera, person_camera.body.cone, (1, 0, 0, 0))
    assert (shown != person_camera.picture(joints)).any()


def pixel(camera, points):
    """(..., 2) columns and rows at which the camera sees points (..., 3), metres, workspace frame."""
    seen, _ = CameraFrame.of(camera).from_workspace(points, np.zeros(3))
    scale = camera.height / 2 / math.tan(math.radians(camera.fov) / 2)
    return seen[..., :2] / seen[..., 2:] * scale + np.array([camera.width, camera.height]) / 2


def test_the_camera_frame_agrees_with_the_picture(camera_setup, person_camera):
    """The tip of a painted finger is where its frame says."""
    count = bullet.getNumJoints(person_camera.body.body, person_camera.client)
    links = [link for link in range(count) if link_name(person_camera, link) == "r_index2"]
    for target in TARGETS:
        joints = person_camera.body.solve(target)
        plain = person_camera.picture(joints)
        paint(person_camera, links[0], (0, 1, 0, 1))
        rows, columns = np.nonzero((person_camera.picture(joints) != plain).any(-1))
        paint(person_camera, links[0], (0.87, 0.67, 0.54, 1))
        seen = np.stack((columns, rows), 1) + 0.5
        tip, direction = person_camera.body.ray()
        expected = pixel(person_camera.camera, tip - direction * np.array([[0.051], [0.0]]))
        assert np.linalg.norm(seen.mean(0) - expected.mean(0)) < 2.5
        assert np.linalg.norm(seen - expected[1], axis=1).min() < 2.5


def link_name(person_camera, link):
    return bullet.getJointInfo(person_camera.body.body, link, person_camera.client)[12].decode()


def test_transforms_to_and_from_the_camera_frame_are_inverse(person_camera):
    frame, rng = CameraFrame.of(person_camera.camera), np.random.default_rng(0)
    points, directions = rng.normal(size=(2, 5, 3))
    back = frame.to_workspace(*frame.from_workspace(points, directions))
    np.testing.assert_allclose(back, (points, directions), atol=1e-12)
    np.testing.assert_allclose(pixel(person_camera.camera, np.array(person_camera.camera.target)), (64, 64), atol=1e-9)


def test_pictures_depend_on_light_and_camera_and_repeat(person_camera):
    joints, rng = person_camera.body.solve(TARGETS[1]), np.random.default_rng(0)
    plain = person_camera.picture(joints)
    assert np.array_equal(plain, person_camera.picture(joints))
    assert not np.array_equal(plain, person_camera.picture(joints, light=sample_light(rng)))
    assert not np.array_equal(plain, person_camera.picture(joints, camera=perturb_camera(person_camera.camera, rng)))
    assert np.array_equal(plain, person_camera.picture(joints, light=Light()))


def test_hidden_shapes_are_invisible_in_every_posture(camera_setup, person_camera):
    spared = PersonCamera(camera_setup.human, camera_setup.furniture)
    spared.hide_invisible_shapes()
    for target in [*TARGETS, (0.2, 0.4, 0.0), (0.7, -0.4, 0.1)]:
        joints = person_camera.body.solve(target)
        assert np.array_equal(spared.picture(joints), person_camera.picture(joints))
    spared.close()
