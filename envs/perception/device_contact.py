"""What the gripper tells of devices that it hides from cameras: how far it presses buttons, pushes levers and wheels.

Devices stand still, a button springs back, and levers and wheels stay where they are left: so they move only where the
gripper takes them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.perception.detections import Array
from envs.perception.fitting_track import length
from envs.perception.poses import IS_DEVICE, LEVER, WHEEL_WAY, handles, wrapped
from envs.sim.devices import DEVICES
from language import NOUNS

RADII = np.array([{"button": 0.5, "lever": 0.5, "wheel": 0.75}.get(noun, 0.0) for noun in NOUNS])  # widths, of devices
ON_BUTTON = 0.5  # widths beside the middle of a button within which a gripper presses it
THICK, KNOB, PEG = 0.14, 0.35, 0.24  # widths: radius of knobs and pegs, half of a knob's length, and of a peg's height
TIP_RADIUS = 0.02  # metres, of a magnet's face or shut fingers
TURNS = np.linspace(-0.8, 0.8, 81)  # radians of a wheel, or shares of a lever's range, by which one may be pushed


def within_devices(
    new: NDArray[np.int64], places: Array, *, nouns: NDArray[np.int64], anchors: Array, size: float, width: float
) -> NDArray[np.bool_]:
    """(D,) which things would be within a device that is there: what is hidden in part is taken for something else.

    Args:
        new: (D,) numbers of their nouns.
        places: (D, 3) metres; of devices, where they stand.
        nouns, anchors: (T,) and (T, 3) of the things that are there.
        size, width: of loose things and of devices, metres.
    """
    radii = np.where(IS_DEVICE[new], RADII[new] * width, size / 5)
    offset = places[:, None] - anchors[None]
    beside = length(offset[..., :2]) < RADII[nouns] * width + radii[:, None]
    return np.asarray((beside & IS_DEVICE[nouns] & (offset[..., 2] < width)).any(1))


def pressed(anchors: Array, tip: Array, width: float) -> Array:
    """(B,) shares of their ways by which buttons that stand at anchors (B, 3) are pressed.

    tip: (3,) the lowest point of the gripper or of what it holds, metres.
    """
    button = DEVICES["button"]
    on = length((anchors - tip)[:, :2]) < ON_BUTTON * width
    below = (button.grip(width)[2] - tip[2]) / (button.way * width)
    return np.where(on, np.clip(below, 0.0, 1.0), 0.0)


def pushed(
    noun: int, anchor: Array, tip: Array, *, yaw: float, share: float, start: float, width: float
) -> tuple[float, float]:
    """Return yaw and share of a lever or a wheel once it is out of the gripper's way, which turns it no farther.

    Args:
        noun: its number.
        anchor: (3,) where it stands, metres.
        tip: (3,) the lowest point of the gripper, metres.
        yaw: radians; of a wheel, that of its handle.
        share: of its range.
        start: radians, how a wheel was placed: it stops at its ends.
        width: metres.
    """
    yaws, shares = np.full(len(TURNS), yaw), np.full(len(TURNS), share)
    if noun == LEVER:
        shares = np.clip(shares + TURNS, 0.0, 1.0)
    else:
        yaws = start + np.clip(wrapped(yaws + TURNS - start, 2 * np.pi), -WHEEL_WAY, WHEEL_WAY)
    nouns, anchors = np.full(len(TURNS), noun), np.tile(anchor, (len(TURNS), 1))
    offset = handles(nouns, anchors, yaws=yaws, shares=shares, width=width) - tip
    free = ~_touches(noun, offset, yaw, width)
    if not free.any():
        return yaw, share
    least = int(np.where(free, np.abs(TURNS), np.inf).argmin())
    return float(yaws[least]), float(shares[least])


def _touches(noun: int, offset: Array, yaw: float, width: float) -> NDArray[np.bool_]:
    """(C,) whether a handle at an offset (C, 3) from the gripper's tip would be within the gripper, a cylinder."""
    beside, height = length(offset[:, :2]), PEG
    if noun == LEVER:  # its knob lies across
        along = np.cos(yaw) * offset[:, 0] + np.sin(yaw) * offset[:, 1]
        aside = np.cos(yaw) * offset[:, 1] - np.sin(yaw) * offset[:, 0]
        beside, height = np.hypot(along, np.maximum(np.abs(aside) - KNOB * width, 0.0)), THICK
    return np.asarray((beside < TIP_RADIUS + THICK * width) & (-offset[:, 2] < height * width))
