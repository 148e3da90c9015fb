"""Fixtures of the person in front of the camera."""

import numpy as np
import pytest

from human.body.person_camera import PersonCamera
from human.camera import CameraScene, generate_frames


@pytest.fixture(scope="session")
def camera_setup():
    return CameraScene.of([])


@pytest.fixture(scope="module")
def person_camera(camera_setup):
    camera = PersonCamera(camera_setup.human, camera_setup.furniture)
    yield camera
    camera.close()


@pytest.fixture(scope="module")
def frames(camera_setup):
    """64 frames of two people."""
    return generate_frames(camera_setup, 64, np.random.default_rng(0), bodies=2)
