"""Whose left is left: the frame that relations and superlatives are read in.

A viewer stands at a place and looks along a heading; what is seen from there has x away from the viewer, y to the
viewer's left, z up. A `Scene` says whose eyes its words are spoken with, "robot" unless told.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from language.errors import check_known


class Viewpoint(NamedTuple):
    """place: x, y in metres; heading: radians from the x axis, in the workspace frame."""

    place: tuple[float, float]
    heading: float


VIEWPOINTS: dict[str, Viewpoint] = {
    "robot": Viewpoint((0.0, 0.0), 0.0),
    "human": Viewpoint((1.0, 0.0), math.pi),  # across the table, looking at the robot
}


def seen_from(name: str, positions: np.ndarray) -> np.ndarray:
    """Positions (..., 3) of the workspace frame in the viewer's. Raises LanguageError for an unknown viewpoint."""
    check_known("viewpoint", name, VIEWPOINTS)
    (x, y), heading = VIEWPOINTS[name]
    if (x, y, heading) == (0.0, 0.0, 0.0):
        return positions
    c, s = math.cos(heading), math.sin(heading)
    turned = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return (positions - np.array([x, y, 0.0])) @ turned.T
