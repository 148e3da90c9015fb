"""What objects are made as in PyBullet: their shapes, and how they are held."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
import pybullet as bullet
from numpy.typing import NDArray


class Hold(IntEnum):
    """What an object does when something runs into it."""

    FREE = 0  # is pushed
    FIXED = 1  # stays put
    GHOST = 2  # is not there: see-through, stays put

    @classmethod
    def of(cls, targets: NDArray[np.bool_], fixed: NDArray[np.bool_] | None) -> NDArray[np.int64]:
        """(K,) how targets, and objects that are fixed (none: no others), are held; each (K,) bool."""
        return np.where(targets, cls.GHOST, np.where(False if fixed is None else fixed, cls.FIXED, cls.FREE))


def solid(noun: str, size: float) -> tuple[int, dict]:
    """An object of this noun, `size` metres across and high."""
    shapes: dict[str, tuple[int, dict]] = {
        "cube": (bullet.GEOM_BOX, {"halfExtents": [size / 2] * 3}),
        "sphere": (bullet.GEOM_SPHERE, {"radius": size / 2}),
        "cylinder": (bullet.GEOM_CYLINDER, {"radius": size / 2, "height": size}),
    }
    return shapes[noun]
