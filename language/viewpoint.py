"""Viewpoints: the frames in which relations and superlatives are evaluated.

A viewer stands at a place and looks along a heading. In the viewer's frame x points away from the viewer, y to the
viewer's left and z up. Each `Scene` has a viewpoint, by default "robot".
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from language.errors import check_known


class Viewpoint(NamedTuple):
    """place: x, y in metres. heading: radians from the x axis. Both in the workspace frame."""

    place: tuple[float, float]
    heading: float


VIEWPOINTS: dict[str, Viewpoint] = {
    "robot": Viewpoint((0.0, 0.0), 0.0),
    "human": Viewpoint((1.0, 0.0), math.pi),  # across the table, looking at the robot
}

WHOSE_LEFT = {
    "robot": "left and right are the robot's; the front is its side of the table",
    "human": "left and right are yours, opposite the robot; the front is your side of the table",
}


def whose_left(name: str) -> str:
    """Return whose left, right and front are meant, in words. Raises LanguageError for an unknown viewpoint."""
    check_known("viewpoint", name, WHOSE_LEFT)
    return WHOSE_LEFT[name]


def seen_from(name: str, positions: np.ndarray) -> np.ndarray:
    """Return positions (..., 3) in the viewer's frame, given those in the workspace frame.

    Raises LanguageError for an unknown viewpoint.
    """
    check_known("viewpoint", name, VIEWPOINTS)
    (x, y), heading = VIEWPOINTS[name]
    if (x, y, heading) == (0.0, 0.0, 0.0):
        return positions
    c, s = math.cos(heading), math.sin(heading)
    turned = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return (positions - np.array([x, y, 0.0])) @ turned.T
