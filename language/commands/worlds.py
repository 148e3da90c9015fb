"""The worlds that the plans of one sentence lead to."""

from __future__ import annotations

from language.commands.places import Spot
from language.commands.world import World


class Worlds:
    """Worlds after a thing was taken or put down. Equal changes give the same object, so that plans share referents."""

    def __init__(self) -> None:
        self._known: dict[tuple, tuple[World, World]] = {}  # with the world before, so that its id stays its own

    def taken(self, world: World, index: int) -> World:
        """Returns the world with the thing in the gripper."""
        key = (id(world), index)
        if key not in self._known:
            self._known[key] = (world, world.taken(index))
        return self._known[key][1]

    def moved(self, world: World, index: int, spot: Spot) -> World:
        """Returns the world with the thing at a place."""
        key = (id(world), index, spot)
        if key not in self._known:
            self._known[key] = (world, world.moved(index, spot.x, spot.y, spot.bottom))
        return self._known[key][1]
