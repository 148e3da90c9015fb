"""The instructions that are feasible in a room as it is: verbs with their referents and targets."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from envs.tasks.shared.free_places import BESIDE, LEVEL
from envs.tasks.shared.geometry import length
from envs.tasks.shared.open_hand import lies_on_palm
from envs.tasks.shared.types import NOTHING, Array
from language import DEVICES, HAND, NOUNS, VERBS, Scene
from language.verbs import CARRIES, DEVICE_VERBS, HANDING, ROOM

PLAIN_VERBS = tuple(verb for verb in ROOM if verb not in (*DEVICE_VERBS, HANDING))  # these need no device and no person
AJAR, WIDE = 0.2, 0.8  # shares up to which a fitting can be opened, and from which it can be closed
THROUGH = 0.9  # share from which it is open wide enough to put something in and take it out
EDGE = 0.06  # metres beyond the area of the objects up to which the arm takes objects
AT_END = 0.2  # share of its way from either end up to which a lever can be switched, and a button pressed
SLACK = 0.015  # metres that an object may stand higher or lower than on another one
UNDER = 0.5  # widths between the middles of two objects of which one stands on the other, at most


class Option(NamedTuple):
    """A feasible instruction. target: None if the verb has none."""

    verb: str
    referent: int
    target: int | None


class Room:
    """A scene with the state that decides what is feasible in it: K objects, in the order of the scene.

    Attributes:
        loose: (K,) which objects can be carried. fits: (K,) which are fittings. shares: (K,) how far those are open.
        inside: (K, K) whether the first of two is loose and in the second, a fitting.
        upon: (K, K) whether the first of two stands on the second. covered: (K,) which have another object on them.
        ready: (K,) which can be taken from above: on the table or on another object, with nothing on them.
        devices: (K,) which are devices. moved: (K,) how far each is from its start, in shares of its way.
        hands: (K,) which are the open hand of a person.
        handed: (K, K) whether the first of two is loose and lies on the second, a hand.

    Args:
        scene: the objects, metres.
        shares: (K,) by which each fitting is open; of others, anything.
        inside: (K, K) whether the place of the first of two is in the second.
        fits: (K,) which are fittings.
        area: x0, x1, y0, y1 of the table's objects, metres.
        moved: None: all devices are at their start.
    """

    def __init__(
        self,
        scene: Scene,
        shares: Array,
        inside: NDArray[np.bool_],
        fits: NDArray[np.bool_],
        area: Sequence[float],
        moved: Array | None = None,
    ) -> None:
        self.scene, self.shares, self.fits = scene, shares, fits
        self.moved = np.zeros(len(scene)) if moved is None else moved
        self.devices = np.isin(scene.nouns, [list(NOUNS).index(noun) for noun in DEVICE_VERBS.values()])
        self.hands = scene.nouns == list(NOUNS).index(HAND)
        self.loose = ~fits & ~self.devices & ~scene.targets & ~self.hands
        self.inside = inside & self.loose[:, None]
        offset = scene.positions[:, None] - scene.positions
        lies = lies_on_palm(offset - [0.0, 0.0, 0.5] * scene.sizes[:, None, None])
        self.handed = lies & self.loose[:, None] & self.hands
        near = length(offset[..., :2]) < UNDER * scene.sizes
        high = np.abs(offset[..., 2] - scene.sizes) < SLACK
        self.upon = near & high & self.loose & self.loose[:, None]
        self.covered = np.any(self.upon, axis=0)
        self.level = scene.positions[:, 2] < scene.sizes / 2 + LEVEL
        (x0, x1, y0, y1), (x, y) = area, scene.positions[:, :2].T
        self.at_hand = (x > x0 - EDGE) & (x < x1 + EDGE) & (y > y0 - EDGE) & (y < y1 + EDGE)
        stands = (self.level | self.upon.any(1)) & ~self.inside.any(1)
        self.ready = self.loose & stands & ~self.covered & self.at_hand

    def free_targets(self) -> NDArray[np.bool_]:
        """(K,) the see-through targets at which nothing stands."""
        apart = length((self.scene.positions[:, None] - self.scene.positions)[..., :2])
        return self.scene.targets & ~np.any(self.loose & (apart < BESIDE * self.scene.sizes), axis=1)

    def operable(self, verb: str) -> NDArray[np.bool_]:
        """(K,) the devices that this verb applies to: a button that is up, a lever at an end, and any wheel."""
        devices = self.scene.nouns == list(NOUNS).index(DEVICE_VERBS[verb])
        up, over = np.abs(self.moved) < AT_END, np.abs(self.moved) > 1 - AT_END
        states = {DEVICES[0]: up, DEVICES[1]: up | over}  # a button that is up, a lever at an end, any wheel
        return devices & states.get(DEVICE_VERBS[verb], devices)

    def blocked(self) -> bool:
        """Whether a loose object lies where fittings move: not in one, on a hand or among the objects on the table."""
        return bool((self.loose & ~self.at_hand & ~self.inside.any(1) & ~self.handed.any(1)).any())


def options(room: Room, held: int = NOTHING) -> list[Option]:
    """All feasible instructions. held: the object that the gripper holds, or NOTHING.

    While it holds a loose object, only instructions about that one are feasible. The handle of a fitting is let go.
    """
    if held != NOTHING and room.loose[held]:
        return [each for each in _options(room, _only(held, room)) if each.verb in CARRIES]
    return list(_options(room, room.ready))


def _only(held: int, room: Room) -> NDArray[np.bool_]:
    return np.arange(len(room.loose)) == held


def _options(room: Room, taken: NDArray[np.bool_]) -> Iterator[Option]:
    """taken: (K,) the loose objects that can be taken, or are held."""
    shut, wide, through = (room.fits & each for each in (room.shares < AJAR, room.shares > WIDE, room.shares > THROUGH))
    clear, full = not room.blocked(), np.any(room.inside, axis=0)
    bases = room.ready & room.level
    alone: dict[str, NDArray[np.bool_]] = {
        "touchable": room.ready | room.fits | room.devices,
        "loose": taken,
        "stacked": taken & np.any(room.upon, axis=1),
        "shut": shut & clear,
        "wide": wide & clear,
    }
    pairs = {
        "marked": taken[:, None] & room.free_targets(),
        "bearing": taken[:, None] & bases & ~room.upon,
        "room inside": taken[:, None] & through & ~full,
        "inside": room.inside & through & ~room.covered[:, None],
        "empty hand": taken[:, None] & room.hands & ~np.any(room.handed, axis=0),
    }
    np.fill_diagonal(pairs["bearing"], False)
    for verb in ROOM:
        need = VERBS[verb].need
        if need in pairs:
            yield from (Option(verb, int(one), int(other)) for one, other in np.argwhere(pairs[need]))
        else:
            fit = room.operable(verb) if verb in DEVICE_VERBS else alone[need]
            yield from (Option(verb, int(one), None) for one in np.flatnonzero(fit))
