"""The items of the chart."""

from __future__ import annotations

from typing import Any, NamedTuple


class Item(NamedTuple):
    """A part of a reading: the token after it, its meaning, its cost, and a bit for each token that it leaves out."""

    end: int
    value: Any
    cost: float
    skipped: int = 0
