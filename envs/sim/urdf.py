"""Copies of URDFs that worlds load faster: unused joints fixed, meshes as hulls, and a magnet on the flange.

The copies are entries of `core.file_cache`. Ask for them anew for each world: the files can be deleted at any time, and
a URDF or mesh that was edited gives another copy.
"""

from __future__ import annotations

import io
import math
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pybullet as bullet
from numpy.typing import NDArray

from core.file_cache import Source, cached_folder, cached_text

MODULE = Path(__file__)  # a source of what it makes
LARGE = 160_000  # bytes of an STL file from which on its hull is made small
DIRECTIONS = 200  # a hull keeps the outermost point in each: within 1 % of its size
MOVABLE = ("revolute", "continuous", "prismatic")
STL = np.dtype([("normal", "<f4", 3), ("points", "<f4", (3, 3)), ("attribute", "<u2")])  # a triangle of a binary file
MAGNET_MASS = 0.1  # kg
Load = Callable[[int], int]  # client -> body, its links not merged
Numbers = tuple[float, ...]


def _read(urdf: Path) -> Any:
    """Return the tree of a URDF, its meshes with absolute paths. Raises ElementTree.ParseError."""
    tree, folders = ElementTree.parse(urdf), urdf.resolve().parents
    for mesh in tree.iter("mesh"):
        mesh.set("filename", _absolute(str(mesh.get("filename")), folders))
    return tree


def _absolute(mesh: str, folders: Sequence[Path]) -> str:
    """Return the mesh's absolute path, searched beside the URDF and above it, as Bullet does, or what was given."""
    name = mesh.removeprefix("package://")
    return next((path for folder in folders if os.path.isfile(path := os.path.join(folder, name))), mesh)


def _text(tree: Any) -> str:
    file = io.BytesIO()
    tree.write(file, encoding="utf-8")
    return file.getvalue().decode()


# ---- unused joints, and large meshes


def simplified(urdf: Path, joints: tuple[str, ...]) -> Path:
    """Return the path of a copy with unused joints fixed, and small hulls in place of large collision meshes.

    It is that of the URDF itself if there is nothing to simplify. joints: those that the robot uses. All others are
    fixed at 0.
    """
    try:
        tree = _read(urdf)
    except ElementTree.ParseError:
        return urdf  # Bullet reports what is wrong with it
    root = tree.getroot()
    unused = [joint for joint in root.iter("joint") if joint.get("type") in MOVABLE and joint.get("name") not in joints]
    for joint in unused:
        joint.set("type", "fixed")
    meshes = root.findall("link/collision/geometry/mesh")
    large = [mesh for mesh in meshes if _is_large(Path(str(mesh.get("filename"))))]
    for mesh in large:
        mesh.set("filename", str(_small_hull(Path(str(mesh.get("filename"))))))
    return cached_text(urdf.name, _text(tree)) if unused or large else urdf


def _is_large(mesh: Path) -> bool:
    """Return whether it is a large binary STL file: 80 bytes, the number of triangles, and the triangles."""
    if mesh.suffix.lower() != ".stl" or not mesh.is_file() or mesh.stat().st_size < LARGE:
        return False
    with mesh.open("rb") as file:
        file.seek(80)
        count = int.from_bytes(file.read(4), "little")
    return mesh.stat().st_size == 84 + count * STL.itemsize


def _small_hull(mesh: Path) -> Path:
    """Return an OBJ file with the outermost points of an STL file."""
    name = f"{mesh.stem}.obj"

    def make(folder: Path) -> None:
        points = np.unique(np.fromfile(mesh, STL, offset=84)["points"].reshape(-1, 3), axis=0)
        outermost = np.unique((_directions() @ points.T).argmax(1))
        (folder / name).write_text(obj(points[outermost].astype(float).tolist()))

    return cached_folder("hull", [MODULE, name, mesh], make) / name


def _directions() -> NDArray[np.float32]:
    """(DIRECTIONS, 3) unit vectors, evenly spread over the sphere on a Fibonacci spiral."""
    index = np.arange(DIRECTIONS) + 0.5
    z, turn = 1 - 2 * index / DIRECTIONS, np.pi * (1 + 5**0.5) * index
    radius = np.sqrt(1 - z**2)
    return np.stack((radius * np.cos(turn), radius * np.sin(turn), z), axis=1).astype(np.float32)


# ---- hulls of COLLADA meshes


