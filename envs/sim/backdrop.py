"""Pictures of a world by cameras that stay where they are: what never moves is drawn once for each of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pybullet as bullet

from core.cameras import Camera, CameraFrame
from envs.sim.rendering import Photo, paint, photograph
from envs.sim.workspace import Box

BODY = (1 << 24) - 1  # the bits of a body in the numbers of a photo's links


class Backdrop:
    """Boxes of a client that never move, as the config draws them.

    PyBullet takes as long for a table and a floor, which fill a picture, as for an arm. So they are drawn without the
    rest in a client of their own, once for each camera, and each picture shows of both what is nearer.

    client: PyBullet's. boxes: by their bodies, with visual shapes; nobody else changes their colors.
    """

    def __init__(self, client: int, boxes: Mapping[int, Box]) -> None:
        self._client, self._boxes = client, boxes
        self._drawn: list[tuple[Camera, Photo]] = []

    def photograph(self, camera: Camera) -> Photo:
        """Return what `rendering.photograph` does of a camera that is fixed in the workspace, in daylight."""
        frame = CameraFrame.of(camera)
        behind = next((photo for known, photo in self._drawn if known == camera), None)
        if behind is None:
            behind = self._draw(camera, frame)
            self._drawn.append((camera, behind))
        self._paint(0.0)
        try:
            moving = photograph(self._client, camera, frame)
        finally:
            self._paint(1.0)
        return _nearer(moving, behind)

    def _draw(self, camera: Camera, frame: CameraFrame) -> Photo:
        client = bullet.connect(bullet.DIRECT)
        try:
            for box in self._boxes.values():
                half = [side / 2 for side in box.size]
                shape = bullet.createVisualShape(
                    bullet.GEOM_BOX, halfExtents=half, rgbaColor=[*box.color, 1], physicsClientId=client
                )
                bullet.createMultiBody(0, -1, shape, box.position, physicsClientId=client)
            photo = photograph(client, camera, frame)
        finally:
            bullet.disconnect(client)
        bodies = np.array([*self._boxes, -1], np.int32)  # the last one is that of pixels that show nothing
        return replace(photo, links=bodies[photo.links])

    def _paint(self, opacity: float) -> None:
        for body, box in self._boxes.items():
            paint(body, [*box.color, opacity], self._client)


def _nearer(one: Photo, other: Photo) -> Photo:
    """Return at each pixel what is nearer in one of two photos, or the later body where both are as near."""
    later = (one.links & BODY) > (other.links & BODY)
    near = (one.depths < other.depths) | ((one.depths == other.depths) & later)
    return Photo(
        np.where(near[..., None], one.colors, other.colors),
        np.where(near, one.depths, other.depths),
        np.where(near, one.links, other.links),
    )
