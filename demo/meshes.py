"""Meshes of the 3D view: shapes with crisp edges, files with the colours of their materials, and soft shadows."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image
from trimesh.visual.material import PBRMaterial

Array = NDArray[np.float64]
WHITE = (235, 236, 238)  # of files without a colour
ROUGHNESS = 0.55
CHAMFER = 0.06  # of an object's edges, in sizes of the object
SHADOW_COLOR = (16, 18, 28)
SHADOW_PIXELS = 64  # of a shadow's picture, on each side
Vector = tuple[float, float, float]


@lru_cache(maxsize=256)
def mesh_of(kind: str, size: Vector, file: Path | None) -> trimesh.Trimesh:
    """Return the mesh of a visual shape, with type and size as `VisualShape` has them."""
    if file is not None:
        return _from_file(file, size)
    if kind == "box":
        return trimesh.creation.box(size)
    if kind == "sphere":
        return trimesh.creation.icosphere(subdivisions=3, radius=size[0])
    if kind == "cylinder":
        return cylinder(size[1], size[0])
    capsule = trimesh.creation.capsule(height=size[0], radius=size[1], count=[16, 16])
    capsule.apply_translation(-capsule.bounds.mean(0))
    return capsule


@lru_cache(maxsize=16)
def object_box(size: Vector) -> trimesh.Trimesh:
    """Return a box of this size (3,), metres, whose edges are a little blunt, so that light shows them."""
    half, cut = np.array(size) / 2, CHAMFER * min(size)
    corners = np.indices((2, 2, 2)).reshape(3, -1).T * 2.0 - 1
    faces: list[list[Array]] = []
    for axis in range(3):  # three faces meet at a corner: each has a point of its own there
        for side in (-1.0, 1.0):
            own = corners[corners[:, axis] == side]
            faces.append(_around([corner * (half - cut * (np.arange(3) != axis)) for corner in own]))
    for corner in corners:
        faces.append(_around([corner * (half - cut * (np.arange(3) != axis)) for axis in range(3)]))
    for axis in range(3):  # edges along an axis
        first, second = (each for each in range(3) if each != axis)
        for sides in np.indices((2, 2)).reshape(2, -1).T * 2.0 - 1:
            ends = corners[(corners[:, [first, second]] == sides).all(1)]
            faces.append(
                _around([end * (half - cut * (np.arange(3) != kept)) for end in ends for kept in (first, second)])
            )
    return polygons(faces)


def polygons(faces: Sequence[Sequence[Array]]) -> trimesh.Trimesh:
    """Return convex polygons as one mesh. faces: the points of each, (3,) metres, anticlockwise from outside."""
    vertices: list[Array] = []
    triangles: list[tuple[int, int, int]] = []
    for points in faces:
        first = len(vertices)
        vertices.extend(points)
        triangles += [(first, first + i, first + i + 1) for i in range(1, len(points) - 1)]
    return trimesh.Trimesh(np.array(vertices), np.array(triangles), process=False)


def _around(points: Sequence[Array]) -> list[Array]:
    """The corners of a convex polygon around the origin's far side, anticlockwise seen from outside."""
    middle = np.mean(points, axis=0)
    normal = middle / np.linalg.norm(middle)
    across = points[0] - middle
    along = np.cross(normal, across)
    return sorted(points, key=lambda point: float(np.arctan2((point - middle) @ along, (point - middle) @ across)))


def cylinder(radius: float, height: float, sections: int = 40) -> trimesh.Trimesh:
    """Return a cylinder along z, metres. Its caps share no points with its side, so that its rims are sharp."""
    angles = np.linspace(0, 2 * np.pi, sections, endpoint=False)
    rim = np.stack((radius * np.cos(angles), radius * np.sin(angles)), 1)
    low, high = (np.column_stack((rim, np.full(sections, z))) for z in (-height / 2, height / 2))
    here, after = np.arange(sections), np.roll(np.arange(sections), -1)
    side = np.concatenate(
        (np.column_stack((here, after, here + sections)), np.column_stack((after, after + sections, here + sections)))
    )
    cap = np.column_stack((np.zeros(sections - 2, int), here[1:-1], here[2:]))
    vertices = np.concatenate((low, high, low, high))
    faces = np.concatenate((side, 2 * sections + cap[:, ::-1], 3 * sections + cap))
    return trimesh.Trimesh(vertices, faces, process=False)


# ---- Files