def with_hulls(urdf: Path, load: Load) -> Path:
    """Return a copy of the URDF with OBJ hulls as collision meshes and without visuals.

    It is the URDF itself if that has no COLLADA collision meshes. load: loads the URDF in a client.
    """
    try:
        tree = _read(urdf)
    except ElementTree.ParseError:
        return urdf  # Bullet reports what is wrong with it
    files = {str(mesh.get("filename")) for mesh in tree.getroot().findall("link/collision/geometry/mesh")}
    if not any(file.endswith(".dae") for file in files):
        return urdf
    meshes = [Path(file) for file in sorted(files) if Path(file).is_file()]
    sources: list[Source] = [MODULE, urdf.name, _text(tree), *meshes]
    return cached_folder("hulls", sources, lambda folder: _write_hulls(tree, urdf.name, load, folder)) / urdf.name


def _write_hulls(tree: Any, name: str, load: Load, folder: Path) -> None:
    meshes = {link.get("name"): link.findall("collision/geometry/mesh") for link in tree.iter("link")}
    client = bullet.connect(bullet.DIRECT)
    try:
        body = load(client)
        for link in range(bullet.getNumJoints(body, client)):
            for i, mesh in enumerate(meshes.get(bullet.getJointInfo(body, link, client)[12].decode(), ())):
                hull = folder / f"{link}_{i}.obj"
                hull.write_text(obj(_vertices(body, link, i, client)))
                mesh.set("filename", hull.name)
    finally:
        bullet.disconnect(client)
    for element in tree.iter("link"):
        for visual in element.findall("visual"):
            element.remove(visual)
    tree.write(folder / name)


def _vertices(body: int, link: int, shape: int, client: int) -> list[list[float]]:
    """Return the hull's points in the mesh's frame. Bullet gives them in the frame of the link's centre of mass."""
    points = bullet.getMeshData(body, link, shape, bullet.MESH_DATA_SIMULATION_MESH, client)[1]
    position, quaternion = bullet.getCollisionShapeData(body, link, client)[shape][5:7]
    rotation = np.reshape(bullet.getMatrixFromQuaternion(quaternion), (3, 3))
    return ((np.array(points) - position) @ rotation).tolist()


def obj(vertices: list[list[float]]) -> str:
    """Return the points as an OBJ file. Bullet takes the hull of the points of faces, so each point is in a face."""
    count = len(vertices)
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices]
    faces = [f"f {i + 1} {(i + 1) % count + 1} {(i + 2) % count + 1}" for i in range(0, count, 3)]
    return "\n".join([*rows, *faces, ""])


# ---- the magnet


def with_magnet(urdf: Path, link: str, *, end: Numbers, way: Numbers, radius: float, length: float) -> Path:
    """Return the URDF with a cylinder on one of its links.

    Args:
        urdf: of the robot.
        link: that carries the cylinder.
        end: (3,) of the middle of its far face, metres, in the frame of the link.
        way: (3,) the unit vector along which that face points, in the frame of the link.
        radius, length: metres.
    """
    tree = _read(urdf)
    root = tree.getroot()
    body = ElementTree.SubElement(root, "link", name="deixis_magnet")
    inertial = ElementTree.SubElement(body, "inertial")
    ElementTree.SubElement(inertial, "mass", value=str(MAGNET_MASS))
    spin = str(MAGNET_MASS * radius**2)
    ElementTree.SubElement(inertial, "inertia", ixx=spin, iyy=spin, izz=spin, ixy="0", ixz="0", iyz="0")
    for kind in ("visual", "collision"):
        part = ElementTree.SubElement(body, kind)
        shape = ElementTree.SubElement(part, "geometry")
        ElementTree.SubElement(shape, "cylinder", radius=str(radius), length=str(length))
        if kind == "visual":
            material = ElementTree.SubElement(part, "material", name="deixis_magnet")
            ElementTree.SubElement(material, "color", rgba="0.25 0.25 0.28 1")
    joint = ElementTree.SubElement(root, "joint", name="deixis_magnet_mount", type="fixed")
    ElementTree.SubElement(joint, "parent", link=link)
    ElementTree.SubElement(joint, "child", link="deixis_magnet")
    middle = [a - length / 2 * b for a, b in zip(end, way, strict=True)]
    pitch, yaw = math.atan2(math.hypot(way[0], way[1]), way[2]), math.atan2(way[1], way[0])
    ElementTree.SubElement(joint, "origin", xyz=" ".join(map(str, middle)), rpy=f"0 {pitch} {yaw}")
    return cached_text(urdf.name, _text(tree))
