"""The grid of spots of a table or board that are tried for a thing, and which of them are free."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

SHARES = {False: (1.3, 1.1), True: (1.3, 1.0)}  # widths between middles: room for fingers, and just room; on a board
CLEAR = 1.02  # widths along an axis between cubes that stand askew beside each other without a touch
GRID = 0.01  # metres between the spots of a table that are tried


@lru_cache(maxsize=8)
def grid(bounds: tuple[float, float, float, float], cells: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the x and y of the spots that are tried: those of a table, or the cells of a board."""
    (x0, x1, y0, y1), step = bounds, 1.0 if cells else GRID
    gx, gy = np.meshgrid(np.arange(x0, x1 + 1e-6, step), np.arange(y0, y1 + 1e-6, step), indexing="ij")
    return gx.ravel(), gy.ravel()


@lru_cache(maxsize=64)
def free_grid(bounds: tuple[float, ...], cells: bool, boxes: tuple[tuple[float, ...], ...]) -> tuple[NDArray, ...]:
    """Return `clear_of` of the grid; the places of a sentence's plans differ in few things."""
    return clear_of(*grid(bounds, cells), cells, boxes)


def clear_of(gx: NDArray, gy: NDArray, cells: bool, boxes: tuple[tuple[float, ...], ...]) -> tuple[NDArray, ...]:
    """Return for each of SHARES which points are that far from all boxes: x, y and width of each."""
    x, y, widths = np.array(boxes).reshape(-1, 3).T
    dx, dy = np.abs(gx[:, None] - x), np.abs(gy[:, None] - y)
    clear = (np.maximum(dx, dy) >= (1.0 if cells else CLEAR) * widths - 1e-9).all(axis=1)
    away = np.hypot(dx, dy)
    return tuple(clear & (away >= share * widths - 1e-9).all(axis=1) for share in SHARES[cells])
