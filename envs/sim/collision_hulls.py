"""Replaces COLLADA collision meshes by their convex hulls, as OBJ files.

Bullet uses only the convex hull of a COLLADA mesh, but reads the whole mesh for every world in a third of a second, and
keeps it (30 MiB for a jaco). Here each hull is read once and written as a small OBJ file, which later processes use.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pybullet as bullet

from envs.sim.mesh_cache import kept_folder

Load = Callable[[int], int]  # client -> body, its links not merged

_made: dict[Path, Path] = {}


def lean(urdf: Path, load: Load) -> Path:
    """A copy of the URDF with OBJ hulls as collision meshes and without visuals; the URDF itself if it has no COLLADA
    collision meshes. load: loads the URDF in a client."""
    if urdf not in _made:
        try:
            tree = ElementTree.parse(urdf)
        except ElementTree.ParseError:
            return urdf  # Bullet reports what is wrong with it
        meshes = {link.get("name"): link.findall("collision/geometry/mesh") for link in tree.iter("link")}
        files = [str(mesh.get("filename")) for found in meshes.values() for mesh in found]
        if any(file.endswith(".dae") for file in files):
            sources = [urdf, *(path for file in sorted(set(files)) if (path := Path(resolved(file, urdf))).is_file())]
            folder = kept_folder(sources, lambda folder: _write(tree, meshes, urdf, load, folder))
            _made[urdf] = folder / urdf.name
        else:
            _made[urdf] = urdf
    return _made[urdf]


def resolved(mesh: str, urdf: Path) -> str:
    """The mesh's absolute path, searched beside the URDF and above it, as Bullet does; unchanged if there is none."""
    name = mesh.removeprefix("package://")
    return next((str(folder / name) for folder in urdf.resolve().parents if (folder / name).is_file()), mesh)


def _write(tree: Any, meshes: dict, urdf: Path, load: Load, folder: Path) -> None:
    client = bullet.connect(bullet.DIRECT)
    try:
        body = load(client)
        for link in range(bullet.getNumJoints(body, client)):
            name = bullet.getJointInfo(body, link, client)[12].decode()
            for i, mesh in enumerate(meshes.get(name, ())):
                hull = folder / f"{urdf.stem}_{name}_{i}.obj"
                hull.write_text(obj(_vertices(body, link, i, client)))
                mesh.set("filename", hull.name)
    finally:
        bullet.disconnect(client)
    for element in tree.iter("link"):
        for visual in element.findall("visual"):
            element.remove(visual)
    tree.write(folder / urdf.name)


def _vertices(body: int, link: int, shape: int, client: int) -> list[list[float]]:
    """The hull's points in the mesh's frame. Bullet gives them in the frame of the link's centre of mass."""
    points = bullet.getMeshData(body, link, shape, bullet.MESH_DATA_SIMULATION_MESH, client)[1]
    position, quaternion = bullet.getCollisionShapeData(body, link, client)[shape][5:7]
    rotation = np.reshape(bullet.getMatrixFromQuaternion(quaternion), (3, 3))
    return ((np.array(points) - position) @ rotation).tolist()


def obj(vertices: list[list[float]]) -> str:
    """The points as an OBJ file. Bullet takes the hull of the points of faces, so each point is in a face."""
    count = len(vertices)
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices]
    faces = [f"f {i + 1} {(i + 1) % count + 1} {(i + 2) % count + 1}" for i in range(0, count, 3)]
    return "\n".join([*rows, *faces, ""])
