"""The assignment of least cost: which detection is of which thing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.perception.detections import Array


def assignment(costs: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return rows and columns (min(R, C),) of costs (R, C) whose sum is least, each row and column once at most.

    Shortest augmenting paths. Source: Jonker and Volgenant, "A shortest augmenting path algorithm for dense and sparse
    linear assignment problems", 1987.
    """
    if costs.shape[0] > costs.shape[1]:
        columns, rows = assignment(costs.T)
        order = np.argsort(rows)
        return rows[order], columns[order]
    count, width = costs.shape
    of_row, of_column = np.zeros(count), np.zeros(width)
    owner = np.full(width, -1)  # the row of each column
    for row in range(count):
        least, last, done = np.full(width, np.inf), np.full(width, -1), np.zeros(width, bool)
        at, column, so_far = row, -1, 0.0
        while at >= 0:
            way = so_far + costs[at] - of_row[at] - of_column
            better = ~done & (way < least)
            least[better], last[better] = way[better], column
            column = int(np.where(done, np.inf, least).argmin())
            done[column], so_far, at = True, least[column], owner[column]
        of_row[row] += so_far
        for j in np.flatnonzero(done):
            if j != column:
                of_row[owner[j]] += so_far - least[j]
                of_column[j] -= so_far - least[j]
        while column >= 0:  # the free column's way back to the row
            before = int(last[column])
            owner[column] = row if before < 0 else owner[before]
            column = before
    columns = np.flatnonzero(owner >= 0)
    order = np.argsort(owner[columns])
    return owner[columns][order], columns[order]
