"""Pictures of the person by a fixed camera.

A picture shows the person and the furniture, without the cone along the finger that videos show. Robot and objects are
left out: when an episode begins they are out of view, and the picture is the same bit for bit. PyBullet's software
renderer takes 2.2 ms for 128 x 128 pixels without them (2.9 before `hide_invisible_shapes`) and 5.0 ms with them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import pybullet as bullet
from numpy.typing import NDArray

from core.cameras import FAR_PLANE, NEAR_PLANE, Camera, Light
from core.errors import ConfigError
from core.platform_tuning import as_bytes
from human.arms import Array
from human.body.pybullet_body import Body
from human.body.urdf_model import Proportions
from human.config import HumanConfig

Picture = NDArray[np.uint8]
Color = tuple[float, float, float]
Rgba = tuple[float, float, float, float]
TRANSPARENT: Rgba = (0.0, 0.0, 0.0, 0.0)
NOTHING = -1  # PyBullet's number where a picture shows no link
DAYLIGHT = Light()


@dataclass(frozen=True)
class FurnitureBox:
    """A piece of furniture. size: side lengths, metres. position: of its centre, metres. color: RGB in [0, 1]."""

    size: Sequence[float]
    position: Sequence[float]
    color: Sequence[float]


class PersonCamera:
    """A camera and the person in front of it, with the furniture, in a PyBullet client of their own.

    Attributes:
        camera: its configuration.
        client: PyBullet's client.
        body: the person.
    """

    def __init__(
        self, human: HumanConfig, furniture: Iterable[FurnitureBox] = (), proportions: Proportions | None = None
    ) -> None:
        """Load the person and the furniture.

        Args:
            human: where the person and the camera stand.
            furniture: boxes in the picture.
            proportions: of the project's own model; None: the average.

        Raises:
            ConfigError: a person without a camera, or a body that does not load.
        """
        self.camera = camera_of(human)
        self.client = bullet.connect(bullet.DIRECT)
        try:
            self._furniture = [self._box(box) for box in furniture]
            self.body = Body(human, self.client, visuals=True, proportions=proportions)
        except BaseException:
            self.close()
            raise
        if self.body.cone is not None:
            self.paint(self.body.cone, 0, TRANSPARENT)

    def _box(self, box: FurnitureBox) -> int:
        half = [side / 2 for side in box.size]
        visual = bullet.createVisualShape(
            bullet.GEOM_BOX, halfExtents=half, rgbaColor=[*box.color, 1], physicsClientId=self.client
        )
        return bullet.createMultiBody(0, -1, visual, box.position, physicsClientId=self.client)

    def picture(self, joints: Array, camera: Camera | None = None, light: Light | None = None) -> Picture:
        """Return a picture (height, width, 3) of the person with the arm at angles (J,)."""
        return self.render(joints, camera, light)[0]

    def render(
        self, joints: Array, camera: Camera | None = None, light: Light | None = None
    ) -> tuple[Picture, NDArray[np.bool_]]:
        """Return a picture (height, width, 3) and the mask (height, width) of its background.

        Args:
            joints: (J,) radians, the arm's posture.
            camera: None: the person's own.
            light: None: the default light.
        """
        self.body.pose(joints)
        photo = person_photo(self.client, camera or self.camera, light or DAYLIGHT)
        return photo.colors, photo.links == NOTHING

    def hide_invisible_shapes(self) -> None:
        """Hide the shapes that `camera` does not see in any posture of the arm, which saves a fifth of the time."""
        arm, shapes = self._arm(), self.shapes()
        for link, index, _ in shapes:
            if link in arm:
                self.paint(link, index, TRANSPARENT)
        reference = person_photo(self.client, self.camera).colors
        for link, index, rgba in shapes:
            if link not in arm:
                self.paint(link, index, TRANSPARENT)
            if link in arm or not np.array_equal(reference, person_photo(self.client, self.camera).colors):
                self.paint(link, index, rgba)

    def _arm(self) -> set[int]:
        """Return the links that pointing moves."""
        arm = set(self.body.joints)
        for link in range(bullet.getNumJoints(self.body.body, self.client)):  # parents have lower indices
            if bullet.getJointInfo(self.body.body, link, self.client)[16] in arm:
                arm.add(link)
        return arm

    def shapes(self) -> list[tuple[int, int, Rgba]]:
        """Return (link, index of the shape within the link, RGBA) of all visual shapes but the cone."""
        counts: Counter[int] = Counter()
        found = []
        for row in bullet.getVisualShapeData(self.body.body, physicsClientId=self.client):
            if row[1] != self.body.cone:
                found.append((row[1], counts[row[1]], row[7]))
            counts[row[1]] += 1
        return found

    def paint(self, link: int, index: int, rgba: Sequence[float]) -> None:
        """Give one of the person's shapes this colour; a shape of opacity 0 is not drawn."""
        bullet.changeVisualShape(self.body.body, link, index, rgbaColor=rgba, physicsClientId=self.client)

    @property
    def furniture_count(self) -> int:
        """How many boxes of furniture are drawn."""
        return len(self._furniture)

    def paint_furniture(self, index: int, color: Sequence[float]) -> None:
        """Give box `index` of the furniture an opaque colour, RGB in [0, 1]."""
        bullet.changeVisualShape(self._furniture[index], -1, rgbaColor=[*color, 1], physicsClientId=self.client)

    def close(self) -> None:
        """Disconnect the client. Idempotent."""
        if self.client >= 0:
            bullet.disconnect(self.client)
            self.client = -1


