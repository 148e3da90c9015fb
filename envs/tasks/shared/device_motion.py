"""How far devices have been moved, and from where a gripper moves them, by the poses of their handles."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from envs.sim.devices import DEVICES, facing
from envs.tasks.shared.geometry import length
from envs.tasks.shared.types import Array, Column, State
from language import NOUNS

BEHIND = 0.035  # metres from a lever's knob to the middle of a gripper that is about to push it
BESIDE = 0.035  # metres from a wheel's peg to the middle of a gripper that is about to push it
OVER = 0.5  # share of its way from which a lever counts as switched, and is switched back
OFF_CENTRE = 0.15  # share of its way from which a wheel is turned back: the other way may be too short
WIDTHS = 1.4  # width of a device among loose objects, in widths of those
DEVICE_NUMBERS = np.array([list(NOUNS).index(noun) for noun in DEVICES])
SPRUNG = [list(NOUNS).index(noun) for noun, device in DEVICES.items() if device.spring]
MOTION_COLUMNS = (
    Column("faces x", -1.0, 1.0),
    Column("faces y", -1.0, 1.0),
    Column("share of its way since the instruction was given", -1.0, 1.0),
)
DEVICE_COLUMNS = (*(Column(f"is a {noun}", 0.0, 1.0) for noun in DEVICES), *MOTION_COLUMNS)


class Motion(NamedTuple):
    """How devices of one noun move.

    measure: maps positions (..., 3), metres, and quaternions (..., 4) of handles to joint values (...), metres or
        radians, with an arbitrary zero.
    start: returns where a gripper begins to move each device, (N, 3) metres, given the positions (N, 3) and quaternions
        (N, 4) of handles, the grippers (N, 3), and how far the devices were moved before the instruction (N,).
    """

    measure: Callable[[Array, Array], Array]
    start: Callable[[Array, Array, Array, Array], Array]


def lever_way(before: Array) -> Array:
    """(N,) 1 or -1: the direction in which to switch levers, given the shares of their way moved before, (N,)."""
    return np.where(before > OVER, -1.0, 1.0)


def wheel_way(before: Array) -> Array:
    """(N,) the direction in which to turn wheels, given the shares of their way moved before, (N,); 0: either."""
    return np.where(np.abs(before) > OFF_CENTRE, -np.sign(before), 0.0)


def _depth(places: Array, quaternions: Array) -> Array:
    return -places[..., 2]


def _lean(places: Array, quaternions: Array) -> Array:
    """(...) radians by which levers lean in the direction that they face."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    return np.arctan2(2 * (y * w - x * z), 1 - 2 * (x * x + y * y))


def _direction(places: Array, quaternions: Array) -> Array:
    ahead = facing(quaternions)
    return np.arctan2(ahead[..., 1], ahead[..., 0])


def _on_top(places: Array, quaternions: Array, grippers: Array, before: Array) -> Array:
    return places


def _behind(places: Array, quaternions: Array, grippers: Array, before: Array) -> Array:
    """Behind the knob; in front of it where the lever is over."""
    ahead = facing(quaternions) * lever_way(before)[:, None]
    return places - BEHIND * np.column_stack((ahead, np.zeros(len(ahead))))


def _nearer_side(places: Array, quaternions: Array, grippers: Array, before: Array) -> Array:
    """Return the side of the peg nearer to the gripper; for a turned wheel, the side from which it is turned back."""
    out = facing(quaternions)
    along = BESIDE * np.stack((-out[:, 1], out[:, 0], np.zeros(len(out))), axis=1)
    nearer = length(places + along - grippers) < length(places - along - grippers)
    onward = wheel_way(before)
    nearer = np.where(onward == 0, nearer, onward < 0)
    return np.where(nearer[:, None], places + along, places - along)


MOTIONS = {
    "button": Motion(_depth, _on_top),
    "lever": Motion(_lean, _behind),
    "wheel": Motion(_direction, _nearer_side),
}


def moved(state: State, width: float) -> Array:
    """(N, K) in [-1, 1]: how far devices are from their start, in shares of their way; 0 for other objects."""
    found = np.zeros(state.nouns.shape)
    for noun, device in DEVICES.items():
        which = state.shown & (state.nouns == list(NOUNS).index(noun))
        start = {"button": -device.grip(width)[2], "lever": 0.0, "wheel": state.yaw[which]}[noun]
        now = MOTIONS[noun].measure(state.objects[which], state.quaternions[which])
        found[which] = device.travelled(width, start, now)
    return found


def device_columns(nouns: NDArray[np.int64], ahead: Array, travel: Array) -> Array:
    """(..., C) the values of `DEVICE_COLUMNS`. nouns, travel: (...). ahead: (..., 2) where devices face."""
    marks = nouns[..., None] == DEVICE_NUMBERS
    return np.concatenate((marks, np.where(marks.any(-1)[..., None], ahead, 0.0), travel[..., None]), axis=-1)
