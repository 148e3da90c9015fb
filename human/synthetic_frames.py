"""Training frames for the ray reader: random people point over the table, and the simulator labels their rays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.cameras import Camera, CameraFrame, Light
from core.errors import ConfigError
from human.arms import Array, Unreachable
from human.body import Body
from human.body.person_camera import Color, FurnitureBox, PersonCamera, Picture
from human.body.urdf_model import Proportions
from human.config import HumanConfig

BODIES = 32
MARGIN = 0.12  # metres around the object area that targets may lie in
MAX_HEIGHT = 0.08  # metres above the table that targets may lie at
IN_MOTION = 0.25  # share of frames with the arm between two gestures
JITTERED = 0.25  # share of frames with noise on the joints, in postures that inverse kinematics would not find
JITTER = 0.06  # radians, standard deviation of that noise
TRIES = 1000  # targets of which at least one must be within reach
SKIN_TONES = ((0.36, 0.22, 0.14), (0.96, 0.8, 0.7))  # the darkest and the lightest
COLORED_PARTS = ("skin", "shirt", "trousers", "shoes", "hair")
# Displacement of the camera relative to the person: standard deviations in metres and degrees; truncated at two of
# them (`_truncated_normal`).
CAMERA_NOISE = {"target": 0.025, "distance": 0.02, "yaw": 2.5, "pitch": 1.5, "fov": 0.3}


@dataclass(frozen=True)
class LabelledFrames:
    """N pictures with their rays.

    pictures: (N, H, W, 3) uint8. tips: (N, 3) metres, and directions: (N, 3), both in the camera's frame.
    """

    pictures: Picture
    tips: Array
    directions: Array


class FrameGenerator:
    """Source of frames of a pool of random bodies, with random colours, light, camera pose and gesture."""

    def __init__(
        self,
        human: HumanConfig,
        furniture: Sequence[FurnitureBox],
        *,
        area: Sequence[float],
        rng: Generator,
        bodies: int | None = None,
    ) -> None:
        """Load the bodies, each into a PyBullet client of its own.

        Args:
            human: where the person and the camera stand.
            furniture: boxes in the picture.
            area: x0, x1, y0, y1 of the objects, metres.
            rng: source of all that is random.
            bodies: size of the pool; None: BODIES.
        """
        self._area, self._rng = area, rng
        self._cameras = [PersonCamera(human, furniture, sample_proportions(rng)) for _ in range(bodies or BODIES)]
        self._shapes = [_colored_shapes(camera) for camera in self._cameras]
        self._last = [camera.body.rest for camera in self._cameras]

    @property
    def bodies(self) -> list[Body]:
        """The pool."""
        return [camera.body for camera in self._cameras]

    def frames(self, count: int) -> LabelledFrames:
        """Return `count` new frames. Raises ConfigError if the person can't point at the object area."""
        samples = [self.sample() for _ in range(count)]
        pictures, tips, directions = (np.stack(each) for each in zip(*samples, strict=True))
        return LabelledFrames(pictures, tips, directions)

    def sample(self) -> tuple[Picture, Array, Array]:
        """Return a picture (H, W, 3), the fingertip (3,), metres, and the direction (3,) in the camera's frame."""
        index = int(self._rng.integers(len(self._cameras)))
        person = self._cameras[index]
        self._recolor(index)
        camera = perturb_camera(person.camera, self._rng)
        picture, background = person.render(self._gesture(index), camera, sample_light(self._rng))
        _paint_background(picture, background, self._rng)
        return picture, *CameraFrame.of(camera).from_workspace(*person.body.ray())

    def _gesture(self, index: int) -> Array:
        """Return joint angles (J,) of a gesture, of an arm in motion between two gestures, or of a jittered gesture."""
        body, rng = self._cameras[index].body, self._rng
        joints = self._pointing_joints(body)
        before, self._last[index] = self._last[index], joints
        draw = rng.random()
        if draw < IN_MOTION:
            joints = before + rng.random() * (joints - before)
        elif draw < IN_MOTION + JITTERED:
            joints = joints + JITTER * rng.standard_normal(len(joints))
        return np.clip(joints, body.low, body.high)

    def _pointing_joints(self, body: Body) -> Array:
        """Return joint angles (J,) at which the body points at a random target within reach. Raises ConfigError."""
        for _ in range(TRIES):
            try:
                return body.solve(sample_target(self._area, self._rng))
            except Unreachable:
                continue
        raise ConfigError(f"workspace.object_area={list(self._area)}: the person can't point at any of {TRIES} places")

    def _recolor(self, index: int) -> None:
        """Give the person and the furniture random colours."""
        camera, new = self._cameras[index], sample_colors(self._rng)
        for link, shape, name in self._shapes[index]:
            camera.paint(link, shape, (*new[name], 1))
        for box in range(camera.furniture_count):
            camera.paint_furniture(box, self._rng.random(3).tolist())

    def close(self) -> None:
        """Disconnect all clients."""
        for camera in self._cameras:
            camera.close()


