"""The visual shapes of a world, with their meshes and poses, for viewers other than PyBullet's."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pybullet as bullet
from numpy.typing import NDArray

Array = NDArray[np.float64]
KINDS = {
    bullet.GEOM_SPHERE: "sphere",
    bullet.GEOM_BOX: "box",
    bullet.GEOM_CYLINDER: "cylinder",
    bullet.GEOM_CAPSULE: "capsule",
    bullet.GEOM_MESH: "mesh",
}
BASE = -1  # Bullet's number for the base link


@dataclass(frozen=True)
class VisualShape:
    """One visual shape.

    body, link: Bullet's ids; `VisualShapes.poses` gives the pose. kind: a value of KINDS. size: (3,): metres of a box;
    the radius first, of a sphere; length and radius of a cylinder or capsule (along z); the scale of a mesh's axes.
    mesh: its file. position (3,), metres, and quaternion (4,), x, y, z, w: in the link's frame. rgba: in [0, 1].
    """

    body: int
    link: int
    kind: str
    size: tuple[float, float, float]
    mesh: Path | None
    position: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]
    rgba: tuple[float, float, float, float]


class VisualShapes:
    """All visual shapes of a client whose bodies were loaded with visuals."""

    def __init__(self, client: int) -> None:
        self._client = client
        self._bodies = [bullet.getBodyUniqueId(i, client) for i in range(bullet.getNumBodies(client))]
        # Bullet gives the pose of a base's centre of mass, but the poses of shapes in the link's frame.
        self._centres = {body: self._centre(body) for body in self._bodies}

    def shapes(self) -> list[VisualShape]:
        """Every visual shape in its current colour, always in the same order."""
        listed = (bullet.getVisualShapeData(body, physicsClientId=self._client) for body in self._bodies)
        return [self._visual_shape(shape) for shapes in listed for shape in shapes if shape[2] in KINDS]

    def poses(self, links: list[tuple[int, int]]) -> Array:
        """(len(links), 7) of these (body, link): position, metres, and quaternion (x, y, z, w)."""
        return np.array([self._pose(body, link) for body, link in links])

    def _visual_shape(self, shape: tuple) -> VisualShape:
        body, link, kind, size, file, position, quaternion, rgba = shape[:8]
        mesh = Path(file.decode()) if kind == bullet.GEOM_MESH else None
        return VisualShape(body, link, KINDS[kind], size, mesh, position, quaternion, rgba)

    def _centre(self, body: int) -> tuple:
        return bullet.getDynamicsInfo(body, BASE, self._client)[3:5]

    def _pose(self, body: int, link: int) -> list[float]:
        if link != BASE:
            state = bullet.getLinkState(body, link, computeForwardKinematics=True, physicsClientId=self._client)
            return [*state[4], *state[5]]
        pose = bullet.getBasePositionAndOrientation(body, self._client)
        position, quaternion = bullet.multiplyTransforms(*pose, *bullet.invertTransform(*self._centres[body]))
        return [*position, *quaternion]
