"""Devices in a room with fittings and loose objects: their places, and their observations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from envs.sim.devices import DEVICES, turned
from envs.tasks import operate_among
from envs.tasks.operate_among import NUMBERS
from envs.tasks.types import Array, Column
from language import COLORS, NOUNS, Placed, Scene

ALIKE = 2  # devices of one noun, at most
JITTER = 0.01  # greatest offset of a device along the row from the middle of its section, metres
SIDEWAYS = 0.8  # greatest angle between the way of a lever and the row, radians: arms reach both ends of the way
TURNED = 1.0  # share of its way by which a wheel is turned as an episode begins, at most
COLUMNS = (*operate_among.COLUMNS, Column("share of its way from its start", -1.0, 1.0))


def most_devices(count: int) -> tuple[str, ...]:
    """The nouns of all devices that scenes with `count` devices can show."""
    return tuple(noun for noun in DEVICES for _ in range(min(ALIKE, count)))


def draw_devices(
    placed: Placed, count: int, area: Sequence[float], width: float, rng: Generator
) -> tuple[Placed, Array]:
    """The scene with devices behind the other objects, and (K,) how far each is moved, in shares of its way.

    They stand in a row along y. Levers are on or off, and wheels anywhere.

    Args:
        placed: the scene so far.
        count: how many devices.
        area: x0, x1, y0, y1 where they stand, metres.
        width: of a device, metres.
    """
    scene = placed.scene
    nouns = rng.permutation([noun for noun in DEVICES for _ in range(ALIKE)])[:count].tolist()
    x0, x1, y0, y1 = area
    stand = np.stack((rng.uniform(x0, x1, count), np.linspace(y0, y1, 2 * count + 1)[1::2], np.zeros(count)), axis=1)
    stand[:, 1] += rng.uniform(-JITTER, JITTER, count)
    yaw = np.array([_yaw(noun, rng) for noun in nouns])
    moved = np.array([_moved(noun, rng) for noun in nouns])
    handles = stand + turned(np.array([_grip(*each, width) for each in zip(nouns, moved, strict=True)]), yaw)
    joined = Scene.from_arrays(
        nouns=np.concatenate((scene.nouns, [list(NOUNS).index(noun) for noun in nouns])),
        colors=np.concatenate((scene.colors, rng.integers(len(COLORS), size=count))),
        positions=np.concatenate((scene.positions, handles)),
        size=np.concatenate((scene.sizes, np.full(count, width))),
        targets=np.concatenate((scene.targets, np.zeros(count, bool))),
        viewpoint=scene.viewpoint,
    )
    still = np.zeros(len(scene))
    fixed = np.concatenate((placed.fixed, np.zeros(count, bool)))
    return Placed(joined, np.concatenate((placed.yaw, yaw)), fixed), np.concatenate((still, moved))


def _yaw(noun: str, rng: Generator) -> float:
    if noun == "lever":
        return float(rng.choice((-1, 1)) * np.pi / 2 + rng.uniform(-SIDEWAYS, SIDEWAYS))
    return float(rng.uniform(-np.pi, np.pi))


def _moved(noun: str, rng: Generator) -> float:
    if noun == "lever":
        return float(rng.integers(2))
    return float(rng.uniform(-TURNED, TURNED)) if noun == "wheel" else 0.0


def _grip(noun: str, moved: float, width: float) -> Array:
    """(3,) metres from where a device stands that faces along x to its handle."""
    device = DEVICES[noun]
    return device.grip(width, device.start + moved * device.way)


def shares_of(nouns: NDArray[np.int64], moved: Array) -> Array:
    """(...) the shares of their joints' ranges, low to high, at which devices are; 0 for other objects.

    moved: (...) in shares of their way from their start.
    """
    shares = np.zeros(nouns.shape)
    for number, device in zip(NUMBERS, DEVICES.values(), strict=True):
        which = nouns == number
        shares[which] = (device.start + moved[which] * device.way - device.low) / (device.high - device.low)
    return np.clip(shares, 0.0, 1.0)


def moved_by(nouns: NDArray[np.int64], shares: Array) -> Array:
    """(...) how far devices are moved whose joints are at these shares (...) of their ranges: see `shares_of`."""
    moved = np.zeros(nouns.shape)
    for number, device in zip(NUMBERS, DEVICES.values(), strict=True):
        which = nouns == number
        moved[which] = (device.value(shares[which]) - device.start) / device.way
    return moved


def columns_of(nouns: NDArray[np.int64], ahead: Array, travel: Array, moved: Array) -> Array:
    """(..., C) the values of `COLUMNS`. nouns, travel, moved: (...). ahead: (..., 2) where devices face."""
    return np.concatenate((operate_among.columns_of(nouns, ahead, travel), moved[..., None]), axis=-1)


def directions(nouns: NDArray[np.int64], yaw: Array, moved: Array) -> Array:
    """(..., 2) unit vectors over the table to where devices face. Arguments: (...)."""
    wheels = nouns == list(NOUNS).index("wheel")
    angle = yaw + np.where(wheels, moved * DEVICES["wheel"].way, 0.0)
    return np.stack((np.cos(angle), np.sin(angle)), axis=-1)
