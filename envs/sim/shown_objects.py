"""The objects that an episode shows in one world: loose ones of the pool, devices, fittings of the workspace,
and the palm of a person."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from envs.sim.device_bodies import DeviceBodies, Pose
from envs.sim.furniture import LINK, Furniture
from envs.sim.gripper import BASE, Holdable
from envs.sim.object_pool import Mobility, ObjectPool
from envs.sim.palm import Palm
from envs.sim.rendering import Renderer, paint
from language import DEVICES, FITTINGS, HAND, NOUNS

NAMES = tuple(NOUNS)


class ShownObjects:
    """Objects are identified by their number among those that are shown, whatever their kind.

    holdable: for each of them, the body or handle that a gripper can hold.

    Args:
        pool, devices, furniture: whose bodies are shown.
        renderer: draws see-through objects; None in a world without visuals.
        client: PyBullet's client.
        palm: the person's open hand, if they hold out one.
    """

    def __init__(
        self,
        pool: ObjectPool,
        devices: DeviceBodies,
        furniture: Furniture,
        renderer: Renderer | None,
        client: int,
        palm: Palm | None = None,
    ) -> None:
        self._pool, self._devices, self._furniture = pool, devices, furniture
        self._renderer, self._client = renderer, client
        self._palm = palm
        self._fittings: list[str] = []
        self._palms: list[Palm] = []  # one, or none
        self._order: list[int] | None = None  # of objects among loose ones, devices, fittings, palms; None: the same
        self.holdable: list[Holdable] = []

    def show(
        self,
        nouns: Sequence[int],
        mobilities: Sequence[int],
        positions: Sequence[Sequence[float]],
        yaw: Sequence[float],
        colors: Sequence[Sequence[float]],
        resting: Sequence[bool] | None = None,
        shares: Sequence[float] | None = None,
    ) -> None:
        """Place the objects of the next episode. The arguments are those of `World.reset`."""
        rests = [False] * len(nouns) if resting is None else resting
        loose, devices, fittings, palms = kinds = _by_kind(nouns)
        places, turns, paints = _chosen(devices, positions, yaw, colors)
        starts = None if shares is None else [shares[k] for k in devices]
        self._devices.show([NAMES[nouns[k]] for k in devices], places, turns, paints, starts)
        self._show_loose(*_chosen(loose, nouns, mobilities, positions, yaw, rests, colors))
        self._fittings = [NAMES[nouns[k]] for k in fittings]
        for name, k in zip(self._fittings, fittings, strict=True):
            self._furniture.show(name, 0.0 if shares is None else shares[k], colors[k])
        self._palms = [self._palm] * len(palms) if self._palm is not None else []
        for palm, k in zip(self._palms, palms, strict=True):
            palm.show(positions[k])
        order = [number for kind in kinds for number in kind]
        self._order = None if order == sorted(order) else np.argsort(order).tolist()
        self.holdable = self._in_order(self._all_holdable())

    def poses(self) -> list[Pose]:
        """(position, quaternion) of each object; of a device or a fitting, that of its handle."""
        poses = self._pool.poses() + self._devices.poses()
        poses += [self._furniture.handle_pose(name) for name in self._fittings]
        return self._in_order(poses + [palm.pose() for palm in self._palms])

    def _in_order(self, things: list) -> list:
        return things if self._order is None else [things[number] for number in self._order]

    def _show_loose(self, nouns: list, mobilities: list, positions: list, yaw: list, rests: list, colors: list) -> None:
        self._pool.show(nouns, mobilities, positions, yaw, rests)
        if self._renderer is None:
            return
        for body, mobility, color in zip(self._pool.shown, mobilities, colors, strict=True):
            paint(body, color, self._client)
            if mobility == Mobility.GHOST:
                self._renderer.set_see_through(body, BASE, color)

    def _all_holdable(self) -> list[Holdable]:
        loose = [Holdable(body, partial(self._pool.pose, body)) for body in self._pool.shown]
        devices = [Holdable(body, partial(self._devices.pose, body), LINK) for body in self._devices.shown]
        handles = [
            Holdable(self._furniture.bodies[name], partial(self._furniture.handle_pose, name), LINK)
            for name in self._fittings
        ]
        return loose + devices + handles + [Holdable(palm.body, palm.pose, LINK) for palm in self._palms]


def _by_kind(nouns: Sequence[int]) -> tuple[list[int], list[int], list[int], list[int]]:
    """The numbers of the loose objects, the devices, the fittings and the palms.

    nouns: indices; of loose ones, into the pool.
    """
    kinds = DEVICES, FITTINGS, (HAND,)
    devices, fittings, palms = ([i for i, noun in enumerate(nouns) if NAMES[noun] in kind] for kind in kinds)
    loose = [i for i in range(len(nouns)) if i not in devices and i not in fittings and i not in palms]
    return loose, devices, fittings, palms


def _chosen(numbers: Sequence[int], *columns: Sequence) -> list[list]:
    """Of each column, the values with these numbers."""
    return [[column[number] for number in numbers] for column in columns]
