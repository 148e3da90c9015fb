"""Frames to learn from: people of many builds and colours point over the table, and the simulator says where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from conf.schema import ConfigError
from human.body.person_camera import CameraFrame, Color, FurnitureBox, Light, PersonCamera, Picture
from human.body.pybullet_body import Body
from human.body.urdf_model import Proportions
from human.config import Camera, HumanConfig
from human.pointing_arm import Unreachable
from human.pointing_ik import Array

BODIES = 32
WIDER = 0.12  # metres around the object area that are pointed at, too
HIGHEST = 0.08  # metres above the table that are pointed at
BETWEEN = 0.25  # of the frames: the arm is on its way from one gesture to the next
LOOSE = 0.25  # of the frames: an arm that no target asked for
LOOSENESS = 0.06  # radians, standard deviation of each of its joints
TRIES = 1000  # targets of which at least one has to be within reach
TONES = ((0.36, 0.22, 0.14), (0.96, 0.8, 0.7))  # the darkest and the lightest skin
CLOTHES = ("skin", "shirt", "trousers", "shoes", "hair")
# How far camera and person stray from their places as the picture has it, together: standard deviations in metres and
# degrees, of which nothing strays further than two (`_normal`).
CAMERA_NOISE = {"target": 0.025, "distance": 0.02, "yaw": 2.5, "pitch": 1.5, "fov": 0.3}


@dataclass(frozen=True)
class LabelledFrames:
    """pictures (N, H, W, 3) uint8; tips (N, 3), metres, and directions (N, 3) in the camera's own frame."""

    pictures: Picture
    tips: Array
    directions: Array


class FrameGenerator:
    """A pool of bodies, each in a client of its own, that are dressed, lit and seen anew for every frame."""

    def __init__(
        self,
        human: HumanConfig,
        furniture: Sequence[FurnitureBox],
        area: Sequence[float],
        rng: Generator,
        bodies: int | None = None,
    ) -> None:
        """bodies: how many there are; BODIES otherwise."""
        self._area, self._rng = area, rng
        self._sights = [PersonCamera(human, furniture, sample_proportions(rng)) for _ in range(bodies or BODIES)]
        self._shapes = [_shapes(sight) for sight in self._sights]
        self._last = [sight.body.rest for sight in self._sights]

    def frames(self, count: int) -> LabelledFrames:
        """So many, each with what the simulator says of its finger."""
        shots = [self.sample() for _ in range(count)]
        pictures, tips, directions = (np.stack(each) for each in zip(*shots, strict=True))
        return LabelledFrames(pictures, tips, directions)

    def sample(self) -> tuple[Picture, Array, Array]:
        """One picture (H, W, 3), and the fingertip (3,), metres, and direction (3,) in its camera's frame."""
        index = int(self._rng.integers(len(self._sights)))
        sight = self._sights[index]
        self._dress(index)
        camera = perturb_camera(sight.camera, self._rng)
        picture, empty = sight.draw(self._gesture(index), camera, sample_light(self._rng))
        _fill(picture, empty, self._rng)
        return picture, *CameraFrame.of(camera).from_workspace(*sight.body.ray())

    def _gesture(self, index: int) -> Array:
        """Joint angles (J,) of a gesture, of an arm on its way to it, or of one that is a bit loose."""
        body, rng = self._sights[index].body, self._rng
        joints = self._aimed(body)
        before, self._last[index] = self._last[index], joints
        how = rng.random()
        if how < BETWEEN:
            joints = before + rng.random() * (joints - before)
        elif how < BETWEEN + LOOSE:
            joints = joints + LOOSENESS * rng.standard_normal(len(joints))
        return np.clip(joints, body.low, body.high)

    def _aimed(self, body: Body) -> Array:
        """Joint angles (J,) at which the body points at some place that it can. Raises ConfigError."""
        for _ in range(TRIES):
            try:
                return body.solve(sample_target(self._area, self._rng))
            except Unreachable:
                continue
        raise ConfigError(f"workspace.object_area={list(self._area)}: the person can't point at any of {TRIES} places")

    def _dress(self, index: int) -> None:
        """Other colours for all there is."""
        sight, new = self._sights[index], sample_colors(self._rng)
        for link, shape, name in self._shapes[index]:
            sight.paint(link, shape, (*new[name], 1))
        for index in range(sight.furniture_count):
            sight.paint_furniture(index, self._rng.random(3).tolist())

    def close(self) -> None:
        for sight in self._sights:
            sight.close()


