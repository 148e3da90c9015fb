"""Adds a magnet to a copy of a URDF: a cylinder from the flange to the gripper centre."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from envs.sim.collision_hulls import resolved
from envs.sim.mesh_cache import scratch

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
