"""See-through bodies in rendered images."""

from contextlib import closing

import numpy as np
import pybullet as bullet
import pytest

from envs.sim.rendering import Renderer, paint
from human import Camera

CAMERA = Camera(target=[0.0, 0.0, 0.1], distance=1.0, yaw=30.0, pitch=-25.0, fov=50.0, width=123, height=87)
BLUE, OPACITY = (0.1, 0.2, 0.9), 0.4


class Scene:
    """A red floor, and cubes of 10 cm."""

    def __init__(self):
        self.client = bullet.connect(bullet.DIRECT)
        self.box((1.0, 1.0, 0.01), (0, 0, 0), (0.8, 0.1, 0.1, 1))

    def box(self, halves, position, color):
        shape = bullet.createVisualShape(
            bullet.GEOM_BOX, halfExtents=halves, rgbaColor=color, physicsClientId=self.client
        )
        return bullet.createMultiBody(0, -1, shape, position, physicsClientId=self.client)

    def cube(self, position, color):
        return self.box((0.05, 0.05, 0.05), position, color)

    def close(self):
        bullet.disconnect(self.client)


def expected(scene, renderer, cubes):
    """The mean of the images with opaque and without these cubes, weighted by the opacity."""
    opaque = renderer.render(CAMERA).astype(float)
    for cube in cubes:
        paint(cube, (*BLUE, 0), scene.client)
    without = renderer.render(CAMERA).astype(float)
    for cube in cubes:
        paint(cube, (*BLUE, OPACITY), scene.client)
    return OPACITY * opaque + (1 - OPACITY) * without


@pytest.mark.parametrize("places", [[(0, 0, 0.1)], [(-0.2, 0.1, 0.1), (0.2, -0.1, 0.3)], [(0.5, -0.5, 0.4)]])
def test_what_is_behind_a_see_through_cube_shines_through_by_its_opacity(places):
    with closing(Scene()) as scene:
        scene.cube((0.0, 0.15, 0.1), (0.1, 0.8, 0.1, 1))
        cubes = [scene.cube(place, (*BLUE, OPACITY)) for place in places]
        renderer = Renderer(scene.client)
        blended = expected(scene, renderer, cubes)
        plain = renderer.render(CAMERA)
        for cube in cubes:
            renderer.set_see_through(cube, -1, (*BLUE, OPACITY))
        image = renderer.render(CAMERA)
        assert image.shape == (87, 123, 3)
        assert image.dtype == np.uint8
        assert np.abs(image - blended).max() <= 1
        assert (image != plain).any(-1).sum() > 20  # pixels


def test_a_see_through_cube_behind_another_one_changes_nothing():
    with closing(Scene()) as scene:
        scene.box((0.15, 0.15, 0.15), (0, 0, 0.1), (0.1, 0.8, 0.1, 1))
        cube = scene.cube((0, 0, 0.1), (*BLUE, OPACITY))
        renderer = Renderer(scene.client)
        plain = renderer.render(CAMERA)
        renderer.set_see_through(cube, -1, (*BLUE, OPACITY))
        assert np.array_equal(renderer.render(CAMERA), plain)
