"""Training frames of the ray reader."""

import numpy as np
import pytest

from human.camera import generate_frames
from human.synthetic_frames import FrameGenerator


@pytest.mark.slow
def test_frames_differ_and_repeat_with_the_seed(camera_setup, frames):
    flat = frames.pictures.reshape(len(frames.pictures), -1)
    assert len(np.unique(flat, axis=0)) == len(flat)
    np.testing.assert_allclose(np.linalg.norm(frames.directions, axis=1), 1)
    again = generate_frames(camera_setup, 5, np.random.default_rng(0), bodies=2)
    assert np.array_equal(again.pictures, frames.pictures[:5])
    assert np.array_equal(again.tips, frames.tips[:5])


def test_people_differ_in_their_proportions(camera_setup):
    generator = FrameGenerator(
        camera_setup.human, (), area=camera_setup.objects.object_area, rng=np.random.default_rng(0), bodies=3
    )
    eyes = [body.eyes[2] for body in generator.bodies]
    generator.close()
    assert max(eyes) - min(eyes) > 0.01
