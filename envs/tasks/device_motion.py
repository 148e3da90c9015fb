"""How far devices have been moved, and from where a gripper moves them, by the poses of their handles."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from envs.sim.devices import facing
from envs.tasks.geometry import length
from envs.tasks.types import Array

BEHIND = 0.035  # metres from a lever's knob to the middle of a gripper that is about to push it
BESIDE = 0.035  # metres from a wheel's peg to the middle of a gripper that is about to push it


class Motion(NamedTuple):
    """How devices of one noun move.

    measure: of positions (..., 3), metres, and quaternions (..., 4) of handles, the joint values (...), metres or
        radians, from any zero.
    start: of positions (N, 3) and quaternions (N, 4) of handles, and of grippers (N, 3), where a gripper begins to
        move each device, (N, 3) metres.
    """

    measure: Callable[[Array, Array], Array]
    start: Callable[[Array, Array, Array], Array]


def _depth(places: Array, quaternions: Array) -> Array:
    return -places[..., 2]


def _lean(places: Array, quaternions: Array) -> Array:
    """How far levers lean to where they face."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    return np.arctan2(2 * (y * w - x * z), 1 - 2 * (x * x + y * y))


def _direction(places: Array, quaternions: Array) -> Array:
    ahead = facing(quaternions)
    return np.arctan2(ahead[..., 1], ahead[..., 0])


def _on_top(places: Array, quaternions: Array, grippers: Array) -> Array:
    return places


def _behind(places: Array, quaternions: Array, grippers: Array) -> Array:
    ahead = facing(quaternions)
    return places - BEHIND * np.column_stack((ahead, np.zeros(len(ahead))))


def _nearer_side(places: Array, quaternions: Array, grippers: Array) -> Array:
    """The side of the peg that is nearer to the gripper."""
    out = facing(quaternions)
    along = BESIDE * np.stack((-out[:, 1], out[:, 0], np.zeros(len(out))), axis=1)
    nearer = length(places + along - grippers) < length(places - along - grippers)
    return np.where(nearer[:, None], places + along, places - along)


MOTIONS = {
    "button": Motion(_depth, _on_top),
    "lever": Motion(_lean, _behind),
    "wheel": Motion(_direction, _nearer_side),
}
