"""Named colours, both ways."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from language.errors import LanguageError, check_known

RGBA = tuple[float, float, float, float]

# Multiples of 1/8 survive a trip through float32, so a colour read back from an observation is still exact.
COLORS: dict[str, RGBA] = {
    "red": (1.0, 0.0, 0.0, 1.0),
    "green": (0.0, 0.625, 0.0, 1.0),
    "blue": (0.0, 0.0, 1.0, 1.0),
    "yellow": (1.0, 1.0, 0.0, 1.0),
    "orange": (1.0, 0.5, 0.0, 1.0),
    "purple": (0.625, 0.0, 0.75, 1.0),
    "cyan": (0.0, 1.0, 1.0, 1.0),
}


def rgba(name: str) -> RGBA:
    """The colour's red, green, blue and opacity, each in [0, 1]. Raises LanguageError for an unknown name."""
    check_known("color", name, COLORS)
    return COLORS[name]


def color_name(rgba: Sequence[float] | np.ndarray) -> str:
    """The name of exactly this colour, given as 4 numbers of any float type. Raises LanguageError."""
    wanted = tuple(float(channel) for channel in rgba)
    for name, value in COLORS.items():
        if value == wanted:
            return name
    raise LanguageError(f"the RGBA {wanted} has no name; the named colors are {', '.join(COLORS)}")


def color_table() -> np.ndarray:
    """(C, 4) float32, the RGBA of each colour in the table's order: what `Scene.colors` indexes."""
    return np.array(list(COLORS.values()), dtype=np.float32)


def draw_colors(
    rng: np.random.Generator, n: int, replace: bool = True, excluding: Iterable[str] = ()
) -> tuple[str, ...]:
    """n colour names, each equally likely; `replace=False` makes them differ.

    Raises LanguageError for an unknown name in `excluding`, or where too few colours are left.
    """
    unwanted = set(excluding)
    for name in unwanted:
        check_known("color", name, COLORS)
    left = [name for name in COLORS if name not in unwanted]
    if n > 0 and (not left or (not replace and n > len(left))):
        raise LanguageError(f"cannot draw {n} colors: {len(left)} are left ({', '.join(left) or 'none'})")
    return tuple(left[i] for i in rng.choice(len(left), size=n, replace=replace)) if n else ()