def sample_target(area: Sequence[float], rng: Generator) -> Array:
    """(3,) metres: somewhere over the area (x0, x1, y0, y1) and WIDER around it."""
    x0, x1, y0, y1 = area
    return rng.uniform([x0 - WIDER, y0 - WIDER, 0.0], [x1 + WIDER, y1 + WIDER, HIGHEST])


def sample_proportions(rng: Generator) -> Proportions:
    """Somebody: 1.6 to 1.9 m tall, with lengths that stray by some percent from the average."""
    usual = Proportions()
    spread = {"shoulder_height": 0.01, "shoulder_width": 0.05, "upper_arm": 0.04, "forearm": 0.04, "hand": 0.04}
    lengths = {name: getattr(usual, name) * (1 + share * _normal(rng)) for name, share in spread.items()}
    torso = usual.torso_width * (1 + 0.06 * _normal(rng))
    return replace(usual, height=rng.uniform(1.6, 1.9), girth=rng.uniform(0.82, 1.2), torso_width=torso, **lengths)


def _normal(rng: Generator) -> float:
    return float(np.clip(rng.standard_normal(), -2, 2))


def perturb_camera(camera: Camera, rng: Generator) -> Camera:
    """The camera, not quite where it should be, with a lens that isn't quite what it should be."""
    moved = {
        name: getattr(camera, name) + CAMERA_NOISE[name] * _normal(rng) for name in ("distance", "yaw", "pitch", "fov")
    }
    return replace(camera, target=[each + CAMERA_NOISE["target"] * _normal(rng) for each in camera.target], **moved)


def sample_light(rng: Generator) -> Light:
    """From anywhere above, of any warmth, bright or dim."""
    x, y = rng.uniform(-1.5, 1.5, 2).tolist()
    red, green, blue = rng.uniform(0.8, 1.1, 3).tolist()
    ambient = rng.uniform(0.35, 0.75)
    diffuse = rng.uniform(0.15, 1.05 - ambient)
    return Light((x, y, rng.uniform(0.3, 1.5)), (red, green, blue), ambient, diffuse, rng.uniform(0.0, 0.2))


def sample_colors(rng: Generator) -> dict[str, Color]:
    """What somebody wears, and the colours of their skin and hair; RGB in [0, 1]."""
    chosen = {name: rng.random(3) for name in CLOTHES}
    share = rng.random()
    chosen["skin"] = (1 - share) * np.array(TONES[0]) + share * np.array(TONES[1]) + rng.uniform(-0.05, 0.05, 3)
    chosen["hair"] *= 0.8
    return {name: (float(r), float(g), float(b)) for name, (r, g, b) in chosen.items()}


def _fill(picture: Picture, empty: NDArray[np.bool_], rng: Generator) -> None:
    """Put a wall where nothing stands: one colour that shades off to another."""
    height, width = empty.shape
    across, down = np.meshgrid(np.linspace(0, 1, width), np.linspace(0, 1, height))
    turn = rng.uniform(0, 2 * np.pi)
    share = np.clip(0.5 + (across - 0.5) * np.cos(turn) + (down - 0.5) * np.sin(turn), 0, 1)[..., None]
    one, other = rng.integers(0, 256, (2, 3)) if rng.random() < 0.8 else np.full((2, 3), 255)
    picture[empty] = ((1 - share) * one + share * other).astype(np.uint8)[empty]


def _shapes(sight: PersonCamera) -> list[tuple[int, int, str]]:
    """(link, shape of that link, what it is of `CLOTHES`) of all of a body's shapes that have such a colour."""
    usual = Proportions()
    named = [
        (link, index, next((n for n in CLOTHES if np.allclose(rgba[:3], getattr(usual, n), atol=1e-3)), None))
        for link, index, rgba in sight.shapes()
    ]
    return [(link, index, name) for link, index, name in named if name is not None]
