"""Images of one world, with see-through bodies blended in."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pybullet as bullet
from numpy.typing import NDArray

from human import Camera

NEAR_PLANE, FAR_PLANE = 0.05, 10  # metres
LIGHT_DIRECTION = (0.5, -0.6, 1.5)


def paint(body: int, color: Sequence[float], client: int, link: int = -1) -> None:
    """Set the RGBA color of a link's visual shapes."""
    bullet.changeVisualShape(body, link, rgbaColor=color, physicsClientId=client)


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

    def clear(self) -> None:
        """Forget all see-through links."""
        self._see_through = {}

    def render(self, camera: Camera) -> NDArray[np.uint8]:
        """(height, width, 3) the image of the camera."""
        image = self._image(camera)
        if not self._see_through:
            return image
        for (body, link), color in self._see_through.items():
            paint(body, [*color[:3], 0], self._client, link)
        background = self._image(camera)
        for (body, link), color in self._see_through.items():
            paint(body, color, self._client, link)
        opacity = max(color[3] for color in self._see_through.values())
        return np.rint(opacity * image + (1 - opacity) * background).astype(np.uint8)

    def _image(self, camera: Camera) -> NDArray[np.uint8]:
        view = bullet.computeViewMatrixFromYawPitchRoll(camera.target, camera.distance, camera.yaw, camera.pitch, 0, 2)
        aspect = camera.width / camera.height
        projection = bullet.computeProjectionMatrixFOV(camera.fov, aspect, NEAR_PLANE, FAR_PLANE)
        pixels = bullet.getCameraImage(
            camera.width,
            camera.height,
            view,
            projection,
            lightDirection=LIGHT_DIRECTION,
            renderer=bullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
        )[2]
        return np.reshape(np.asarray(pixels, np.uint8), (camera.height, camera.width, 4))[..., :3].copy()
