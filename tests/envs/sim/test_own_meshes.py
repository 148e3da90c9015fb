"""Collision meshes of people's robots are where Bullet itself has them."""

from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pybullet as bullet
import pytest

from core.errors import ConfigError
from envs.sim.robot import load
from envs.sim.robot_config import urdf_path
from tests.helpers.own_robots import own_robot
from tests.helpers.thorough import some

DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="1"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="{count}">{points}</float_array>
<technique_common><accessor source="#a" count="{vertices}" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
</accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="{triangles}"><input semantic="VERTEX" source="#v" offset="0"/><p>{faces}</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><matrix>{matrix}</matrix><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
TURNED = "0 -1 0 0.02 1 0 0 0 0 0 1 0.01 0 0 0 1"
STL = np.dtype([("normal", "<f4", 3), ("points", "<f4", (3, 3)), ("attribute", "<u2")])


def ellipsoid(count, scale):
    points = np.random.default_rng(count).normal(size=(count, 3))
    return scale * (points / np.linalg.norm(points, axis=1, keepdims=True) * [0.05, 0.03, 0.08] + [0.01, 0.02, 0.03])


def write_dae(path, scale=1.0, matrix=TURNED):
    points = ellipsoid(60, scale)
    faces = " ".join(map(str, range(60)))
    numbers = " ".join(f"{x:.7g}" for x in points.ravel())
    moved = np.array(matrix.split(), float)
    moved[[3, 7, 11]] *= scale
    filled = {"count": 180, "points": numbers, "vertices": 60, "triangles": 20, "faces": faces}
    path.write_text(DAE.format(**filled, matrix=" ".join(map(str, moved))))


def write_stl(path, triangles=30, scale=1.0):
    whole = np.zeros(triangles, STL)
    whole["points"] = ellipsoid(3 * triangles, scale).reshape(-1, 3, 3)
    path.write_bytes(bytes(80) + triangles.to_bytes(4, "little") + whole.tobytes())


def mesh(name, extra="", origin='xyz="0.01 0.02 0.05" rpy="0.3 0.2 0.1"', collision=""):
    return f'<collision{collision}><origin {origin}/><geometry><mesh filename="{name}"{extra}/></geometry></collision>'


BOX = '<collision><origin xyz="0 0.1 0"/><geometry><box size="0.02 0.3 0.02"/></geometry></collision>'
MILLIMETRES = ' scale="0.001 0.001 0.001"'
# name -> collision elements of link 3 of a kuka
LINKS = {
    "a mesh": mesh("own/a.dae"),
    "in millimetres": mesh("own/mm.dae", MILLIMETRES),
    "stretched": mesh("own/a.dae", ' scale="1 2 0.5"'),
    "mirrored": mesh("own/a.dae", ' scale="1 -1 1"'),
    "after a box": BOX + mesh("own/a.dae"),
    "before a box": mesh("own/mm.dae", MILLIMETRES) + BOX,
    "two beside an STL": mesh("own/a.dae") + mesh("own/small.stl", MILLIMETRES) + mesh("own/mm.dae", MILLIMETRES),
    "beside an OBJ of two parts": mesh("own/two.obj") + mesh("own/a.dae"),
    "upper case": mesh("own/A.DAE"),
    "package path": mesh("package://own/a.dae"),
    "concave": mesh("own/a.dae", collision=' concave="yes"'),
    "a large STL": mesh("own/large.stl", MILLIMETRES),
    "a large STL beside a mesh": mesh("own/large.stl", MILLIMETRES) + mesh("own/a.dae"),
}


