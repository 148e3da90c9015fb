"""The 3D view: what a mouse is at, seen from a camera, and the way that is drawn ahead."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed")

from demo.scene_view import _arc, _hit, _ray_of

DOWN = SimpleNamespace(wxyz=(0.0, 1.0, 0.0, 0.0), position=(0.4, 0.0, 1.0), fov=np.pi / 2, aspect=2.0)  # looks along -z


def test_the_middle_of_the_picture_is_straight_ahead_and_its_edges_are_the_field_of_view():
    origin, direction = _ray_of(DOWN, (0.5, 0.5))
    assert np.allclose(origin, [0.4, 0.0, 1.0])
    assert np.allclose(direction, [0.0, 0.0, -1.0])
    _, right = _ray_of(DOWN, (1.0, 0.5))
    assert np.allclose(right / right[2], [-2.0, 0.0, 1.0])
    _, bottom = _ray_of(DOWN, (0.5, 1.0))
    assert np.allclose(bottom / bottom[2], [0.0, 1.0, 1.0])


def test_a_mouse_is_at_the_nearest_thing_that_it_touches():
    places = np.array([[0.4, 0.0, 0.02], [0.4, 0.0, 0.3], [0.6, 0.0, 0.02]])
    sizes = np.full(3, 0.05)
    assert _hit(_ray_of(DOWN, (0.5, 0.5)), places, sizes) == 1
    assert _hit((np.array([0.6, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])), places, sizes) == 2
    assert _hit((np.array([0.9, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])), places, sizes) is None
    assert _hit((np.array([0.4, 0.0, 1.0]), np.array([0.0, 0.0, 1.0])), places, sizes) is None  # behind


def test_the_way_ahead_ends_where_it_goes():
    way = _arc(np.zeros(3), np.array([1.0, 0.0, 0.0]))
    assert np.allclose(way[-1], [1.0, 0.0, 0.0])
    assert way[:, 2].max() > 0.05
