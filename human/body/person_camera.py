"""What a fixed camera sees of a person who points, and how its frame lies in the workspace.

In the picture: the person, without the cone along the finger that people watching a film are shown, and the furniture.
Robot and objects are left out: as an episode begins they are out of view, and the picture is the same bit for bit.
Bullet's software renderer takes 2.2 ms for 128 x 128 pixels without them (2.9 before `Sight.spare`), 5.0 with them.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import pybullet as bullet
from numpy.typing import NDArray

from conf.schema import ConfigError
from human.body.pybullet_body import Body
from human.body.urdf_model import Proportions
from human.config import Camera, HumanConfig
from human.pointing_ik import Array

Picture = NDArray[np.uint8]
Color = tuple[float, float, float]
Rgba = tuple[float, float, float, float]
TRANSPARENT: Rgba = (0.0, 0.0, 0.0, 0.0)
NEAR, FAR = 0.05, 10.0  # metres between which anything is drawn


@dataclass(frozen=True)
class FurnitureBox:
    """A piece of furniture: size and position of its centre in metres, color RGB in [0, 1]."""

    size: Sequence[float]
    position: Sequence[float]
    color: Sequence[float]


@dataclass(frozen=True)
class Light:
    """direction: where it comes from, of any length. ambient, diffuse, specular: shares of it that come back."""

    direction: Color = (0.5, -0.6, 1.5)
    color: Color = (1.0, 1.0, 1.0)
    ambient: float = 0.6
    diffuse: float = 0.35
    specular: float = 0.05


class PersonCamera:
    """A person and the furniture in a PyBullet client of their own, posed for a camera. Raises ConfigError."""

    def __init__(
        self, human: HumanConfig, furniture: Iterable[FurnitureBox] = (), proportions: Proportions | None = None
    ) -> None:
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
        """The person with the arm at these angles (J,), as (height, width, 3)."""
        return self.draw(joints, camera, light)[0]

    def draw(
        self, joints: Array, camera: Camera | None = None, light: Light | None = None
    ) -> tuple[Picture, NDArray[np.bool_]]:
        """The picture (height, width, 3), and the pixels (height, width) in which nothing stands."""
        self.body.pose(joints)
        return draw(self.client, camera or self.camera, light or Light())

    def hide_invisible_shapes(self) -> None:
        """Draw no longer what `camera` does not see, however the arm is: it takes a fifth of the time."""
        arm, shapes = self._arm(), self.shapes()
        for link, index, _ in shapes:
            if link in arm:
                self.paint(link, index, TRANSPARENT)
        plain = draw(self.client, self.camera, Light())[0]
        for link, index, rgba in shapes:
            if link not in arm:
                self.paint(link, index, TRANSPARENT)
            if link in arm or not np.array_equal(plain, draw(self.client, self.camera, Light())[0]):
                self.paint(link, index, rgba)

    def _arm(self) -> set[int]:
        """The links that pointing moves."""
        arm = set(self.body.joints)
        for link in range(bullet.getNumJoints(self.body.body, self.client)):  # what carries others comes first
            if bullet.getJointInfo(self.body.body, link, self.client)[16] in arm:
                arm.add(link)
        return arm

    def shapes(self) -> list[tuple[int, int, Rgba]]:
        """(link, which of that link's shapes, RGBA) of all that is drawn of the person."""
        counts: Counter[int] = Counter()
        found = []
        for row in bullet.getVisualShapeData(self.body.body, physicsClientId=self.client):
            if row[1] != self.body.cone:
                found.append((row[1], counts[row[1]], row[7]))
            counts[row[1]] += 1
        return found

    def paint(self, link: int, index: int, rgba: Sequence[float]) -> None:
        """Give one of the person's shapes this colour; opacity 0 is not drawn at all."""
        bullet.changeVisualShape(self.body.body, link, index, rgbaColor=rgba, physicsClientId=self.client)

    @property
    def furniture_count(self) -> int:
        """How many boxes of furniture are drawn."""
        return len(self._furniture)

    def paint_furniture(self, index: int, color: Sequence[float]) -> None:
        """Gives box `index` of the furniture an opaque colour, RGB in [0, 1]."""
        bullet.changeVisualShape(self._furniture[index], -1, rgbaColor=[*color, 1], physicsClientId=self.client)

    def close(self) -> None:
        """Disconnects the client. Idempotent."""
        if self.client >= 0:
            bullet.disconnect(self.client)
            self.client = -1


def draw(client: int, camera: Camera, light: Light) -> tuple[Picture, NDArray[np.bool_]]:
    """What a client holds, seen by the camera, as `Sight.draw`; without shadows, which alone would take 20 ms."""
    _, _, pixels, depth, _ = bullet.getCameraImage(
        camera.width,
        camera.height,
        bullet.computeViewMatrixFromYawPitchRoll(camera.target, camera.distance, camera.yaw, camera.pitch, 0, 2),
        bullet.computeProjectionMatrixFOV(camera.fov, camera.width / camera.height, NEAR, FAR),
        lightDirection=light.direction,
        lightColor=light.color,
        lightAmbientCoeff=light.ambient,
        lightDiffuseCoeff=light.diffuse,
        lightSpecularCoeff=light.specular,
        shadow=0,
        flags=bullet.ER_NO_SEGMENTATION_MASK,
        renderer=bullet.ER_TINY_RENDERER,
        physicsClientId=client,
    )
    shape = (camera.height, camera.width)
    picture = np.reshape(np.asarray(pixels, np.uint8), (*shape, 4))[..., :3]
    return np.ascontiguousarray(picture), np.reshape(np.asarray(depth), shape) > 0.9999


def camera_of(human: HumanConfig) -> Camera:
    """The camera that sees this person. Raises ConfigError where there is none."""
    if human.camera is None:
        raise ConfigError("gesture.source=camera needs workspace.human.camera, which this workspace does not have")
    return human.camera


@dataclass(frozen=True)
class CameraFrame:
    """A camera's own frame. place: (3,) metres in the workspace frame. axes: (3, 3), its rows right, down and ahead."""

    place: Array
    axes: Array

    @classmethod
    def of(cls, camera: Camera) -> CameraFrame:
        yaw, pitch = math.radians(camera.yaw), math.radians(camera.pitch)
        ahead = np.array([-math.sin(yaw) * math.cos(pitch), math.cos(yaw) * math.cos(pitch), math.sin(pitch)])
        right = np.array([math.cos(yaw), math.sin(yaw), 0.0])
        return cls(
            np.asarray(camera.target) - camera.distance * ahead, np.array([right, np.cross(ahead, right), ahead])
        )

    def from_workspace(self, points: Array, directions: Array) -> tuple[Array, Array]:
        """Points and directions (..., 3) of the workspace frame in the camera's."""
        return _turned(points - self.place, self.axes.T), _turned(directions, self.axes.T)

    def to_workspace(self, points: Array, directions: Array) -> tuple[Array, Array]:
        """Points and directions (..., 3) of the camera's frame in the workspace's."""
        return _turned(points, self.axes) + self.place, _turned(directions, self.axes)


def _turned(vectors: Array, axes: Array) -> Array:
    """(..., 3) vectors @ axes (3, 3), of the same bits however many there are: on some processors BLAS gives others."""
    return (vectors[..., None] * axes).sum(-2)
