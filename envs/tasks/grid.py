"""Objects in the cells of a board, on top of each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from conf.schema import ConfigError
from envs.tasks.types import Array

ROUNDING = 1e-6  # of a cell
MOST_STACKED = 0.8  # greatest share of objects that are put on others as long as there are free cells


@dataclass(frozen=True)
class Grid:
    """Square cells that fill an area. Columns go along x, rows along y, levels up.

    area: x0, x1, y0, y1. cell: width of a cell. size: width and height of an object. All in metres.
    """

    area: Sequence[float]
    cell: float
    size: float

    @property
    def columns(self) -> int:
        return int((self.area[1] - self.area[0]) / self.cell + ROUNDING)

    @property
    def rows(self) -> int:
        return int((self.area[3] - self.area[2]) / self.cell + ROUNDING)

    def place(self, column: float, row: float, level: float) -> Array:
        """(3,) the middle of an object in this cell and at this level, metres. Levels count from 0."""
        x, y = self.area[0] + (column + 0.5) * self.cell, self.area[2] + (row + 0.5) * self.cell
        return np.array([x, y, (level + 0.5) * self.size])

    def cells(self, places: Array) -> NDArray[np.int64]:
        """(K, 3) column, row and level of the cells on the grid nearest to places (K, 3), metres."""
        offset = places - self.place(0, 0, 0)
        cells = np.rint(offset / [self.cell, self.cell, self.size]).astype(np.int64)
        return np.clip(cells, 0, [self.columns - 1, self.rows - 1, np.iinfo(np.int64).max])

    def draw(self, rng: Generator, count: int, targets: int, levels: int) -> Array:
        """(count + targets, 3) places of objects in random stacks, then free places for targets in as many cells.

        Raises ConfigError where they do not fit.
        """
        free = self.columns * self.rows
        if count + targets > free * levels - targets * (levels - 1) or targets > free:
            raise ConfigError(
                f"task.num_objects={count} objects in stacks of task.levels={levels} and {targets} targets do not fit "
                f"into workspace.object_area={list(self.area)}"
            )
        heights, cells = np.zeros(free, np.int64), []
        goals = rng.permutation(free)[:targets]
        room = np.full(free, levels)
        room[goals] -= 1
        share = rng.uniform(0.0, MOST_STACKED)
        for _ in range(count):
            cells.append(self._next(heights, room, share, rng))
            heights[cells[-1][0]] += 1
        cells += [(int(goal), int(heights[goal])) for goal in goals]
        return np.array([self.place(cell // self.rows, cell % self.rows, level) for cell, level in cells])

    def _next(
        self, heights: NDArray[np.int64], room: NDArray[np.int64], share: float, rng: Generator
    ) -> tuple[int, int]:
        """The cell and level of one more object: with this share on a stack, else in an empty cell."""
        open_ = heights < room
        stacked, empty = np.flatnonzero(open_ & (heights > 0)), np.flatnonzero(open_ & (heights == 0))
        on_stack = len(stacked) > 0 and (rng.random() < share or not len(empty))
        cell = int(rng.choice(stacked if on_stack else empty))
        return cell, int(heights[cell])


def above(positions: Array, size: float) -> NDArray[np.bool_]:
    """(K, K) whether the second of two places (K, 3) is over the first, in the same stack; size: of objects, metres."""
    offset = positions[None] - positions[:, None]
    return (np.abs(offset[..., :2]).max(-1) < size) & (offset[..., 2] > size / 2)