def _from_file(file: Path, scale: Vector) -> trimesh.Trimesh:
    """Return the mesh of a file, each part in the colour of its material."""
    loaded: Any = trimesh.load(file)
    parts: list[Any] = loaded.dump() if isinstance(loaded, trimesh.Scene) else [loaded]
    colors = [_color_of(part) for part in parts]
    palette = sorted(set(colors))
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts)])
    vertices = np.concatenate([part.vertices for part in parts]) * scale
    faces = np.concatenate([part.faces + offset for part, offset in zip(parts, offsets, strict=False)])
    normals = np.concatenate([part.vertex_normals for part in parts])
    numbers = np.repeat([palette.index(color) for color in colors], np.diff(offsets))
    look = _visual(palette, numbers)
    # The normals are given, since a mesh without any is drawn with flat faces.
    return trimesh.Trimesh(vertices, faces, vertex_normals=normals, visual=look, process=False)


def painted(mesh: trimesh.Trimesh, color: tuple[int, int, int]) -> trimesh.Trimesh:
    """Return the mesh in one colour."""
    look = _visual([color], np.zeros(len(mesh.vertices), int))
    return trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_normals=mesh.vertex_normals, visual=look, process=False)


def _visual(palette: Sequence[tuple[int, int, int]], numbers: NDArray[np.int64]) -> Any:
    """Return the look of vertices that have these numbers of a palette.

    A picture of the palette, since factors of colours are linear in glTF; not metal, which is black without a
    surrounding that it mirrors.
    """
    image = Image.fromarray(np.array([palette], np.uint8))
    material = PBRMaterial(baseColorTexture=image, metallicFactor=0.0, roughnessFactor=ROUGHNESS)
    uv = np.column_stack(((numbers + 0.5) / len(palette), np.full(len(numbers), 0.5)))
    return trimesh.visual.TextureVisuals(uv=uv, material=material)


def _color_of(part: trimesh.Trimesh) -> tuple[int, int, int]:
    """Return the colour of a part's material: with a picture, the mean of what is seen of it."""
    visual: Any = part.visual
    material = getattr(visual, "material", None)
    if material is None:
        return tuple(int(each) for each in visual.main_color[:3]) if visual.defined else WHITE  # type: ignore[return-value]
    rgb = np.array(material.main_color[:3], np.float64)
    image = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
    if image is not None and visual.uv is not None:
        rgb *= trimesh.visual.color.uv_to_color(visual.uv, image)[:, :3].mean(0) / 255
    red, green, blue = (round(each) for each in rgb.tolist())
    return red, green, blue


# ---- Shadows


@lru_cache(maxsize=64)
def soft_shadow(width: float, depth: float, blur: float, opacity: float) -> trimesh.Trimesh:
    """Return a level shadow of a box of width by depth, metres, that fades out over `blur` metres."""
    half = np.array([width / 2 + blur, depth / 2 + blur])
    x, y = (np.abs(np.linspace(-side, side, SHADOW_PIXELS)) for side in half)
    inner = np.maximum(np.array([width, depth]) / 2 - blur, 0.0)
    away = np.hypot(np.maximum(x[None] - inner[0], 0.0), np.maximum(y[:, None] - inner[1], 0.0))
    reach = half.min() - inner.min()
    share = np.clip(1 - away / reach, 0, 1)
    return _sheet(half, share * share * (3 - 2 * share) * opacity, SHADOW_COLOR)


def faded_disc(radius: float, solid: float, color: tuple[int, int, int]) -> trimesh.Trimesh:
    """Return a level disc, metres, that fades out from a share `solid` of its radius on."""
    across = np.linspace(-1, 1, 4 * SHADOW_PIXELS)
    share = np.clip((1 - np.hypot(across[None], across[:, None])) / (1 - solid), 0, 1)
    return _sheet(np.array([radius, radius]), share * share * (3 - 2 * share), color)


def _sheet(half: Array, opacity: Array, color: tuple[int, int, int]) -> trimesh.Trimesh:
    """Return a level rectangle with half sides (2,), metres, and this opacity (H, W) in [0, 1]."""
    picture = np.empty((*opacity.shape, 4), np.uint8)
    picture[..., :3], picture[..., 3] = color, np.rint(255 * opacity)
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    mesh = trimesh.Trimesh(np.column_stack((corners * half, np.zeros(4))), [[0, 1, 2], [0, 2, 3]], process=False)
    material = PBRMaterial(
        baseColorTexture=Image.fromarray(picture), alphaMode="BLEND", metallicFactor=0.0, roughnessFactor=1.0
    )
    mesh.visual = trimesh.visual.TextureVisuals(uv=(corners + 1) / 2, material=material)
    return mesh
