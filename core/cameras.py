"""The camera model: a pinhole camera's configuration, its frame, and how points and pixels follow from each other.

Pixels are (u, v): u to the right and v down, from the upper left corner of a picture; the middle of the first pixel is
(0.5, 0.5). A camera's frame has its axes to the right, down and ahead, as OpenCV's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.errors import ConfigError
from core.schema import Checked, one_of, within

Array = NDArray[np.float64]
NEAR_PLANE, FAR_PLANE = 0.05, 10.0  # metres: what is nearer or farther is not drawn


@dataclass(frozen=True, kw_only=True)
class Camera(Checked):
    """A calibrated camera without distortion.

    target: the point that it looks at, metres. distance: from the target, metres. yaw, pitch, roll: degrees.
    fov: vertical field of view, degrees. width, height: pixels. mount: "workspace": it is fixed, and target and angles
    are in the workspace's frame; "gripper": it moves with the gripper, and they are in the frame of its centre.
    """

    target: list[float] = within(-20, 20, count=3)
    distance: float = within(0.1, 20)
    yaw: float = within(-360, 360)
    pitch: float = within(-90, 90)
    fov: float = within(1, 120)
    width: int = within(16, 4096)
    height: int = within(16, 4096)
    roll: float = within(-180, 180, default=0.0)  # configs of older versions lack it
    mount: str = one_of("workspace", "gripper", default="workspace")

    @property
    def focal(self) -> float:
        """The focal length, pixels."""
        return self.height / 2 / math.tan(math.radians(self.fov) / 2)

    @property
    def middle(self) -> Array:
        """(2,) pixels, where the optical axis meets the picture."""
        return np.array([self.width / 2, self.height / 2])

    @property
    def matrix(self) -> Array:
        """(3, 3) the intrinsic matrix, as OpenCV takes it but for its pixels, whose middles are whole numbers."""
        (x, y), focal = self.middle, self.focal
        return np.array([[focal, 0.0, x], [0.0, focal, y], [0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class Light:
    """A directional light.

    direction: where the light comes from, of any length. color: RGB. ambient, diffuse, specular: reflected shares.
    shadow: whether things throw shadows, which takes PyBullet longer than all else in a picture.
    """

    direction: tuple[float, float, float] = (0.5, -0.6, 1.5)
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    ambient: float = 0.6
    diffuse: float = 0.35
    specular: float = 0.05
    shadow: bool = False


@dataclass(frozen=True)
class CameraFrame:
    """The frame of a camera.

    place: (3,) metres, the origin in the workspace frame.
    axes: (3, 3), whose rows are the axes to the right, down and ahead in the workspace frame.
    """

    place: Array
    axes: Array

    @classmethod
    def of(cls, camera: Camera, gripper: tuple[Array, Array] | None = None) -> CameraFrame:
        """Return the frame of a camera.

        Args:
            camera: its configuration.
            gripper: position (3,), metres, and rotation (3, 3) of the gripper's centre, for a camera mounted there.

        Raises:
            ConfigError: a camera that is mounted on the gripper without a gripper.
        """
        yaw, pitch = math.radians(camera.yaw), math.radians(camera.pitch)
        ahead = np.array([-math.sin(yaw) * math.cos(pitch), math.cos(yaw) * math.cos(pitch), math.sin(pitch)])
        right = np.array([math.cos(yaw), math.sin(yaw), 0.0])
        axes = np.array([right, np.cross(ahead, right), ahead])
        if camera.roll:
            cosine, sine = math.cos(math.radians(camera.roll)), math.sin(math.radians(camera.roll))
            axes[:2] = np.array([[cosine, sine], [-sine, cosine]]) @ axes[:2]
        place = np.asarray(camera.target) - camera.distance * ahead
        if camera.mount == "workspace":
            return cls(place, axes)
        if gripper is None:
            raise ConfigError(f"mount={camera.mount} needs a gripper on which the camera is mounted")
        position, rotation = gripper
        return cls(position + rotation @ place, axes @ rotation.T)

    def from_workspace(self, points: Array, directions: Array) -> tuple[Array, Array]:
        """Transform points and directions (..., 3) from the workspace frame into the camera's."""
        return _times(points - self.place, self.axes.T), _times(directions, self.axes.T)

    def to_workspace(self, points: Array, directions: Array) -> tuple[Array, Array]:
        """Transform points and directions (..., 3) from the camera's frame into the workspace frame."""
        return _times(points, self.axes) + self.place, _times(directions, self.axes)

    @property
    def view_matrix(self) -> list[float]:
        """(16,) OpenGL's view matrix, column by column."""
        rotation = self.axes * np.array([[1.0], [-1.0], [-1.0]])
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = rotation, -rotation @ self.place
        return matrix.T.ravel().tolist()  # type: ignore[no-any-return]


