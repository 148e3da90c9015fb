import numpy as np
import pytest

from core.cameras import Camera, CameraFrame, angles_of, camera_at, project, unproject
from core.errors import ConfigError

FRONT = Camera(target=[0.4, 0.0, 0.1], distance=1.2, yaw=140.0, pitch=-48.0, fov=36.0, width=128, height=96, roll=12.0)
TOP = Camera(target=[0.4, 0.0, 0.1], distance=1.2, yaw=-90.0, pitch=-90.0, fov=36.0, width=128, height=128)


def points(count=50):
    return np.random.default_rng(0).uniform([0.2, -0.3, 0.0], [0.6, 0.3, 0.3], (count, 3))


@pytest.mark.parametrize("camera", [FRONT, TOP])
def test_points_come_back_from_their_pixels_and_depths(camera):
    frame = CameraFrame.of(camera)
    pixels, depths = project(camera, frame, points())
    np.testing.assert_allclose(unproject(camera, frame, pixels, depths), points(), atol=1e-12)


@pytest.mark.parametrize("camera", [FRONT, TOP])
def test_the_target_is_in_the_middle_of_the_picture(camera):
    pixel, depth = project(camera, CameraFrame.of(camera), np.array(camera.target))
    np.testing.assert_allclose(pixel, camera.middle, atol=1e-9)
    assert depth == pytest.approx(camera.distance)


def test_roll_turns_the_camera_about_its_optical_axis():
    level = CameraFrame.of(Camera(**{**vars(FRONT), "roll": 0.0}))
    rolled = CameraFrame.of(FRONT)
    np.testing.assert_allclose(rolled.axes[2], level.axes[2])
    assert np.degrees(np.arccos(rolled.axes[0] @ level.axes[0])) == pytest.approx(12.0)


@pytest.mark.parametrize("camera", [FRONT, TOP])
def test_a_camera_follows_from_its_frame(camera):
    frame = CameraFrame.of(camera)
    again = CameraFrame.of(camera_at(frame, camera))
    np.testing.assert_allclose(again.axes, frame.axes, atol=1e-9)
    np.testing.assert_allclose(again.place, frame.place, atol=1e-9)
    assert angles_of(frame.axes)[1] == pytest.approx(camera.pitch)


def test_a_camera_on_the_gripper_moves_with_it():
    camera = Camera(
        target=[0.0, 0.0, 0.1], distance=0.2, yaw=0.0, pitch=-30.0, fov=60.0, width=64, height=64, mount="gripper"
    )
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    here, there = (CameraFrame.of(camera, (np.array([x, 0.0, 0.3]), turn)) for x in (0.4, 0.5))
    np.testing.assert_allclose(there.place - here.place, [0.1, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(here.place + 0.2 * here.axes[2], np.array([0.4, 0.0, 0.4]), atol=1e-12)


def test_a_camera_on_the_gripper_needs_one():
    with pytest.raises(ConfigError, match="mount=gripper needs a gripper"):
        CameraFrame.of(Camera(**{**vars(FRONT), "mount": "gripper"}))
