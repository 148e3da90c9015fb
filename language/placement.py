"""Random layouts: specifications of objects, from which the scene of an episode is drawn, and subtasks among them.

Areas are x0, x1, y0, y1, z0, z1 in metres in the workspace frame; an object's centre is drawn uniformly within.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from language.colors import COLORS, draw_colors
from language.errors import LanguageError, check_known
from language.objects import NOUNS, ROLES, SHAPES, Scene
from language.spacing import keep_apart

TRIES = 200  # layouts of all objects
TRIES_PER_OBJECT = 20  # places for one object before the layout starts again

Place = tuple[float, float, float]


@dataclass(frozen=True)
class ObjectSpec:
    """Specification of an object to be drawn. Raises LanguageError for invalid values.

    noun, color: None: drawn at random; a noun from SHAPES.
    area: of its centre; any sequence of 6 numbers, stored as a tuple.
    size: its width, metres.
    fixed: whether it stays in place when touched.
    random_rotation: whether its yaw is drawn uniformly in [-pi, pi) radians; otherwise it is 0.
    role: "real", or "target", which only marks a place.
    """

    noun: str | None
    color: str | None
    area: Sequence[float]
    size: float = 0.05
    fixed: bool = False
    random_rotation: bool = False
    role: str = "real"

    def __post_init__(self) -> None:
        for name, choices in (("noun", NOUNS), ("color", COLORS), ("role", ROLES)):
            value = getattr(self, name)
            if value is not None or name == "role":
                _check_word(name, value, choices)
        object.__setattr__(self, "area", _checked_area(self.area))
        if not 0 < self.size < math.inf:
            raise LanguageError(f"size={self.size} must be a positive number of metres")


class Placed(NamedTuple):
    """A drawn layout of K objects. yaw: (K,) float64 radians. fixed: (K,) bool."""

    scene: Scene
    yaw: NDArray[np.float64]
    fixed: NDArray[np.bool_]


@dataclass(frozen=True)
class Layout:
    """K objects to be drawn and the subtasks among them; created by `from_pairs`, `from_lists` or `from_all`.

    specs: the objects.
    inits: indices of the objects that a subtask may move.
    goals: indices of the objects that they may be moved to.
    pairs: (init, goal) indices if each init has its own goal; None if any init goes with any goal.
    """

    specs: tuple[ObjectSpec, ...]
    inits: tuple[int, ...]
    goals: tuple[int, ...]
    pairs: tuple[tuple[int, int | None], ...] | None = None

    def __post_init__(self) -> None:
        if not self.specs:
            raise LanguageError("a layout needs at least one object")
        for index in self.inits:
            if self.specs[index].role != "real":
                raise LanguageError(f"object {index} is an init with role={self.specs[index].role}: it must be real")

    def draw(self, rng: Generator, spacing: float) -> Placed:
        """Draw all K objects, in order.

        Random colours differ from all others of the same role while there are colours left.

        Args:
            rng: random generator.
            spacing: smallest distance between centres in the table's plane, metres.

        Raises:
            LanguageError: the areas are too small for the spacing.
        """
        nouns = rng.integers(len(SHAPES), size=len(self.specs))
        yaw = rng.uniform(-math.pi, math.pi, len(self.specs))
        for index, spec in enumerate(self.specs):
            if spec.noun is not None:
                nouns[index] = list(NOUNS).index(spec.noun)
        scene = Scene.from_arrays(
            nouns,
            [list(COLORS).index(color) for color in _draw_colors(rng, self.specs)],
            _draw_places(rng, self.specs, spacing),
            size=[spec.size for spec in self.specs],
            targets=[spec.role == "target" for spec in self.specs],
        )
        turned = np.array([spec.random_rotation for spec in self.specs])
        return Placed(scene, np.where(turned, yaw, 0.0), np.array([spec.fixed for spec in self.specs]))

    def pick(self, rng: Generator) -> tuple[int | None, int | None]:
        """Draw a subtask: the indices of its init and goal, None if there is none."""
        if self.pairs is not None:
            return self.pairs[int(rng.integers(len(self.pairs)))]
        return _one_of(rng, self.inits), _one_of(rng, self.goals)


def from_pairs(pairs: Iterable[tuple[ObjectSpec, ObjectSpec | None]]) -> Layout:
    """Return a layout of subtasks (init, goal) or (init, None). Each spec is an object of its own."""
    specs: list[ObjectSpec] = []
    indices: list[tuple[int, int | None]] = []
    for init, goal in pairs:
        start = len(specs)
        specs += [init] if goal is None else [init, goal]
        indices.append((start, None if goal is None else start + 1))
    goals = tuple(goal for _, goal in indices if goal is not None)
    return Layout(tuple(specs), tuple(init for init, _ in indices), goals, tuple(indices))


def from_lists(init: Iterable[ObjectSpec], goal: Iterable[ObjectSpec]) -> Layout:
    """Return a layout in which any of `init` goes to any of `goal`; the lists may differ in length or be empty."""
    inits, goals = tuple(init), tuple(goal)
    count = len(inits) + len(goals)
    return Layout(inits + goals, tuple(range(len(inits))), tuple(range(len(inits), count)))


def from_all(objects: Iterable[ObjectSpec]) -> Layout:
    """Return a layout in which any real object goes to any target."""
    specs = tuple(objects)
    inits, goals = ([i for i, spec in enumerate(specs) if spec.role == role] for role in ROLES)
    return Layout(specs, tuple(inits), tuple(goals))


def _check_word(name: str, value: str | None, choices: Iterable[str]) -> None:
    try:
        check_known(name, str(value), choices)
    except LanguageError as error:
        raise LanguageError(f"{name}={value}: {error}") from None


def _checked_area(area: Sequence[float]) -> tuple[float, ...]:
    try:
        box = tuple(float(x) for x in area)
    except (TypeError, ValueError):
        box = ()
    if len(box) != 6 or not all(math.isfinite(x) for x in box):
        raise LanguageError(f"area={area} must be 6 finite numbers: x0, x1, y0, y1, z0, z1")
    for axis, low, high in zip("xyz", box[::2], box[1::2], strict=True):
        if low > high:
            raise LanguageError(f"area={list(box)}: {axis}0={low} must be at most {axis}1={high}")
    return box


def _draw_colors(rng: Generator, specs: Sequence[ObjectSpec]) -> list[str]:
    colors = [spec.color or "" for spec in specs]
    for role in ROLES:
        taken = {spec.color for spec in specs if spec.role == role and spec.color}
        open_ones = [index for index, spec in enumerate(specs) if spec.role == role and not spec.color]
        distinct = min(len(open_ones), len(COLORS) - len(taken))
        drawn = draw_colors(rng, distinct, replace=False, excluding=taken)
        drawn += draw_colors(rng, len(open_ones) - distinct)
        for index, color in zip(open_ones, drawn, strict=True):
            colors[index] = color
    return colors


def _draw_places(rng: Generator, specs: Sequence[ObjectSpec], spacing: float) -> list[Place]:
    """Draw places by rejection sampling, object by object; starts again when no place is found for one."""
    for _ in range(TRIES):
        placed: list[Place] = []
        for spec in specs:
            place = _draw_place(rng, spec.area, placed, spacing)
            if place is None:
                break
            placed.append(place)
        else:
            return placed
    raise LanguageError(
        f"object {len(placed)} found no place in its area={list(specs[len(placed)].area)} that is spacing={spacing} "
        "metres from the others: give larger areas, a smaller spacing or fewer objects"
    )


def _draw_place(rng: Generator, area: Sequence[float], placed: Sequence[Place], spacing: float) -> Place | None:
    low, high = np.reshape(area, (3, 2)).T
    drawn = (low + rng.random((TRIES_PER_OBJECT, 3)) * (high - low)).tolist()
    return next(((x, y, z) for x, y, z in keep_apart(drawn, 1, spacing, placed)), None)


def _one_of(rng: Generator, indices: Sequence[int]) -> int | None:
    return int(rng.choice(indices)) if indices else None
