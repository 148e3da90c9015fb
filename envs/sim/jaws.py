"""Collision shapes of a hand with a fixed jaw: meshes cut in slabs, each with a convex hull.

Bullet takes the convex hull of a mesh. That of the hand fills the space between its jaw and the palm. The jaw that
turns keeps one hull: Bullet solves contacts of an object with several slabs in an order that depends on the past.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import pybullet as bullet
from numpy.typing import NDArray

from core.file_cache import Source, cached_folder
from envs.sim.urdf import is_binary_stl, obj, outermost, read_with_meshes, stl_points
from envs.sim.urdf_file import name_of, path_of, raw_path, urdf_bytes

MODULE = Path(__file__)  # a source of what it makes
SLAB = 0.012  # metres: the height of a slab, along the way in which the gripper points
Array = NDArray[np.float64]


def with_cut_hand(urdf: Path, joints: Sequence[str], tip: str, approach: Sequence[float]) -> Path:
    """Return a copy of the URDF in which the collision meshes of the hand are cut in slabs.

    Meshes that are not binary STL files keep their hulls. Raises URDFError.

    Args:
        urdf: of the robot.
        joints: of the arm; the last one carries the hand.
        tip: the link whose frame `approach` is in.
        approach: (3,) unit vector: where the gripper points.
    """
    robot = read_with_meshes(urdf)
    turns = _rotations_in_hand(robot, joints[-1])
    if tip not in turns:
        return urdf
    way = turns[tip] @ np.asarray(approach, np.float64)
    ways = {name: rotation.T @ way for name, rotation in turns.items()}
    cut = [
        (link, part, mesh, ways[name_of(link)])
        for link in robot.findall("link")
        if name_of(link) in ways
        for part in link.findall("collision")
        for mesh in part.findall("geometry/mesh")
        if is_binary_stl(Path(path_of(mesh.get("filename", ""))))
    ]
    files = sorted({Path(path_of(mesh.get("filename", ""))) for _, _, mesh, _ in cut})
    sources: list[Source] = [MODULE, urdf.name, repr((tip, list(approach))), urdf_bytes(robot), *files]

    def make(folder: Path) -> None:
        for number, (link, part, mesh, along) in enumerate(cut):
            _cut(link, part, mesh, along, name=f"{folder}/{number}")
        (folder / urdf.name).write_bytes(urdf_bytes(robot))

    return cached_folder("jaws", sources, make) / urdf.name


def _cut(link: Element, part: Element, mesh: Element, way: Array, *, name: str) -> None:
    """Put the slabs of a mesh in place of a link's collision shape. name: with which their files begin."""
    scale = np.array([float(word) for word in mesh.get("scale", "1 1 1").split()])
    position, rotation = _origin(part)
    triangles = stl_points(Path(path_of(mesh.get("filename", "")))) * scale @ rotation.T + position
    link.remove(part)
    for number, points in enumerate(slabs(triangles, way)):
        file = Path(f"{name}_{number}.obj")
        file.write_text(obj(points.tolist()))
        shape = Element("collision")
        geometry = Element("geometry")
        geometry.append(Element("mesh", filename=raw_path(file.name)))
        shape.append(geometry)
        link.append(shape)


def slabs(triangles: Array, way: Array) -> Iterator[Array]:
    """Yield the outermost points (P, 3) of each slab of a mesh, from triangles (T, 3, 3), metres.

    way: (3,) unit vector across which the slabs lie.
    """
    height = triangles @ way
    low, high = float(height.min()), float(height.max())
    count = max(1, math.ceil((high - low) / SLAB))
    planes = np.linspace(low, high, count + 1)
    for bottom, top in itertools.pairwise(planes.tolist()):
        inside = triangles[(height >= bottom) & (height <= top)]
        points = np.concatenate((inside, *(_crossings(triangles, height - plane) for plane in (bottom, top))))
        if len(points) > 3:
            yield outermost(points)


def _crossings(triangles: Array, height: Array) -> Array:
    """(P, 3) where the edges of triangles (T, 3, 3) cross the plane over which their points are at height (T, 3)."""
    others, above = np.roll(triangles, 1, axis=1), np.roll(height, 1, axis=1)
    crossed = height * above < 0
    share = (height[crossed] / (height[crossed] - above[crossed]))[:, None]
    return triangles[crossed] + share * (others[crossed] - triangles[crossed])


def _rotations_in_hand(robot: Element, last: str) -> dict[str, Array]:
    """Return the rotation (3, 3) of each link that is fixed to the hand, in the hand's frame."""
    rotations: dict[str, Array] = {}
    joints = robot.findall("joint")
    for joint in joints:
        if name_of(joint) == last:
            rotations[_end(joint, "child")] = np.eye(3)
    while True:
        found = {
            _end(joint, "child"): rotations[_end(joint, "parent")] @ _origin(joint)[1]
            for joint in joints
            if joint.get("type") == "fixed"
            and _end(joint, "parent") in rotations
            and _end(joint, "child") not in rotations
        }
        if not found:
            return rotations
        rotations |= found


def _end(joint: Element, tag: str) -> str:
    end = joint.find(tag)
    return "" if end is None else path_of(end.get("link", ""))


def _origin(element: Element) -> tuple[Array, Array]:
    """Return position (3,) in metres and rotation (3, 3) of an element's origin."""
    origin = element.find("origin")
    words = {} if origin is None else origin.attrib
    position, angles = (np.array([float(w) for w in words.get(key, "0 0 0").split()]) for key in ("xyz", "rpy"))
    quaternion = bullet.getQuaternionFromEuler(angles.tolist())
    return position, np.reshape(bullet.getMatrixFromQuaternion(quaternion), (3, 3))
