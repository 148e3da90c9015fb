"""What is seen in the pictures of one moment: things and where they are, each with its uncertainty."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from core.cameras import Camera, CameraFrame
from language import COLORS, NOUNS

Array = NDArray[np.float64]
NOUN_NAMES, COLOR_NAMES = tuple(NOUNS), tuple(COLORS)


def probabilities(logs: Array) -> Array:
    """(T, C) probabilities from logarithms of evidence (T, C)."""
    odds = np.exp(logs - logs.max(1, keepdims=True))
    return odds / odds.sum(1, keepdims=True)


def probability(log_odds: Array) -> Array:
    """Return the probabilities of such logarithms of odds."""
    return 1 / (1 + np.exp(-log_odds))


class UnusablePicture(ValueError):
    """A picture in which nothing can be seen. The text is one sentence that names the camera and what is wrong."""


@dataclass(frozen=True, kw_only=True)
class Detections:
    """M things that are seen, in the workspace frame.

    positions: (M, 3) metres: the centre of an object or of an open hand; of a device or fitting, that of its handle.
    covariances: (M, 3, 3) square metres. nouns: (M, len(NOUNS)) and colors: (M, len(COLORS)) probabilities.
    sizes: (M,) metres. yaws: (M,) radians: which way a lever or the handle of a wheel faces; of a cube within a quarter
    turn; of others 0. shares: (M,) in [0, 1]: how far a button or lever is moved or a fitting is open; of others any. A
    lever is told as leaning back by at most half of its way: at its end it looks like one that was placed the other way
    round. targets: (M,) probabilities of being see-through. presence: (M,) probabilities that something is there.
    """

    positions: Array
    covariances: Array
    nouns: Array
    colors: Array
    sizes: Array
    yaws: Array
    shares: Array
    targets: Array
    presence: Array

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, chosen: NDArray) -> Detections:
        """Return the chosen ones. chosen: indices, or (M,) bool."""
        return Detections(**{each.name: getattr(self, each.name)[chosen] for each in fields(self)})

    @classmethod
    def none(cls) -> Detections:
        """Return no detections at all."""
        shapes = {"positions": (3,), "covariances": (3, 3), "nouns": (len(NOUNS),), "colors": (len(COLORS),)}
        return cls(**{each.name: np.zeros((0, *shapes.get(each.name, ()))) for each in fields(cls)})


@dataclass(frozen=True)
class View:
    """A picture (H, W, 3) uint8, the camera that took it, and the frame in which that camera was."""

    picture: NDArray[np.uint8]
    camera: Camera
    frame: CameraFrame


class Detector(Protocol):
    """Finds what is seen in views of one moment, by the names of their cameras."""

    def __call__(self, views: Mapping[str, View]) -> Detections:
        """Raises UnusablePicture for a picture in which nothing can be seen: black, saturated or of another size."""


BLACK, WHITE, FLAT = 12, 247, 2.0  # brightness of pixels that show nothing, of 255, and its standard deviation
MOST_LOST = 0.95  # share of such pixels from which on a picture is unusable


def check_picture(name: str, view: View) -> None:
    """Raise UnusablePicture where nothing can be seen in the picture of the camera with this name."""
    picture, camera = view.picture, view.camera
    if picture.shape != (camera.height, camera.width, 3):
        size = " x ".join(map(str, picture.shape[1::-1]))
        raise UnusablePicture(
            f"the picture of camera {name} is {size} pixels, and the camera's are {camera.width} x {camera.height}"
        )
    reason = why_unusable(picture)
    if reason:
        raise UnusablePicture(f"the picture of camera {name} {reason}")


def why_unusable(picture: NDArray[np.uint8]) -> str | None:
    """Return why nothing can be seen in a picture (H, W, 3), as the end of a sentence; None where something can be."""
    small = picture[::2, ::2]
    if (small.max(2) <= BLACK).mean() > MOST_LOST:
        return "is black: is it covered, or the light off?"
    if (small.min(2) >= WHITE).mean() > MOST_LOST:
        return "is saturated: take less light, or a shorter exposure"
    if small.std() < FLAT:
        return "shows a single colour: is the camera connected?"
    return None