def camera_of(human: HumanConfig) -> Camera:
    """Return the camera that sees this person. Raises ConfigError where there is none."""
    if human.camera is None:
        raise ConfigError("gesture.source=camera needs workspace.human.camera, which this workspace does not have")
    return human.camera


# ---- pictures of a client


@dataclass(frozen=True)
class Photo:
    """What a camera sees: colors (H, W, 3) uint8; depths (H, W), metres ahead of the camera; links (H, W), the numbers
    of bodies and links as PyBullet gives them, -1 where there is nothing."""

    colors: NDArray[np.uint8]
    depths: NDArray[np.float32]
    links: NDArray[np.int32]


def draw(client: int, shape: tuple[int, int], view: list[float], projection: list[float], light: Light) -> Photo:
    """Return what PyBullet's software renderer draws. See-through shapes are opaque, and shadows alone take 20 ms.

    Args:
        client: PyBullet's.
        shape: height and width, pixels.
        view: (16,) OpenGL's matrix, column by column.
        projection: likewise; with the planes NEAR_PLANE and FAR_PLANE.
        light: the only one.
    """
    pixels, depth, links = bullet.getCameraImage(
        shape[1],
        shape[0],
        view,
        projection,
        lightDirection=light.direction,
        lightColor=light.color,
        lightAmbientCoeff=light.ambient,
        lightDiffuseCoeff=light.diffuse,
        lightSpecularCoeff=light.specular,
        shadow=int(light.shadow),
        renderer=bullet.ER_TINY_RENDERER,
        flags=bullet.ER_SEGMENTATION_MASK_OBJECT_AND_LINKINDEX,
        physicsClientId=client,
    )[2:]
    colors = np.reshape(np.asarray(as_bytes(pixels), np.uint8), (*shape, 4))[..., :3].copy()
    buffer = np.reshape(np.asarray(depth, np.float32), shape)
    depths = FAR_PLANE * NEAR_PLANE / (FAR_PLANE - (FAR_PLANE - NEAR_PLANE) * buffer)
    return Photo(colors, depths.astype(np.float32), np.reshape(np.asarray(links, np.int32), shape))


def fixed_view(camera: Camera) -> list[float]:
    """(16,) PyBullet's own view matrix of a camera that is fixed and not rolled.

    It is `CameraFrame.view_matrix`, rounded otherwise. Films and the person's pictures keep their bits with it.
    """
    matrix: list[float] = bullet.computeViewMatrixFromYawPitchRoll(
        camera.target, camera.distance, camera.yaw, camera.pitch, 0, 2
    )
    return matrix


def person_photo(client: int, camera: Camera, light: Light = DAYLIGHT) -> Photo:
    """Return what a fixed camera sees of a client, with the matrices of the pictures that ray readers learned from."""
    projection = bullet.computeProjectionMatrixFOV(camera.fov, camera.width / camera.height, NEAR_PLANE, FAR_PLANE)
    return draw(client, (camera.height, camera.width), fixed_view(camera), projection, light)