@pytest.fixture(scope="module")
def meshes(tmp_path_factory):
    folder = tmp_path_factory.mktemp("meshes") / "own"
    folder.mkdir()
    write_dae(folder / "a.dae")
    write_dae(folder / "A.DAE")
    write_dae(folder / "mm.dae", scale=1000.0)
    write_stl(folder / "small.stl", scale=1000.0)
    write_stl(folder / "large.stl", triangles=4000, scale=1000.0)
    corners = [f"v {0.1 * part + x} {y} {z}" for part in (0, 2) for x, y, z in ellipsoid(6, 1.0)]
    faces = ["o one", "f 1 2 3", "f 4 5 6", "o two", "f 7 8 9", "f 10 11 12"]
    (folder / "two.obj").write_text("\n".join([*corners, *faces, ""]))
    return folder


@contextmanager
def connected():
    client = bullet.connect(bullet.DIRECT)
    try:
        yield client
    finally:
        bullet.disconnect(client)


def boxes(body, client):
    """The bounding box of the base and of each link."""
    links = range(-1, bullet.getNumJoints(body, client))
    return np.array([bullet.getAABB(body, link, client) for link in links])


def check_as_bullets_own(config):
    with connected() as client:
        found = boxes(load(config, client, visuals=False), client)
        bullet.resetSimulation(client)
        path, flags = str(urdf_path(config)), bullet.URDF_IGNORE_VISUAL_SHAPES
        own = bullet.loadURDF(path, config.base, useFixedBase=True, flags=flags, physicsClientId=client)
        np.testing.assert_allclose(found, boxes(own, client), rtol=0, atol=1e-4)


def with_collisions(tmp_path, meshes, elements, link="lbr_iiwa_link_3", rename=None):
    """A kuka with these collision elements in one of its links."""

    def change(text):
        start = text.index(f'<link name="{link}"')
        end = text.index("</link>", start)
        part = text[start:end]
        part = part[: part.index("<collision>")] + elements
        text = text[:start] + part + text[end:]
        return text.replace(f'"{link}"', f'"{rename}"') if rename else text

    config = own_robot(tmp_path / "robot", "kuka", change)
    (tmp_path / "robot" / "own").symlink_to(meshes)
    return config


@pytest.mark.parametrize("name", some(LINKS, 4))
def test_collision_meshes_of_a_link_are_where_bullet_has_them(tmp_path, meshes, name):
    check_as_bullets_own(with_collisions(tmp_path, meshes, LINKS[name]))


@pytest.mark.parametrize("name", some(["after a box", "in millimetres", "two beside an STL"], 1))
def test_collision_meshes_of_the_base_are_where_bullet_has_them(tmp_path, meshes, name):
    check_as_bullets_own(with_collisions(tmp_path, meshes, LINKS[name], link="lbr_iiwa_link_0"))


@pytest.mark.parametrize("rename", some(["arm/link", "link 3", "../up", "Glied_ä"], 2))
def test_a_link_may_have_any_name(tmp_path, meshes, rename):
    check_as_bullets_own(with_collisions(tmp_path, meshes, LINKS["a mesh"], rename=rename))


def test_a_mesh_that_was_edited_is_read_again(tmp_path, meshes):
    folder = tmp_path / "own"
    folder.mkdir()
    write_dae(folder / "a.dae")
    config = with_collisions(tmp_path, folder, LINKS["a mesh"])
    check_as_bullets_own(config)
    write_dae(folder / "a.dae", scale=2.0)
    check_as_bullets_own(config)


def test_a_mesh_that_is_missing_is_named(tmp_path, meshes):
    config = with_collisions(tmp_path, meshes, mesh("own/a.dae") + mesh("own/none.dae"))
    with connected() as client, pytest.raises(ConfigError, match=r"cannot find 'own/none\.dae'"):
        load(config, client, visuals=False)


def test_a_relative_path_is_enough(tmp_path, meshes, monkeypatch):
    config = with_collisions(tmp_path, meshes, LINKS["two beside an STL"])
    monkeypatch.chdir(tmp_path)
    check_as_bullets_own(type(config)(**{**vars(config), "urdf": str(Path(config.urdf).relative_to(tmp_path))}))
