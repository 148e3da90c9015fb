"""Shapes of the body as URDF and OBJ text: spheres, capsules, boxes, and surfaces through elliptic rings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

Ring = tuple[float, float, float, float]  # height, semi-axis along x, semi-axis along y, x of the centre; metres
Point = tuple[float, float, float]
SEGMENTS = 20  # vertices of a ring


@dataclass(frozen=True)
class Part:
    """One shape of a link.

    geometry: its URDF element. color: RGB in [0, 1]; None: a collision shape, which is not drawn.
    place, angles: its pose in the link's frame, metres and radians (roll, pitch, yaw).
    """

    geometry: str
    color: tuple[float, float, float] | None
    place: Point = (0, 0, 0)
    angles: Point = (0, 0, 0)


def loft(rings: Sequence[Ring]) -> str:
    """Returns the text of an OBJ file: the surface through elliptic rings, lowest first, closed at both ends."""
    turns = [2 * math.pi * k / SEGMENTS for k in range(SEGMENTS)]
    rows = [f"v {x + a * math.cos(t):.5f} {b * math.sin(t):.5f} {z:.5f}" for z, a, b, x in rings for t in turns]
    rows += [f"v {x:.5f} 0 {z:.5f}" for z, _, _, x in (rings[0], rings[-1])]
    for i, (_, a, b, _) in enumerate(rings):
        below, above = rings[max(i - 1, 0)], rings[min(i + 1, len(rings) - 1)]
        slope = (below[1] - above[1]) / max(above[0] - below[0], 1e-6)
        rows += [_normal(math.cos(t) / a, math.sin(t) / b, slope / max(a, b)) for t in turns]
    rows += ["vn 0 0 -1", "vn 0 0 1"]
    return "\n".join(rows + _faces(len(rings)) + [""])


def _normal(x: float, y: float, z: float) -> str:
    length = math.hypot(x, y, z)
    return f"vn {x / length:.4f} {y / length:.4f} {z / length:.4f}"


def _faces(rings: int) -> list[str]:
    """Returns the triangles, numbered from 1: the sides, counter-clockwise seen from outside, then the two ends."""
    triangles = []
    last = rings * SEGMENTS
    for k in range(SEGMENTS):
        right = (k + 1) % SEGMENTS
        for base in range(0, last - SEGMENTS, SEGMENTS):
            a, b, c, d = base + k, base + right, base + SEGMENTS + k, base + SEGMENTS + right
            triangles += [(a, b, d), (a, d, c)]
        top = last - SEGMENTS
        triangles += [(right, k, last), (top + k, top + right, last + 1)]
    return ["f " + " ".join(f"{i + 1}//{i + 1}" for i in triangle) for triangle in triangles]


def mesh(name: str, color: tuple[float, float, float], place: Point = (0, 0, 0)) -> Part:
    """Returns the mesh of the file `name`.obj."""
    return Part(f'<mesh filename="{name}.obj"/>', color, place)


def ball(radius: float, place: Point, color: tuple[float, float, float] | None = None) -> Part:
    """Returns a sphere."""
    return Part(f'<sphere radius="{radius:.5f}"/>', color, place)


def rod(start: Point, end: Point, radius: float, color: tuple[float, float, float] | None = None) -> Part:
    """Returns a capsule whose hemispheres are centred on start and end."""
    x, y, z = (b - a for a, b in zip(start, end, strict=True))
    middle = tuple((a + b) / 2 for a, b in zip(start, end, strict=True))
    angles = (0.0, math.atan2(math.hypot(x, y), z), math.atan2(y, x))
    geometry = f'<capsule radius="{radius:.5f}" length="{math.hypot(x, y, z):.5f}"/>'
    return Part(geometry, color, middle, angles)  # type: ignore[arg-type]


def box(size: Point, place: Point, color: tuple[float, float, float] | None = None) -> Part:
    """Returns a box with these side lengths, centred on `place`."""
    return Part('<box size="{:.5f} {:.5f} {:.5f}"/>'.format(*size), color, place)
