"""Copies of URDFs that worlds load faster: unused joints fixed, meshes as hulls, and a magnet on the flange.

The copies are entries of `core.file_cache`. Ask for them anew for each world: the files can be deleted at any time, and
a URDF or mesh that was edited gives another copy.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pybullet as bullet
from numpy.typing import NDArray

from core.file_cache import Source, cached_folder
from envs.sim.urdf_file import decoded_name, name_of, path_of, raw_path, read_urdf, urdf_bytes

MODULE = Path(__file__)  # a source of what it makes
LARGE = 160_000  # bytes of an STL file from which on its hull is made small
DIRECTIONS = 200  # a small hull keeps the outermost point in each: within 1 % of its size
STL = np.dtype([("normal", "<f4", 3), ("points", "<f4", (3, 3)), ("attribute", "<u2")])  # a triangle of a binary file
MAGNET_MASS = 0.1  # kg
EXACT = 1e-4  # metres by which the bounding box of a link with hulls may differ from that with its meshes
ROUGH = 5e-3  # the same for small hulls
ORIGINAL = "original"  # marks an entry of the cache in which no copy is
Load = Callable[[Path, int], int]  # a URDF and a client -> body, its links not merged
Numbers = tuple[float, ...]


def read_with_meshes(urdf: Path) -> Element:
    """Return the `robot` element of a URDF, its meshes with absolute paths. Raises URDFError."""
    robot, folders = read_urdf(urdf), list(dict.fromkeys((*urdf.absolute().parents, *urdf.resolve().parents)))
    for mesh in robot.iter("mesh"):
        mesh.set("filename", raw_path(_absolute(path_of(mesh.get("filename", "")), folders)))
    return robot


def _absolute(mesh: str, folders: Sequence[Path]) -> str:
    """Return the mesh's absolute path, searched beside the URDF and above it, as Bullet does, or what was given."""
    name = mesh.removeprefix("package://").removeprefix("model://")
    return next((path for folder in folders if os.path.isfile(path := os.path.join(folder, name))), mesh)


def _cached(name: str, robot: Element) -> Path:
    """Return a file of this name that holds the `robot` element."""
    content = urdf_bytes(robot)
    return cached_folder("urdf", [name, content], lambda folder: _write(folder / name, content)) / name


def _write(path: Path, content: bytes) -> None:
    path.write_bytes(content)


# ---- unused joints, and large meshes


def simplified(urdf: Path, joints: tuple[str, ...], small: bool = False) -> Path:
    """Return the path of a copy in which joints that the robot does not use are fixed at 0.

    It is that of the URDF itself if there is nothing to simplify. Raises URDFError.

    Args:
        urdf: of the robot.
        joints: those that it uses.
        small: put small hulls in place of large collision meshes.
    """
    robot = read_with_meshes(urdf)
    unused = [
        joint for joint in robot.findall("joint") if joint.get("type") != "fixed" and name_of(joint) not in joints
    ]
    for joint in unused:
        joint.set("type", "fixed")
    meshes = robot.findall("link/collision/geometry/mesh") if small else []
    large = [mesh for mesh in meshes if _is_large(_file(mesh))]
    for mesh in large:
        mesh.set("filename", raw_path(str(_small_hull(_file(mesh)))))
    return _cached(urdf.name, robot) if unused or large else urdf


def _file(mesh: Element) -> Path:
    return Path(path_of(mesh.get("filename", "")))


def _is_large(mesh: Path) -> bool:
    return is_binary_stl(mesh) and mesh.stat().st_size >= LARGE


def is_binary_stl(mesh: Path) -> bool:
    """Return whether it is a binary STL file: 80 bytes, the number of triangles, and the triangles."""
    if mesh.suffix.lower() != ".stl" or not mesh.is_file():
        return False
    with mesh.open("rb") as file:
        file.seek(80)
        count = int.from_bytes(file.read(4), "little")
    return mesh.stat().st_size == 84 + count * STL.itemsize


def _small_hull(mesh: Path) -> Path:
    """Return an OBJ file with the outermost points of an STL file."""
    name = f"{mesh.stem}.obj"

    def make(folder: Path) -> None:
        (folder / name).write_text(obj(outermost(_stl(mesh)).astype(float).tolist()))

    return cached_folder("hull", [MODULE, name, mesh], make) / name


def _stl(mesh: Path) -> NDArray[np.float32]:
    return np.fromfile(mesh, STL, offset=84)["points"]


def stl_points(mesh: Path) -> NDArray[np.float64]:
    """Return the triangles (T, 3, 3) of a binary STL file."""
    return _stl(mesh).astype(np.float64)


def outermost(points: NDArray) -> NDArray:
    """(P, 3) those of points (..., 3) that are the outermost in one of `DIRECTIONS`."""
    points = np.unique(points.reshape(-1, 3), axis=0)
    return points[np.unique((_directions() @ points.T).argmax(1))]


def _directions() -> NDArray[np.float32]:
    """(DIRECTIONS, 3) unit vectors, evenly spread over the sphere on a Fibonacci spiral."""
    index = np.arange(DIRECTIONS) + 0.5
    z, turn = 1 - 2 * index / DIRECTIONS, np.pi * (1 + 5**0.5) * index
    radius = np.sqrt(1 - z**2)
    return np.stack((radius * np.cos(turn), radius * np.sin(turn), z), axis=1).astype(np.float32)


# ---- hulls of meshes that load slowly


