"""Drawing a world: images by its cameras, and its visual shapes with their poses, for viewers other than PyBullet's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
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
DAYLIGHT = Light()
HALF = 0.5  # pixels
Window = tuple[int, int, int, int]  # rows and columns of an image: first and one past the last of each


# ---- images


class Renderer:
    """Renders a client whose bodies were loaded with their visual shapes.

    PyBullet's software renderer draws every opacity but 0 as opaque, so see-through links are blended here.
    """

    def __init__(self, client: int) -> None:
        self._client = client
        self._see_through: dict[tuple[int, int], Sequence[float]] = {}  # (body, link) -> RGBA

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
        frame = CameraFrame.of(camera) if camera.roll else None
        return self.blended(partial(photograph, self._client, camera, frame)).colors

    def photograph(
        self, camera: Camera, frame: CameraFrame, light: Light = DAYLIGHT, without: Sequence[tuple[int, int]] = ()
    ) -> Photo:
        """Return what a camera in this frame sees. without: (body, link) of links that are left out."""
        return self.blended(partial(photograph, self._client, camera, frame, light), without)

    def blended(self, take: Callable[..., Photo], without: Sequence[tuple[int, int]] = ()) -> Photo:
        """Return a photo in which see-through links are blended.

        Args:
            take: returns a photo of the client with these links opaque; window=...: a window of it.
            without: (body, link) of see-through links that are left out.
        """
        present = [link for link in without if link in self._see_through]
        ghosts = [link for link in self._see_through if link not in present]
        self._hide(present)
        photo = take()
        covered = np.isin(photo.links, [_in_mask(*link) for link in ghosts])
        if covered.any():
            window = _window(covered)
            self._hide(ghosts)
            # What lies behind is drawn in this window alone, since a whole second image costs as much as the first.
            behind = take(window=window).colors
            self._restore(ghosts)
            opacity = max(self._see_through[link][3] for link in ghosts)
            part = photo.colors[window[0] : window[1], window[2] : window[3]]
            mask = covered[window[0] : window[1], window[2] : window[3]]
            part[mask] = np.rint(opacity * part[mask] + (1 - opacity) * behind[mask])
        self._restore(present)
        return photo

    def _hide(self, links: Sequence[tuple[int, int]]) -> None:
        for body, link in links:
            paint(body, [*self._see_through[body, link][:3], 0], self._client, link)

    def _restore(self, links: Sequence[tuple[int, int]]) -> None:
        for body, link in links:
            paint(body, self._see_through[body, link], self._client, link)


def photograph(
    client: int, camera: Camera, frame: CameraFrame | None, light: Light = DAYLIGHT, *, window: Window | None = None
) -> Photo:
    """Return the picture of a camera in this frame, or a window of it.

    PyBullet draws half a pixel to the right and above of where a camera would see. For a camera with a frame that is
    made good, so that things are where `core.cameras.project` says. frame: None: as the camera is fixed in the
    workspace, for pictures that people look at, which keep their bits.

    See-through objects are drawn opaque; `Renderer.photograph` blends them.
    """
    top, bottom, left, right = window or (0, camera.height, 0, camera.width)
    size = bottom - top, right - left
    if frame is None:
        return draw(client, size, fixed_view(camera), _projection(camera, (top, bottom, left, right)), light)
    shifted = top - HALF, bottom - HALF, left + HALF, right + HALF
    return draw(client, size, frame.view_matrix, _projection(camera, shifted), light)


def paint(body: int, color: Sequence[float], client: int, link: int = -1) -> None:
    """Set the RGBA color of a link's visual shapes."""
    bullet.changeVisualShape(body, link, rgbaColor=color, physicsClientId=client)


def _projection(camera: Camera, window: tuple[float, float, float, float]) -> list[float]:
    """OpenGL's projection matrix for a window of the camera's image."""
    top, bottom, left, right = window
    pixel = 2 * NEAR_PLANE * np.tan(np.deg2rad(camera.fov) / 2) / camera.height  # metres, in the near plane
    x, y = camera.width / 2, camera.height / 2
    sides = ((left - x) * pixel, (right - x) * pixel, (y - bottom) * pixel, (y - top) * pixel)
    matrix: list[float] = bullet.computeProjectionMatrix(*sides, NEAR_PLANE, FAR_PLANE)
    return matrix


def _window(covered: NDArray[np.bool_]) -> Window:
    """Return the smallest window of an image in which all covered pixels (H, W) are."""
    rows, columns = np.flatnonzero(covered.any(1)), np.flatnonzero(covered.any(0))
    return int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1


def _in_mask(body: int, link: int) -> int:
    """Return the number of a link in PyBullet's segmentation masks."""
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
        # Bullet gives the pose of a base's centre of mass, but the poses of shapes in the link's frame.
        self._centres = {body: self._centre(body) for body in self._bodies}

    def shapes(self) -> list[VisualShape]:
        """Every visual shape in its current colour, always in the same order."""
        listed = (bullet.getVisualShapeData(body, physicsClientId=self._client) for body in self._bodies)
        return [self._visual_shape(shape) for shapes in listed for shape in shapes if shape[2] in SHAPE_TYPES]

    def poses(self, links: list[tuple[int, int]]) -> Array:
        """(len(links), 7) of these (body, link): position, metres, and quaternion (x, y, z, w)."""
        return np.array([self._pose(body, link) for body, link in links])

    def _visual_shape(self, shape: tuple) -> VisualShape:
        body, link, number, size, file, position, quaternion, rgba = shape[:8]
        mesh = Path(file.decode()) if number == bullet.GEOM_MESH else None
        return VisualShape(
            body=body,
            link=link,
            type=SHAPE_TYPES[number],
            size=size,
            mesh=mesh,
            position=position,
            quaternion=quaternion,
            rgba=rgba,
        )

    def _centre(self, body: int) -> tuple:
        return bullet.getDynamicsInfo(body, BASE, self._client)[3:5]

    def _pose(self, body: int, link: int) -> list[float]:
        if link != BASE:
            state = bullet.getLinkState(body, link, computeForwardKinematics=True, physicsClientId=self._client)
            return [*state[4], *state[5]]
        pose = bullet.getBasePositionAndOrientation(body, self._client)
        position, quaternion = bullet.multiplyTransforms(*pose, *bullet.invertTransform(*self._centres[body]))
        return [*position, *quaternion]
