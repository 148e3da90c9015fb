"""Named colours: from names to RGBA and back, opaque and transparent."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from language.errors import LanguageError, check_known

RGBA = tuple[float, float, float, float]

SEE_THROUGH = 0.5  # opacity of targets, which only mark a place


class Color(NamedTuple):
    """rgb: red, green, blue in [0, 1]. synonyms: other names that are understood."""

    rgb: tuple[float, float, float]
    synonyms: tuple[str, ...] = ()


# Multiples of 1/8 are exact in float32, so that a colour read from an observation is found again.
COLORS: dict[str, Color] = {
    "red": Color((1.0, 0.0, 0.0)),
    "green": Color((0.0, 0.625, 0.0)),
    "blue": Color((0.0, 0.0, 1.0)),
    "yellow": Color((1.0, 1.0, 0.0)),
    "orange": Color((1.0, 0.5, 0.0)),
    "purple": Color((0.625, 0.0, 0.75), ("violet",)),
    "cyan": Color((0.0, 1.0, 1.0), ("turquoise",)),
    "pink": Color((1.0, 0.625, 0.875)),
    "gray": Color((0.5, 0.5, 0.5), ("grey",)),
}


def rgba(name: str, see_through: bool = False) -> RGBA:
    """Return the colour's red, green, blue and opacity, each in [0, 1]. Raises LanguageError for an unknown name."""
    check_known("color", name, COLORS)
    return (*COLORS[name].rgb, SEE_THROUGH if see_through else 1.0)


def color_name(rgba: Sequence[float] | np.ndarray, nearest: bool = False) -> str:
    """Return the name of a colour.

    Args:
        rgba: 4 numbers of any float type; the opacity is 1 or SEE_THROUGH.
        nearest: whether the nearest colour counts if none is exact.

    Raises:
        LanguageError: `rgba` is not four finite numbers, or has no name and `nearest` is False.
    """
    wanted = np.asarray(rgba, dtype=np.float64)
    if wanted.shape != (4,) or not np.isfinite(wanted).all():
        raise LanguageError(f"rgba={rgba} must be four finite numbers")
    distances = np.abs(color_table()[:, :3] - wanted[:3]).sum(axis=1)
    found = int(distances.argmin())
    if not nearest and (distances[found] > 0 or wanted[3] not in (1.0, SEE_THROUGH)):
        raise LanguageError(f"the RGBA {tuple(wanted.tolist())} has no name; the named colors are {', '.join(COLORS)}")
    return list(COLORS)[found]


def color_table(see_through: bool = False) -> np.ndarray:
    """Return (C, 4) float32, the RGBA of each colour in the order of COLORS, which `Scene.colors` indexes."""
    return np.array([rgba(name, see_through) for name in COLORS], dtype=np.float32)


def draw_colors(
    rng: np.random.Generator, n: int, replace: bool = True, excluding: Iterable[str] = ()
) -> tuple[str, ...]:
    """Return n random colour names, each equally likely.

    Args:
        rng: random generator.
        n: how many.
        replace: whether a name may occur twice.
        excluding: names that are not drawn.

    Raises:
        LanguageError: an unknown name in `excluding`, or too few colours are left.
    """
    unwanted = set(excluding)
    for name in unwanted:
        check_known("color", name, COLORS)
    left = [name for name in COLORS if name not in unwanted]
    if n > 0 and (not left or (not replace and n > len(left))):
        raise LanguageError(f"cannot draw {n} colors: {len(left)} are left ({', '.join(left) or 'none'})")
    return tuple(left[i] for i in rng.choice(len(left), size=n, replace=replace)) if n else ()
