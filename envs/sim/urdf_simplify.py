"""A copy of a robot's URDF that is cheaper to simulate: unused joints are fixed, and large meshes become small hulls.

Bullet keeps every joint of a URDF and every point of a mesh's hull. A joint that no control drives would drift from one
episode to the next, and the hulls of LeRobot's SO-101 take 160 MB a world.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from envs.sim.collision_hulls import obj, resolved
from envs.sim.mesh_cache import kept_folder, scratch

LARGE = 160_000  # bytes of an STL file from which on its hull is made small
DIRECTIONS = 200  # a hull keeps the outermost point in each: within 1 % of its size
MOVABLE = ("revolute", "continuous", "prismatic")
STL = np.dtype([("normal", "<f4", 3), ("points", "<f4", (3, 3)), ("attribute", "<u2")])  # a triangle of a binary file


@cache
def simplified(urdf: Path, joints: tuple[str, ...]) -> Path:
    """The path of the copy; that of the URDF itself if there is nothing to simplify.

    joints: those that the robot uses. All others are fixed at 0.
    """
    try:
        tree = ElementTree.parse(urdf)
    except ElementTree.ParseError:
        return urdf  # Bullet reports what is wrong with it
    root = tree.getroot()
    unused = [joint for joint in root.iter("joint") if joint.get("type") in MOVABLE and joint.get("name") not in joints]
    for joint in unused:
        joint.set("type", "fixed")
    for mesh in root.iter("mesh"):
        mesh.set("filename", resolved(str(mesh.get("filename")), urdf))
    meshes = root.findall("link/collision/geometry/mesh")
    large = [mesh for mesh in meshes if _is_large(Path(str(mesh.get("filename"))))]
    for mesh in large:
        mesh.set("filename", str(_small_hull(Path(str(mesh.get("filename"))))))
    if not (unused or large):
        return urdf
    target = scratch() / f"{urdf.stem}_simplified.urdf"
    tree.write(target)
    return target


def _is_large(mesh: Path) -> bool:
    """Whether it is a large binary STL file: 80 bytes, the number of triangles, and the triangles."""
    if mesh.suffix.lower() != ".stl" or not mesh.is_file() or mesh.stat().st_size < LARGE:
        return False
    with mesh.open("rb") as file:
        file.seek(80)
        count = int.from_bytes(file.read(4), "little")
    return mesh.stat().st_size == 84 + count * STL.itemsize


@cache
def _small_hull(mesh: Path) -> Path:
    """An OBJ file with the outermost points of an STL file."""
    name = f"{mesh.stem}.obj"

    def make(folder: Path) -> None:
        points = np.unique(np.fromfile(mesh, STL, offset=84)["points"].reshape(-1, 3), axis=0)
        outermost = np.unique((_directions() @ points.T).argmax(1))
        (folder / name).write_text(obj(points[outermost].astype(float).tolist()))

    return kept_folder([mesh], make) / name


def _directions() -> NDArray[np.float32]:
    """(DIRECTIONS, 3) unit vectors, evenly spread over the sphere on a Fibonacci spiral."""
    index = np.arange(DIRECTIONS) + 0.5
    z, turn = 1 - 2 * index / DIRECTIONS, np.pi * (1 + 5**0.5) * index
    radius = np.sqrt(1 - z**2)
    return np.stack((radius * np.cos(turn), radius * np.sin(turn), z), axis=1).astype(np.float32)