def calibration_of(camera: Camera) -> dict[str, Any]:
    """Return where a camera is and how it forms pictures, for those who know nothing of `Camera`.

    Returns:
        "mount", "width" and "height" as of `Camera`; "matrix" (3, 3), the intrinsic matrix, pixels; and of the frame
        "place" (3,), metres, and "axes" (3, 3), whose rows point to the right, down and ahead: in the frame of the
        gripper's centre with mount=gripper, otherwise in the workspace's.
    """
    frame = CameraFrame.of(replace(camera, mount="workspace"))
    size = {"mount": camera.mount, "width": camera.width, "height": camera.height}
    return size | {"matrix": camera.matrix.tolist(), "place": frame.place.tolist(), "axes": frame.axes.tolist()}


def project(camera: Camera, frame: CameraFrame, points: Array) -> tuple[Array, Array]:
    """Return pixels (..., 2) and depths (...,), metres ahead of the camera, of points (..., 3) in the workspace."""
    inside = _times(points - frame.place, frame.axes.T)
    depths = inside[..., 2]
    return camera.middle + camera.focal * inside[..., :2] / depths[..., None], depths


def unproject(camera: Camera, frame: CameraFrame, pixels: Array, depths: Array) -> Array:
    """Return the points (..., 3), metres in the workspace, at pixels (..., 2) and depths (...,), metres."""
    across = (pixels - camera.middle) / camera.focal
    inside = np.concatenate((across, np.ones_like(across[..., :1])), axis=-1) * depths[..., None]
    return _times(inside, frame.axes) + frame.place


def angles_of(axes: Array) -> tuple[float, float, float]:
    """Return yaw, pitch and roll, degrees, of a camera with these axes (3, 3), as in `CameraFrame`."""
    ahead = axes[2]
    pitch = math.asin(float(np.clip(ahead[2], -1.0, 1.0)))
    level = math.hypot(ahead[0], ahead[1])
    yaw = math.atan2(-ahead[0], ahead[1]) if level > 1e-9 else math.atan2(axes[0, 1], axes[0, 0])
    right = np.array([math.cos(yaw), math.sin(yaw), 0.0])
    down = np.cross(ahead, right)
    roll = math.atan2(float(axes[0] @ down), float(axes[0] @ right))
    return math.degrees(yaw), math.degrees(pitch), math.degrees(roll)


def camera_at(frame: CameraFrame, like: Camera, distance: float = 1.0) -> Camera:
    """Return the camera in this frame with the field of view and size of another one."""
    yaw, pitch, roll = angles_of(frame.axes)
    target: Sequence[float] = (frame.place + distance * frame.axes[2]).tolist()
    return Camera(
        target=list(target),
        distance=distance,
        yaw=yaw,
        pitch=pitch,
        roll=roll,
        fov=like.fov,
        width=like.width,
        height=like.height,
        mount=like.mount,
    )


def _times(vectors: Array, matrix: Array) -> Array:
    """Return vectors (..., 3) @ matrix (3, 3), with bits that do not depend on the number of vectors.

    On some processors those of BLAS do.
    """
    return (vectors[..., None] * matrix).sum(-2)