def with_hulls(urdf: Path, load: Load, small: bool = False) -> Path:
    """Return a copy of the URDF with hulls as collision meshes and without visuals. Raises URDFError.

    It is the URDF itself if no collision mesh is COLLADA or large, or if a copy would not be as the original. The hulls
    are those that Bullet itself makes of the meshes.

    Args:
        urdf: of the robot.
        load: loads a URDF in a client.
        small: write OBJ files, around which Bullet's bounding boxes are 1 mm larger.
    """
    robot = read_with_meshes(urdf)
    files = {_file(mesh) for mesh in robot.findall("link/collision/geometry/mesh")}
    if not any(_loads_slowly(file) for file in files):
        return urdf
    sources: list[Source] = [MODULE, urdf.name, str(small), urdf_bytes(robot), *sorted(filter(Path.is_file, files))]
    folder = cached_folder("hulls", sources, lambda folder: _write_hulls(urdf, robot, load, folder, small=small))
    return urdf if (folder / ORIGINAL).exists() else folder / urdf.name


def _loads_slowly(mesh: Path) -> bool:
    suffix = mesh.suffix.lower()
    return suffix == ".dae" or (suffix == ".stl" and mesh.is_file() and mesh.stat().st_size >= LARGE)


def _write_hulls(urdf: Path, robot: Element, load: Load, folder: Path, *, small: bool) -> None:
    """Write a copy with hulls; if that is not as the original, an empty file in its place."""
    links, copy = {name_of(link): link for link in robot.findall("link")}, folder / urdf.name
    client = bullet.connect(bullet.DIRECT)
    try:
        body = load(urdf, client)
        wanted, shapes = _boxes(body, client)
        names = [bullet.getBodyInfo(body, client)[0], *_link_names(body, client)]
        for number, name in enumerate(names):
            for i, mesh in _meshes(links[decoded_name(name)], shapes[number]):
                hull = folder / f"{number - 1}_{i}.{'obj' if small else 'stl'}"
                points = _vertices(body, number - 1, i, client)
                _write(hull, obj(points).encode() if small else stl(np.array(points)))
                mesh.set("filename", hull.name)
                mesh.attrib.pop("scale", None)
        for link in links.values():
            for visual in link.findall("visual"):
                link.remove(visual)
        _write(copy, urdf_bytes(robot))
        bullet.resetSimulation(client)
        boxes, others = _boxes(load(copy, client), client)
        if others != shapes or not np.allclose(boxes, wanted, rtol=0, atol=ROUGH if small else EXACT):
            raise ValueError(f"{copy} is not as {urdf}")
    except (bullet.error, KeyError, ValueError):  # KeyError: a link without a name
        _write(folder / ORIGINAL, b"")
    finally:
        bullet.disconnect(client)


def _meshes(link: Element, shapes: list[int]) -> list[tuple[int, Element]]:
    """Return the link's meshes of which hulls are made, each with its number among its collision shapes.

    Bullet gives the points of all meshes of a link together, so that a link with several of them keeps them.
    """
    parts = [(part, part.find("geometry/*")) for part in link.findall("collision")]
    if len(parts) != len(shapes) or shapes.count(bullet.GEOM_MESH) != 1:
        return []
    convex = [(i, shape) for i, (part, shape) in enumerate(parts) if shape is not None and "concave" not in part.attrib]
    return [(i, mesh) for i, mesh in convex if mesh.tag == "mesh" and _file(mesh).suffix.lower() in (".dae", ".stl")]


def _link_names(body: int, client: int) -> list[bytes]:
    return [bullet.getJointInfo(body, j, client)[12] for j in range(bullet.getNumJoints(body, client))]


def _boxes(body: int, client: int) -> tuple[NDArray[np.float64], list[list[int]]]:
    """Return the bounding boxes of base and links, metres, and the kinds of their shapes."""
    links = range(-1, bullet.getNumJoints(body, client))
    kinds = [[shape[2] for shape in bullet.getCollisionShapeData(body, link, client)] for link in links]
    return np.array([bullet.getAABB(body, link, client) for link in links]), kinds


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


def stl(points: NDArray[np.float64]) -> bytes:
    """Return the points (P, 3) as a binary STL file. Each is in a triangle."""
    count = math.ceil(len(points) / 3)
    triangles = np.zeros(count, STL)
    triangles["points"] = points[np.arange(3 * count) % len(points)].reshape(count, 3, 3)
    return bytes(80) + count.to_bytes(4, "little") + triangles.tobytes()


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
    root = read_with_meshes(urdf)
    parent = next((each.get("name", "") for each in root.findall("link") if name_of(each) == link), link)
    body = SubElement(root, "link", name="deixis_magnet")
    inertial = SubElement(body, "inertial")
    SubElement(inertial, "mass", value=str(MAGNET_MASS))
    spin = str(MAGNET_MASS * radius**2)
    SubElement(inertial, "inertia", ixx=spin, iyy=spin, izz=spin, ixy="0", ixz="0", iyz="0")
    for purpose in ("visual", "collision"):
        part = SubElement(body, purpose)
        shape = SubElement(part, "geometry")
        SubElement(shape, "cylinder", radius=str(radius), length=str(length))
        if purpose == "visual":
            material = SubElement(part, "material", name="deixis_magnet")
            SubElement(material, "color", rgba="0.25 0.25 0.28 1")
    joint = SubElement(root, "joint", name="deixis_magnet_mount", type="fixed")
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link="deixis_magnet")
    middle = [a - length / 2 * b for a, b in zip(end, way, strict=True)]
    pitch, yaw = math.atan2(math.hypot(way[0], way[1]), way[2]), math.atan2(way[1], way[0])
    SubElement(joint, "origin", xyz=" ".join(map(str, middle)), rpy=f"0 {pitch} {yaw}")
    return _cached(urdf.name, root)
