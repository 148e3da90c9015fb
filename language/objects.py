"""Objects that words can name, and the scene that holds them.

Positions are in metres in the workspace frame: origin at the robot's base on the table top, x away from the
robot, y to the robot's left, z up.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from language.colors import COLORS
from language.errors import LanguageError, check_known
from language.viewpoint import seen_from

# Noun -> synonyms; first shapes, then devices, then fittings, then the palm of a person's hand.
NOUNS: dict[str, tuple[str, ...]] = {
    "cube": ("block", "box"),
    "sphere": ("ball",),
    "cylinder": ("tube", "tin"),
    "button": ("knob",),
    "lever": ("handle",),
    "wheel": ("dial",),
    "drawer": (),
    "fridge": ("fridge door",),
    "palm": (),
}
SHAPES = ("cube", "sphere", "cylinder")  # an unspecified noun is drawn from these
DEVICES = ("button", "lever", "wheel")  # fixed objects that are pressed, switched or turned
FITTINGS = ("drawer", "fridge")  # furniture that is opened and closed; its position is that of its handle
HAND = "palm"  # the open hand of a person; its position is the middle of the palm's surface
ANY_NOUN = ("object", "one", "thing")  # words for any noun; `say` uses the first
ROLES = ("real", "target")  # a target only marks a place
ROLE_WORDS: dict[str, tuple[str, ...]] = {  # role -> its words; `say` uses the first
    "real": ("solid", "opaque"),
    "target": ("transparent", "translucent"),
}


class Size(NamedTuple):
    """A word for widths from low to high, in metres. synonyms: other words that are understood."""

    low: float
    high: float
    synonyms: tuple[str, ...] = ()


SIZES: dict[str, Size] = {
    "small": Size(0.0, 0.045, ("little", "tiny")),
    "large": Size(0.055, math.inf, ("big", "huge")),
}


@dataclass(frozen=True)
class Object:
    """One object.

    noun, color, role: keys of NOUNS and COLORS, one of ROLES. position: x, y, z of its centre, metres.
    size: its width, metres. Raises LanguageError for other values.
    """

    noun: str
    color: str
    position: tuple[float, float, float]
    size: float = 0.05
    role: str = "real"

    def __post_init__(self) -> None:
        check_known("noun", self.noun, NOUNS)
        check_known("color", self.color, COLORS)
        check_known("role", self.role, ROLES)
        if len(self.position) != 3 or not all(math.isfinite(x) for x in self.position):
            raise LanguageError(f"position={self.position} must be three finite numbers")
        if not 0 < self.size < math.inf:
            raise LanguageError(f"size={self.size} must be a positive number of metres")


class Scene:
    """K objects, immutable: a sequence of `Object`, and the same as read-only arrays.

    nouns, colors: (K,) int64, indices into the tables `NOUNS` and `COLORS`
    positions: (K, 3) float64, metres
    sizes: (K,) float64, metres
    targets: (K,) bool, True where the role is "target"
    seen: (K, 3) float64, the positions in the viewer's frame (`language/viewpoint.py`)
    viewpoint: of relations and superlatives, "robot" or "human"
    """

    __slots__ = ("colors", "nouns", "positions", "seen", "sizes", "targets", "viewpoint")

    def __init__(self, objects: Iterable[Object], viewpoint: str = "robot") -> None:
        things = list(objects)
        nouns, colors = list(NOUNS), list(COLORS)
        self._fill(
            [nouns.index(thing.noun) for thing in things],
            [colors.index(thing.color) for thing in things],
            [thing.position for thing in things],
            [thing.size for thing in things],
            [thing.role == "target" for thing in things],
            viewpoint,
        )

    @classmethod
    def from_arrays(cls, nouns, colors, positions, size=0.05, targets=False, viewpoint="robot") -> Scene:
        """Return a scene from copies of arrays.

        Args:
            nouns, colors: (K,) indices into NOUNS and COLORS.
            positions: (K, 3) metres.
            size: width in metres, one value for all or (K,).
            targets: whether the role is "target", one value for all or (K,).
            viewpoint: "robot" or "human".

        Raises:
            LanguageError: shapes or indices are wrong.
        """
        scene = cls.__new__(cls)
        scene._fill(nouns, colors, positions, size, targets, viewpoint)
        return scene

    def moved(self, positions) -> Scene:
        """Return the same objects at other positions, (K, 3) metres."""
        return Scene.from_arrays(self.nouns, self.colors, positions, self.sizes, self.targets, self.viewpoint)

    def _fill(self, nouns, colors, positions, sizes, targets, viewpoint) -> None:
        self.nouns = _indices(nouns, len(NOUNS), "noun")
        self.colors = _indices(colors, len(COLORS), "color")
        self.positions = np.array(positions, dtype=np.float64).reshape(-1, 3)
        count = len(self.nouns)
        if len(self.colors) != count or len(self.positions) != count:
            raise LanguageError(f"{count} nouns, {len(self.colors)} colors, {len(self.positions)} positions")
        self.sizes = np.empty(count)
        self.targets = np.empty(count, dtype=bool)
        self.sizes[:] = sizes
        self.targets[:] = targets
        self.viewpoint = viewpoint
        self.seen = seen_from(viewpoint, self.positions)
        for array in (self.nouns, self.colors, self.positions, self.seen, self.sizes, self.targets):
            array.flags.writeable = False

    def __len__(self) -> int:
        return len(self.nouns)

    def __getitem__(self, index: int) -> Object:
        x, y, z = self.positions[index].tolist()
        return Object(
            noun=list(NOUNS)[self.nouns[index]],
            color=list(COLORS)[self.colors[index]],
            position=(x, y, z),
            size=float(self.sizes[index]),
            role=ROLES[int(self.targets[index])],
        )

    def __iter__(self) -> Iterator[Object]:
        return (self[index] for index in range(len(self)))


def _indices(values, count: int, what: str) -> np.ndarray:
    array = np.array(values, dtype=np.int64).reshape(-1)
    for index in array.tolist():
        if not 0 <= index < count:
            raise LanguageError(f"{what} index {index} is out of range: it must be in [0, {count - 1}]")
    return array
