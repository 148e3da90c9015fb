"""Drawing a world: images by its cameras, and its visual shapes with their poses, for viewers other than PyBullet's."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pybullet as bullet
from numpy.typing import NDArray

from core.cameras import FAR_PLANE, NEAR_PLANE, Camera, CameraFrame, Light
from human.body.person_camera import Photo, draw, fixed_view

Array = NDArray[np.float64]
SHAPE_TYPES = {
    bullet.GEOM_SPHERE: "sphere",
    bullet.GEOM_BOX: "box",
    bullet.GEOM_CYLINDER: "cylinder",
    bullet.GEOM_CAPSULE: "capsule",
    bullet.GEOM_MESH: "mesh",
}
BASE = -1  # Bullet's number for the base link
INVISIBLE = (0.0, 0.0, 0.0, 0.0)
DAYLIGHT = Light()
HALF = 0.5  # pixels


# ---- images


class Renderer:
    """Renders a client whose bodies were loaded with their visual shapes.

    PyBullet's software renderer draws every opacity but 0 as opaque, so see-through links are drawn apart, and blended
    here. They cast no shadow. `close` frees what they are drawn with.
    """

    def __init__(self, client: int) -> None:
        self._client = client
        self._see_through: dict[tuple[int, int], Sequence[float]] = {}  # (body, link) -> RGBA
        self._copies: LinkCopies | None = None

    def set_see_through(self, body: int, link: int, color: Sequence[float] | None) -> None:
        """Blend this link with its RGBA color from now on; None: draw it like any other."""
        self._see_through.pop((body, link), None)
        if color is not None:
            self._see_through[body, link] = color

    def fade(self, opacity: float) -> None:
        """Blend all see-through links with this opacity, until they get other colors."""
        self._see_through = {link: (*color[:3], opacity) for link, color in self._see_through.items()}

    def clear(self) -> None:
        """Forget all see-through links."""
        self._see_through = {}

    def render(self, camera: Camera) -> NDArray[np.uint8]:
        """(height, width, 3) the image of the camera, fixed in the workspace."""
        return self.photograph(camera, CameraFrame.of(camera) if camera.roll else None).colors

    def photograph(
        self,
        camera: Camera,
        frame: CameraFrame | None,
        light: Light = DAYLIGHT,
        *,
        without: Sequence[tuple[int, int]] = (),
        solid: Callable[[], Photo] | None = None,
    ) -> Photo:
        """Return what a camera in this frame sees.

        Args:
            camera, frame, light: as in `rendering.photograph`.
            without: (body, link) of see-through links that are left out.
            solid: returns the photo of all other links; None: they are drawn as they are.
        """
        self._paint_all(0.0)
        try:
            photo = solid() if solid else photograph(self._client, camera, frame, light)
        finally:
            self._paint_all(None)
        links = {link: color for link, color in self._see_through.items() if link not in without}
        if not links:
            return photo
        if self._copies is None:
            self._copies = LinkCopies(self._client)
        return _blended(photo, *self._copies.photograph(links, camera, frame, light))

    def close(self) -> None:
        """Free the client of the copies. Idempotent."""
        if self._copies is not None:
            self._copies.close()
            self._copies = None

    def _paint_all(self, opacity: float | None) -> None:
        """Paint all see-through links with this opacity; None: with their own."""
        for (body, link), color in self._see_through.items():
            paint(body, color if opacity is None else (*color[:3], opacity), self._client, link)


class LinkCopies:
    """Copies of links, drawn without everything else in a client of their own.

    A picture of a few copies takes a tenth of one in which a robot is.

    client: PyBullet's, in which the links are.
    """

    def __init__(self, client: int) -> None:
        self._client, self._stage = client, bullet.connect(bullet.DIRECT)
        self._copies: dict[tuple[int, int], list[tuple[int, VisualShape]]] = {}  # a body of the stage for each shape

    def photograph(
        self, links: Mapping[tuple[int, int], Sequence[float]], camera: Camera, frame: CameraFrame | None, light: Light
    ) -> tuple[Photo, Array]:
        """Return a photo of these links alone, opaque, and the opacity (H, W) of the link at each pixel.

        links: their RGBA by (body, link). camera, frame, light: as in `rendering.photograph`.
        """
        for link in links:
            if link not in self._copies:
                self._copies[link] = self._copies_of(*link)
        numbers, opacities = [], []  # of each body of the stage
        for link, copies in self._copies.items():
            color = links.get(link, INVISIBLE)
            for copy, shape in copies:
                numbers.append(link_number(*link))
                opacities.append(color[3])
                paint(copy, (*color[:3], float(link in links)), self._stage)
                self._put(copy, shape)
        photo = photograph(self._stage, camera, frame, light)  # its links are the bodies of the stage; -1: none
        numbers_at = np.array([*numbers, -1], np.int32)[photo.links]
        return replace(photo, links=numbers_at), np.array([*opacities, 0.0])[photo.links]

    def close(self) -> None:
        """Free the client."""
        bullet.disconnect(self._stage)

    def _copies_of(self, body: int, link: int) -> list[tuple[int, VisualShape]]:
        shapes = [shape for shape in body_shapes(self._client, body) if shape.link == link]
        return [(self._copy(shape), shape) for shape in shapes]

    def _copy(self, shape: VisualShape) -> int:
        """Return the body of a copy of a shape, in the stage."""
        number = next(number for number, name in SHAPE_TYPES.items() if name == shape.type)
        sizes: dict[str, dict[str, object]] = {
            "box": {"halfExtents": [side / 2 for side in shape.size]},
            "sphere": {"radius": shape.size[0]},
            "mesh": {"fileName": str(shape.mesh), "meshScale": shape.size},
        }
        size = sizes.get(shape.type, {"length": shape.size[0], "radius": shape.size[1]})
        visual = bullet.createVisualShape(number, physicsClientId=self._stage, **size)
        return int(bullet.createMultiBody(0, -1, visual, physicsClientId=self._stage))

    def _put(self, copy: int, shape: VisualShape) -> None:
        """Put the copy of a shape where the shape is now."""
        pose = link_pose(self._client, shape.body, shape.link)
        place = bullet.multiplyTransforms(*pose, shape.position, shape.quaternion)
        bullet.resetBasePositionAndOrientation(copy, *place, physicsClientId=self._stage)


def _blended(behind: Photo, front: Photo, opacities: Array) -> Photo:
    """Return `behind`, changed: through pixels that are nearer in `front` shines what is behind. opacities: (H, W)."""
    nearer = front.depths < behind.depths
    share = opacities[nearer][:, None]
    behind.colors[nearer] = np.rint(share * front.colors[nearer] + (1 - share) * behind.colors[nearer])
    behind.depths[nearer], behind.links[nearer] = front.depths[nearer], front.links[nearer]
    return behind


def photograph(client: int, camera: Camera, frame: CameraFrame | None, light: Light = DAYLIGHT) -> Photo:
    """Return the picture of a camera in this frame.

    PyBullet draws half a pixel to the right and above of where a camera would see. For a camera with a frame that is
    made good, so that things are where `core.cameras.project` says. frame: None: as the camera is fixed in the
    workspace, for pictures that people look at, which keep their bits.

    See-through objects are drawn opaque; `Renderer.photograph` blends them.
    """
    size = camera.height, camera.width
    if frame is None:
        return draw(client, size, fixed_view(camera), _projection(camera, 0.0), light)
    return draw(client, size, frame.view_matrix, _projection(camera, HALF), light)


def paint(body: int, color: Sequence[float], client: int, link: int = -1) -> None:
    """Set the RGBA color of a link's visual shapes."""
    bullet.changeVisualShape(body, link, rgbaColor=color, physicsClientId=client)


