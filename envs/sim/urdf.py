"""Files that are made from a robot's meshes, kept on disk from one process to the next.

They lie in `$XDG_CACHE_HOME/deixis`, or `~/.cache/deixis`, and can be deleted at any time. Where nothing can be written
there, they are made anew in a temporary folder of the process.
"""

from __future__ import annotations

import atexit
import hashlib
import math
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pybullet as bullet
from numpy.typing import NDArray

VERSION = "1"  # raised whenever the same meshes give other files


@cache
def scratch() -> Path:
    """A temporary folder of this process, deleted when it ends."""
    folder = Path(tempfile.mkdtemp(prefix="deixis-hulls-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def kept_folder(sources: Iterable[Path], make: Callable[[Path], None]) -> Path:
    """A folder of files that depend on the content of `sources` alone.

    Args:
        sources: the files that they are made from.
        make: writes them to a folder; called if no earlier process did.
    """
    digest = hashlib.sha256(VERSION.encode())
    for source in sources:
        digest.update(source.name.encode() + b"\0" + hashlib.sha256(source.read_bytes()).digest())
    name = digest.hexdigest()[:32]
    try:
        return _made(cache_folder() / name, make)
    except (OSError, RuntimeError):  # the disk is full or read-only, or the user has no home folder
        return _made(scratch() / name, make)


def cache_folder() -> Path:
    """Where files are kept between processes."""
    home = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(home) if os.path.isabs(home) else Path("~/.cache").expanduser()) / "deixis"


def _made(folder: Path, make: Callable[[Path], None]) -> Path:
    """The folder, made whole or not at all: another process may make it meanwhile, or this one may be killed."""
    if folder.is_dir():
        return folder
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".making-", ignore_cleanup_errors=True) as temporary:
        make(Path(temporary))
        Path(temporary).chmod(0o755)
        try:
            Path(temporary).rename(folder)
        except OSError:
            if not folder.is_dir():
                raise
    return folder


Load = Callable[[int], int]  # client -> body, its links not merged

_with_hulls: dict[Path, Path] = {}


def lean(urdf: Path, load: Load) -> Path:
    """A copy of the URDF with OBJ hulls as collision meshes and without visuals; the URDF itself if it has no COLLADA
    collision meshes. load: loads the URDF in a client."""
    if urdf not in _with_hulls:
        try:
            tree = ElementTree.parse(urdf)
        except ElementTree.ParseError:
            return urdf  # Bullet reports what is wrong with it
        meshes = {link.get("name"): link.findall("collision/geometry/mesh") for link in tree.iter("link")}
        files = [str(mesh.get("filename")) for found in meshes.values() for mesh in found]
        if any(file.endswith(".dae") for file in files):
            sources = [urdf, *(path for file in sorted(set(files)) if (path := Path(resolved(file, urdf))).is_file())]
            folder = kept_folder(sources, lambda folder: _write(tree, meshes, urdf, load, folder))
            _with_hulls[urdf] = folder / urdf.name
        else:
            _with_hulls[urdf] = urdf
    return _with_hulls[urdf]


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


MASS = 0.1  # kg
Numbers = tuple[float, ...]


@cache
def with_magnet(urdf: Path, link: str, end: Numbers, way: Numbers, radius: float, length: float) -> Path:
    """The URDF with a cylinder, metres, whose far face is at `end` and points along the unit vector `way`, both (3,) in
    the frame of `link`."""
    tree = ElementTree.parse(urdf)
    for mesh in tree.iter("mesh"):
        mesh.set("filename", resolved(str(mesh.get("filename")), urdf))
    root = tree.getroot()
    body = ElementTree.SubElement(root, "link", name="deixis_magnet")
    inertial = ElementTree.SubElement(body, "inertial")
    ElementTree.SubElement(inertial, "mass", value=str(MASS))
    spin = str(MASS * radius**2)
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
    return _written(tree, urdf, "_".join(f"{number:g}" for number in (*end, radius, length)))


def _written(tree: Any, urdf: Path, lengths: str) -> Path:
    """Writes the URDF and returns its path, which differs for each magnet of a robot."""
    target = scratch() / f"{urdf.stem}_with_magnet_{lengths}.urdf"
    tree.write(target)
    return target
