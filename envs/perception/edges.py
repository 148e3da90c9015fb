"""Edges between black and white in pictures: how wide they are, and the corners in which four of them meet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Gray = NDArray[np.uint8]
REACH = 2.0  # pixels on either side of an edge, for its width
SIDE_REACH, STEP = 3.0, 0.25  # pixels on either side of a marker's side, and between places
SAMPLES = 25  # along a side
CONTRAST = 25.0  # gray levels between ink and paper
FEWEST = 8  # places of a side


def edge_width(gray: Gray, edges: Sequence[tuple[Array, Array]]) -> float:
    """Return over how many pixels a picture changes from black to white across edges, the median; 0 for no edges.

    It is the contrast over the steepest slope: the white beside an edge may be narrower than the blur.
    """
    if not edges:
        return 0.0
    middle = np.array([(one + other) / 2 for one, other in edges])
    columns, rows = np.clip(middle, 0, np.array(gray.shape[::-1]) - 1).astype(int).T
    around = gray[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    contrast = float(np.subtract(*np.percentile(around, (97, 3)))) if around.size > 16 else 0.0
    slopes = [_slope(gray, one, other) for one, other in edges]
    return contrast / max(float(np.median(slopes)), 0.1)


def _slope(gray: Gray, one: Array, other: Array) -> float:
    """Return the steepest slope, gray levels a pixel, across an edge from pixel to pixel."""
    along = other - one
    across = np.array([-along[1], along[0]]) / max(float(np.linalg.norm(along)), 1e-6)
    distances = np.arange(-REACH, REACH + 0.01, 0.5)
    places = one + np.linspace(0.25, 0.75, 9)[:, None, None] * along + distances[:, None] * across
    profile = bilinear(gray, places - 0.5).mean(0)
    return float(np.abs(profile[2:] - profile[:-2]).max())


def bilinear(gray: Gray, places: Array) -> Array:
    """Return the values of a picture at places (..., 2), the middle of whose first pixel is (0, 0)."""
    height, width = gray.shape
    x, y = np.clip(places[..., 0], 0, width - 1.001), np.clip(places[..., 1], 0, height - 1.001)
    column, row = x.astype(int), y.astype(int)
    right, down = x - column, y - row
    values = gray.astype(np.float64)
    upper = values[row, column] * (1 - right) + values[row, column + 1] * right
    lower = values[row + 1, column] * (1 - right) + values[row + 1, column + 1] * right
    result: Array = upper * (1 - down) + lower * down
    return result


def quad_corners(gray: Gray, corners: Array) -> Array:
    """Return the corners (4, 2) of a black quadrilateral on white, pixels: where lines along its sides intersect.

    A window around a corner finds it worse: blur makes it round. corners: (4, 2) near them; they are returned where a
    side has too little contrast.
    """
    middle = corners.mean(0)
    lines = [_line(gray, one, other, middle) for one, other in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    found = []
    for before, after in zip([lines[-1], *lines[:-1]], lines, strict=True):
        if before is None or after is None or abs(np.linalg.det(np.stack((before[:2], after[:2])))) < 0.05:
            return corners
        found.append(np.linalg.solve(np.stack((before[:2], after[:2])), [before[2], after[2]]))
    return np.array(found)


def _line(gray: Gray, one: Array, other: Array, middle: Array) -> Array | None:
    """Return the line (3,), a x + b y = c, along the edge between two pixels; None where there is no edge."""
    along = other - one
    out = np.array([along[1], -along[0]]) / max(float(np.linalg.norm(along)), 1e-9)
    out = out if out @ (one - middle) > 0 else -out
    distances = np.arange(-SIDE_REACH, SIDE_REACH + 0.01, STEP)
    starts = one + np.linspace(0.12, 0.88, SAMPLES)[:, None] * along
    values = bilinear(gray, starts[:, None] + distances[:, None] * out - 0.5)
    paper, ink = values[:, -4:].mean(1), values[:, distances <= 0.5].min(1)
    level = (paper + ink) / 2
    last = values.shape[1] - 1 - np.argmax((values < level[:, None])[:, ::-1], axis=1)  # the outermost dark place
    seen = np.flatnonzero((paper - ink > CONTRAST) & (last < values.shape[1] - 1))
    if len(seen) < FEWEST:
        return None
    last, level = last[seen], level[seen]
    share = (level - values[seen, last]) / (values[seen, last + 1] - values[seen, last])
    return _robust_line(starts[seen] + (distances[last] + share * STEP)[:, None] * out)


def _robust_line(places: Array) -> Array:
    """Return the line (3,), a x + b y = c, through places (N, 2) but for those that are far off."""
    for _ in range(3):
        centre = places.mean(0)
        normal = np.linalg.svd(places - centre)[2][1]
        off = np.abs((places - centre) @ normal)
        kept = off <= max(2.5 * float(np.median(off)), 0.05)
        if kept.sum() < FEWEST:
            break
        places = places[kept]
    return np.array([*normal, normal @ centre])
