"""The poses of seen things: how they are turned, where devices stand, and where their handles are."""

from __future__ import annotations

from functools import cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from envs.perception.detections import Array
from envs.sim.devices import DEVICES, turned
from language import NOUNS, SHAPES

BUTTON, CUBE, LEVER, WHEEL = (list(NOUNS).index(noun) for noun in ("button", "cube", "lever", "wheel"))
DEVICE_NUMBERS = np.array([list(NOUNS).index(noun) for noun in DEVICES])
IS_DEVICE = np.isin(np.arange(len(NOUNS)), DEVICE_NUMBERS)  # by the number of a noun
LOOSE = np.array([noun in SHAPES for noun in NOUNS])  # by the number of a noun
SHARES = np.linspace(0.0, 1.0, 65)  # of a joint's range, at which the places of handles are computed beforehand
Numbers = TypeVar("Numbers", Array, Tensor)
WHEEL_WAY = DEVICES["wheel"].way  # radians from the middle of a wheel's range to its ends


def wrapped(angles: Array, period: float) -> Array:
    """(...) the angles (...) within half a period of 0, radians."""
    return (angles + period / 2) % period - period / 2


def wheel_starts(yaws: Numbers, shares: Numbers) -> Numbers:
    """(...) radians, how wheels were placed whose handles are at yaws (...), at shares (...) of their ranges."""
    return yaws - WHEEL_WAY * (2 * shares - 1)


def wheel_shares(yaws: Array, starts: Array) -> Array:
    """(...) the shares of their ranges of wheels: the inverse of `wheel_starts`."""
    return 0.5 + wrapped(yaws - starts, 2 * np.pi) / (2 * WHEEL_WAY)


def upright(yaws: Array) -> Array:
    """(..., 4) quaternions (x, y, z, w) of things turned about the vertical. yaws: (...), radians."""
    half, zero = np.asarray(yaws) / 2, np.zeros_like(yaws)
    return np.stack((zero, zero, np.sin(half), np.cos(half)), axis=-1)


def heading(quaternions: Array) -> Array:
    """(...) radians about the vertical of quaternions (..., 4)."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def as_simulated(quaternions: Array) -> Array:
    """(..., 4) the same rotations with the signs that PyBullet gives them: w > 0, or of a larger turn its main axis."""
    main = np.where(np.abs(quaternions[..., 3]) > 0.5, 3, np.abs(quaternions[..., :3]).argmax(-1))
    signs = np.take_along_axis(quaternions, main[..., None], -1)
    return np.where(signs < 0, -quaternions, quaternions)


def product(one: Array, other: Array) -> Array:
    """(..., 4) the rotation `other` and then `one`, both quaternions (..., 4)."""
    first, second = one[..., :3], other[..., :3]
    vector = one[..., 3:] * second + other[..., 3:] * first + np.cross(first, second)
    scalar = one[..., 3] * other[..., 3] - (first * second).sum(-1)
    return np.concatenate((vector, scalar[..., None]), axis=-1)


def quaternion_of(turn: Array) -> Array:
    """(4,) of a rotation (3, 3) of less than half a turn."""
    w = np.sqrt(max(1e-12, 1 + np.trace(turn))) / 2
    return np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1], 4 * w * w]) / (4 * w)


def stands(nouns: NDArray[np.int64], places: Array, *, yaws: Array, shares: Array, width: float) -> Array:
    """(D, 3) where devices stand whose handles are at places (D, 3), metres; of other things, the places.

    Args:
        nouns: (D,) numbers.
        places: (D, 3) metres.
        yaws: (D,) radians, which way they face.
        shares: (D,) of their joints' ranges.
        width: of a device, metres.
    """
    devices = np.isin(nouns, DEVICE_NUMBERS)
    found = places - _grips(nouns, yaws=yaws, shares=shares, width=width)
    found[devices, 2] = 0.0
    return found


def handles(nouns: NDArray[np.int64], anchors: Array, *, yaws: Array, shares: Array, width: float) -> Array:
    """(D, 3) where the handles of devices are that stand at anchors (D, 3), metres: the inverse of `stands`."""
    return anchors + _grips(nouns, yaws=yaws, shares=shares, width=width)


def quaternions_of(nouns: NDArray[np.int64], turns: Array, *, yaws: Array, shares: Array) -> Array:
    """(D, 4) of things, of devices those of their handles. turns: (D, 4) of loose things."""
    found = np.where(LOOSE[nouns][:, None], turns, upright(yaws))
    levers = nouns == LEVER
    if levers.any():
        lever = DEVICES["lever"]
        half = (lever.value(shares[levers]) - lever.start) / 2
        zero = np.zeros_like(half)
        found[levers] = product(found[levers], np.stack((zero, np.sin(half), zero, np.cos(half)), axis=-1))
    return as_simulated(found)


def _grips(nouns: NDArray[np.int64], *, yaws: Array, shares: Array, width: float) -> Array:
    """(D, 3) metres from where devices stand to their handles; 0 for other things."""
    found = np.zeros((len(nouns), 3))
    for number, noun in zip(DEVICE_NUMBERS, DEVICES, strict=True):
        which = nouns == number
        if which.any():
            # Where a wheel faces includes how far it is turned.
            share = np.full(which.sum(), 0.5) if number == WHEEL else shares[which]
            local = np.stack([np.interp(share, SHARES, axis) for axis in _ways(noun).T], axis=-1)
            found[which] = turned(width * local, yaws[which])
    return found


@cache
def _ways(noun: str) -> Array:
    """(S, 3) the places of a device's handle, widths, at each of `SHARES`."""
    device = DEVICES[noun]
    return np.array([device.grip(1.0, float(device.value(share))) for share in SHARES])
