"""See-through bodies in rendered images."""

from contextlib import closing

import numpy as np
import pybullet as bullet
import pytest

from envs.sim.rendering import Renderer, link_number, paint
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


def test_each_see_through_cube_has_its_own_opacity_and_is_drawn_where_it_is_now():
    with closing(Scene()) as scene, closing(Renderer(scene.client)) as renderer:
        floor = renderer.render(CAMERA).astype(float)
        cubes = [scene.cube(place, (*BLUE, 1)) for place in ((-0.2, 0.1, 0.1), (0.2, -0.1, 0.1))]
        for cube in cubes:
            bullet.resetBasePositionAndOrientation(cube, (0, 0, 9), (0, 0, 0, 1), physicsClientId=scene.client)
            renderer.set_see_through(cube, -1, (*BLUE, OPACITY))
        assert np.array_equal(renderer.render(CAMERA), floor)  # they are out of the picture
        for cube, place in zip(cubes, ((-0.2, 0.1, 0.1), (0.2, -0.1, 0.1)), strict=True):
            bullet.resetBasePositionAndOrientation(cube, place, (0, 0, 0, 1), physicsClientId=scene.client)
        for opacity in (OPACITY, 0.9):
            renderer.set_see_through(cubes[1], -1, (*BLUE, opacity))
            image, weights = renderer.render(CAMERA), {cubes[0]: OPACITY, cubes[1]: opacity}
            renderer.clear()
            photo = renderer.photograph(CAMERA, None)
            for cube in cubes:
                renderer.set_see_through(cube, -1, (*BLUE, weights[cube]))
                mask = photo.links == link_number(cube, -1)
                blended = weights[cube] * photo.colors[mask] + (1 - weights[cube]) * floor[mask]
                assert mask.sum() > 20
                assert np.abs(image[mask] - blended).max() <= 1


def test_a_closed_renderer_keeps_no_client():
    with closing(Scene()) as scene:
        cube = scene.cube((0, 0, 0.1), (*BLUE, OPACITY))
        renderer = Renderer(scene.client)
        renderer.set_see_through(cube, -1, (*BLUE, OPACITY))
        renderer.render(CAMERA)
        stage = renderer._copies._stage
        assert bullet.isConnected(stage)
        renderer.close()
        renderer.close()
        assert not bullet.isConnected(stage)


def test_a_see_through_cube_behind_another_one_changes_nothing():
    with closing(Scene()) as scene:
        scene.box((0.15, 0.15, 0.15), (0, 0, 0.1), (0.1, 0.8, 0.1, 1))
        cube = scene.cube((0, 0, 0.1), (*BLUE, OPACITY))
        renderer = Renderer(scene.client)
        plain = renderer.render(CAMERA)
        renderer.set_see_through(cube, -1, (*BLUE, OPACITY))
        assert np.array_equal(renderer.render(CAMERA), plain)