def sample_target(area: Sequence[float], rng: Generator) -> Array:
    """Return a point (3,), metres, over the area (x0, x1, y0, y1) extended by MARGIN."""
    x0, x1, y0, y1 = area
    return rng.uniform([x0 - MARGIN, y0 - MARGIN, 0.0], [x1 + MARGIN, y1 + MARGIN, MAX_HEIGHT])


def sample_proportions(rng: Generator) -> Proportions:
    """Return a person 1.6 to 1.9 m tall, whose other lengths vary by some percent around the average."""
    average = Proportions()
    spread = {"shoulder_height": 0.01, "shoulder_width": 0.05, "upper_arm": 0.04, "forearm": 0.04, "hand": 0.04}
    lengths = {name: getattr(average, name) * (1 + share * _truncated_normal(rng)) for name, share in spread.items()}
    torso = average.torso_width * (1 + 0.06 * _truncated_normal(rng))
    return replace(average, height=rng.uniform(1.6, 1.9), girth=rng.uniform(0.82, 1.2), torso_width=torso, **lengths)


def _truncated_normal(rng: Generator) -> float:
    """Return a standard normal number, clipped to [-2, 2]."""
    return float(np.clip(rng.standard_normal(), -2, 2))


def perturb_camera(camera: Camera, rng: Generator) -> Camera:
    """Return the camera with noise on its pose and field of view (CAMERA_NOISE)."""
    scalars = ("distance", "yaw", "pitch", "fov")
    moved = {name: getattr(camera, name) + CAMERA_NOISE[name] * _truncated_normal(rng) for name in scalars}
    target = [each + CAMERA_NOISE["target"] * _truncated_normal(rng) for each in camera.target]
    return replace(camera, target=target, **moved)


def sample_light(rng: Generator) -> Light:
    """Return a light from above, of random direction, colour temperature and brightness."""
    x, y = rng.uniform(-1.5, 1.5, 2).tolist()
    red, green, blue = rng.uniform(0.8, 1.1, 3).tolist()
    ambient = rng.uniform(0.35, 0.75)
    diffuse = rng.uniform(0.15, 1.05 - ambient)
    return Light((x, y, rng.uniform(0.3, 1.5)), (red, green, blue), ambient, diffuse, rng.uniform(0.0, 0.2))


def sample_colors(rng: Generator) -> dict[str, Color]:
    """Return random colours of COLORED_PARTS, RGB in [0, 1]."""
    chosen = {name: rng.random(3) for name in COLORED_PARTS}
    share = rng.random()
    chosen["skin"] = (
        (1 - share) * np.array(SKIN_TONES[0]) + share * np.array(SKIN_TONES[1]) + rng.uniform(-0.05, 0.05, 3)
    )
    chosen["hair"] *= 0.8
    return {name: (float(r), float(g), float(b)) for name, (r, g, b) in chosen.items()}


def _paint_background(picture: Picture, background: NDArray[np.bool_], rng: Generator) -> None:
    """Fill the background with a gradient between two random colours."""
    height, width = background.shape
    across, down = np.meshgrid(np.linspace(0, 1, width), np.linspace(0, 1, height))
    turn = rng.uniform(0, 2 * np.pi)
    share = np.clip(0.5 + (across - 0.5) * np.cos(turn) + (down - 0.5) * np.sin(turn), 0, 1)[..., None]
    one, other = rng.integers(0, 256, (2, 3)) if rng.random() < 0.8 else np.full((2, 3), 255)
    picture[background] = ((1 - share) * one + share * other).astype(np.uint8)[background]


def _colored_shapes(camera: PersonCamera) -> list[tuple[int, int, str]]:
    """Return (link, index of the shape within it, part) of all shapes that have the colour of one of COLORED_PARTS."""
    average = Proportions()
    parts = [
        (link, index, next((n for n in COLORED_PARTS if np.allclose(rgba[:3], getattr(average, n), atol=1e-3)), None))
        for link, index, rgba in camera.shapes()
    ]
    return [(link, index, part) for link, index, part in parts if part is not None]