def _projection(camera: Camera, shift: float) -> list[float]:
    """OpenGL's projection matrix for the camera's image. shift: pixels, to the right and up."""
    pixel = 2 * NEAR_PLANE * np.tan(np.deg2rad(camera.fov) / 2) / camera.height  # metres, in the near plane
    x, y = camera.width / 2, camera.height / 2
    sides = ((shift - x) * pixel, (x + shift) * pixel, (shift - y) * pixel, (y + shift) * pixel)
    matrix: list[float] = bullet.computeProjectionMatrix(*sides, NEAR_PLANE, FAR_PLANE)
    return matrix


def link_number(body: int, link: int) -> int:
    """Return the number of a link in a photo's `links`."""
    return body + ((link + 1) << 24)


# ---- visual shapes


@dataclass(frozen=True, kw_only=True)
class VisualShape:
    """One visual shape.

    body, link: Bullet's ids; `VisualShapes.poses` gives the pose. type: of SHAPE_TYPES. size: (3,): metres of a box;
    the radius first, of a sphere; length and radius of a cylinder or capsule (along z); the scale of a mesh's axes.
    mesh: its file. position (3,), metres, and quaternion (4,), x, y, z, w: in the link's frame. rgba: in [0, 1].
    """

    body: int
    link: int
    type: str
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

    def shapes(self) -> list[VisualShape]:
        """Every visual shape in its current colour, always in the same order."""
        return [shape for body in self._bodies for shape in body_shapes(self._client, body)]

    def poses(self, links: list[tuple[int, int]]) -> Array:
        """(len(links), 7) of these (body, link): position, metres, and quaternion (x, y, z, w)."""
        poses = (link_pose(self._client, body, link) for body, link in links)
        return np.array([[*position, *quaternion] for position, quaternion in poses])


def body_shapes(client: int, body: int) -> list[VisualShape]:
    """Return the visual shapes of a body, in their current colours."""
    return [
        VisualShape(
            body=body,
            link=link,
            type=SHAPE_TYPES[number],
            size=size,
            mesh=Path(file.decode()) if number == bullet.GEOM_MESH else None,
            position=position,
            quaternion=quaternion,
            rgba=rgba,
        )
        for _, link, number, size, file, position, quaternion, rgba, *_ in bullet.getVisualShapeData(
            body, physicsClientId=client
        )
        if number in SHAPE_TYPES
    ]


def link_pose(client: int, body: int, link: int) -> tuple[Sequence[float], Sequence[float]]:
    """Return position, metres, and quaternion (x, y, z, w) of the frame in which the shapes of a link are given."""
    if link != BASE:
        state = bullet.getLinkState(body, link, computeForwardKinematics=True, physicsClientId=client)
        return state[4], state[5]
    # Bullet gives the pose of a base's centre of mass.
    pose, centre = bullet.getBasePositionAndOrientation(body, client), bullet.getDynamicsInfo(body, BASE, client)[3:5]
    position, quaternion = bullet.multiplyTransforms(*pose, *bullet.invertTransform(*centre))
    return position, quaternion
