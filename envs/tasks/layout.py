"""Where objects are put at reset."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.random import Generator

from conf.schema import ConfigError

TRIES = 200


def scatter(
    rng: Generator, count: int, area: Sequence[float], spacing: float, height: float
) -> list[tuple[float, float, float]]:
    """`count` places in area (x0, x1, y0, y1), no two centres nearer than spacing; metres.

    Throws darts, and starts again when the last ones find no room. Raises ConfigError where the area is too small.
    """
    x0, x1, y0, y1 = area
    for _ in range(TRIES):
        placed: list[tuple[float, float, float]] = []
        for u, v in rng.random((8 * count, 2)).tolist():
            x, y = x0 + u * (x1 - x0), y0 + v * (y1 - y0)
            if all((x - a) ** 2 + (y - b) ** 2 >= spacing**2 for a, b, _ in placed):
                placed.append((x, y, height))
                if len(placed) == count:
                    return placed
    raise ConfigError(
        f"task.num_objects={count} objects with task.spacing={spacing} do not fit workspace.object_area={list(area)}"
    )
