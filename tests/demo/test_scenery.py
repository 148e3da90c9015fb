"""What the page shows around the simulation: colours of files, edges, soft shadows, and the fridge."""

from contextlib import closing, redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
import pybullet_data
import pytest

pytest.importorskip("viser", reason="viser is not installed")

import viser

from demo.meshes import cylinder, mesh_of, object_box, soft_shadow
from demo.scene_view import SceneView
from demo.scenery import Scenery
from demo.session import Session
from demo.session_config import make_config
from tools.browser import free_port

PANDA = Path(pybullet_data.getDataPath()) / "franka_panda/meshes/visual"


def palette(mesh):
    """(N, 3) the colours of a mesh."""
    return np.asarray(mesh.visual.material.baseColorTexture)[0]


@pytest.mark.parametrize("link", ["link1", "link5"])
def test_a_file_keeps_the_colours_of_its_materials_and_is_no_metal(link):
    mesh = mesh_of("mesh", (1.0, 1.0, 1.0), PANDA / f"{link}.obj")
    assert palette(mesh).max() > 220  # Franka's arm is white
    assert mesh.visual.material.metallicFactor == 0.0
    assert np.isfinite(mesh.vertex_normals).all()


@pytest.mark.parametrize("mesh", [object_box((0.05, 0.04, 0.03)), cylinder(0.02, 0.05)], ids=["box", "cylinder"])
def test_shapes_are_closed_and_their_edges_crisp(mesh):
    assert len(np.unique(mesh.vertices.round(9), axis=0)) < len(mesh.vertices)  # points are not shared across edges
    closed = mesh.copy()
    closed.merge_vertices()
    assert closed.is_watertight
    assert closed.volume > 0.9 * np.prod(np.ptp(mesh.bounds, axis=0)) * (1 if len(mesh.faces) < 50 else np.pi / 4)


def test_a_shadow_fades_out():
    picture = np.asarray(soft_shadow(0.05, 0.05, 0.02, 0.5).visual.material.baseColorTexture)[..., 3]
    assert picture[0].max() == 0
    assert 100 < picture.max() <= 128
    assert (np.diff(picture[32, 32:].astype(int)) <= 0).all()


def test_the_fridge_is_a_chest_on_the_page_and_boxes_in_the_simulation():
    with redirect_stdout(StringIO()):  # viser prints addresses
        server = viser.ViserServer("127.0.0.1", int(free_port()), verbose=False)
    try:
        with closing(Session(make_config(driver="expert", task="nl_open", workspace="room"))) as session:
            env = session.env
            before = env.render()
            view = SceneView(server, lambda _: None, lambda *_: None)
            scenery = Scenery(view)
            view.show_env(env)
            scenery.show_env(env)
            view.update_poses()
            scenery.show_shadows(np.array([[0.4, 0.1, 0.2], [0.4, 0.1, -9.0]]))
            hidden = {shape.body for mesh, shape in zip(view._meshes, view.shapes, strict=True) if not mesh.visible}
            boxes = {body: box for body, box in env.furniture.boxes.items() if body in hidden}
            assert len(boxes) == len(hidden) == 6  # of the fridge, and the floor
            assert server.scene.get_handle_by_name("/scenery/fridge/shell").visible
            assert server.scene.get_handle_by_name("/scenery/object/0").visible
            assert not server.scene.get_handle_by_name("/scenery/object/1").visible
            assert np.array_equal(env.render(), before)
    finally:
        with redirect_stdout(StringIO()):
            server.stop()
