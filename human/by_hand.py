"""A person chooses what is meant: keys move the finger, and what it shows is written where they see it.

Keys come from a `Keys`, words go to a `View`; `human/body/window.py` has both for PyBullet's window.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from human.pointing import Array, NothingPointedAt
from human.pointing_arm import Unreachable

STEPS = {**{str(cm): cm / 100 for cm in range(1, 10)}, "0": 0.10}  # key -> metres that the others move by
TABLE = {"right": (1, 0), "left": (-1, 0), "up": (0, 1), "down": (0, -1)}  # (right, away), as the viewer sees them
HEIGHT = {"pageup": 1, "pagedown": -1}
HELP = (
    "arrows: finger left, right, away from you, towards you; page up, page down (or u, d): higher, lower",
    "1-9, 0: steps of 1-9, 10 cm; Enter: choose; Escape: leave",
)


class KeySource(Protocol):
    """What a person presses: "left", "right", "up", "down", "pageup", "pagedown", "enter", "escape", "0" to "9"."""

    def poll(self) -> list[str]:
        """The keys pressed since the last call, oldest first."""

    def escape_pressed(self) -> bool:
        """Was Escape pressed since the last call, while nothing else is listened to?"""


class Display(Protocol):
    """Where the person looks."""

    @property
    def yaw(self) -> float:
        """Degrees by which they look to the left of the y axis."""

    def write(self, lines: Sequence[str]) -> None:
        """Show these lines, and no others."""

    def draw(self, origin: ArrayLike, target: ArrayLike) -> None:
        """Show the line from the fingertip (3,) to the target (3,), metres, and no other."""

    def clear(self) -> None:
        """Show nothing any more."""


class PointingPerson(Protocol):
    """Whom the keys move."""

    def point(self, target: Array) -> Array:
        """Point at target (3,), metres; the fingertip (3,) then. Raises Unreachable, and stays."""

    def nearest(self) -> int:
        """The object nearest to the finger's ray. Raises NothingPointedAt."""

    def meant(self) -> int:
        """The one that is meant, going by the ray and by what is said. Raises NothingPointedAt."""

    def name(self, index: int) -> str:
        """This object in words."""


class ScriptedKeys:
    """Presses these keys one after the other, then Escape."""

    def __init__(self, script: Iterable[str]) -> None:
        self._script = list(script)

    def poll(self) -> list[str]:
        return [self._script.pop(0) if self._script else "escape"]

    def escape_pressed(self) -> bool:
        return self._script[:1] == ["escape"]


class RecordingDisplay:
    """A view that nobody looks at: it keeps what it was told. pages: every list of lines, oldest first."""

    def __init__(self, yaw: float = 0.0) -> None:
        self.yaw = yaw
        self.pages: list[list[str]] = []
        self.beam: tuple[ArrayLike, ArrayLike] | None = None

    def write(self, lines: Sequence[str]) -> None:
        self.pages.append(list(lines))

    def draw(self, origin: ArrayLike, target: ArrayLike) -> None:
        self.beam = origin, target

    def clear(self) -> None:
        self.beam = None


class KeyboardPointer:
    """The place pointed at, moved key by key.

    target: (3,) metres in the workspace frame, where the finger points. step: metres a key. note: why the last key did
    nothing, or "". bounds: x0, x1, y0, y1, z0, z1 of the target. Raises Unreachable for a start that can't be shown.
    """

    def __init__(self, arm: PointingPerson, view: Display, start: ArrayLike, bounds: Sequence[float]) -> None:
        self._arm, self._view = arm, view
        self._low, self._high = np.reshape(bounds, (3, 2)).T
        self.step, self.note = STEPS["5"], ""
        self._go(np.asarray(start, np.float64))

    def press(self, key: str) -> None:
        """Move the finger, or set the step. Where the arm can't follow, it stays, and the note says so."""
        self.note = ""
        self.step = STEPS.get(key, self.step)
        if key not in TABLE and key not in HEIGHT:
            return
        target = self.target + self.step * key_direction(key, self._view.yaw)
        if (target < self._low - 1e-9).any() or (target > self._high + 1e-9).any():
            self.note = "the finger stays: that is too far away from the table"
            return
        try:
            self._go(target)
        except Unreachable as error:
            self.note = f"the finger stays: {error}"

    def chosen(self) -> int | None:
        """The object that is meant; None where there is none, and the note says why."""
        try:
            self.note = ""
            return self._arm.meant()
        except NothingPointedAt as error:
            self.note = str(error)
            return None

    def said(self) -> list[str]:
        """What is pointed at, how far a key goes, and the note."""
        try:
            shown = self._arm.name(self._arm.nearest())
        except NothingPointedAt:
            shown = "nothing"
        return [f"pointing at {shown}", f"step {self.step * 100:.0f} cm", self.note]

    def _go(self, target: Array) -> None:
        tip = self._arm.point(target)
        self.target = target
        self._view.draw(tip, target)


def choose_object(hand: KeyboardPointer, keys: KeySource, view: Display, title: Sequence[str] = ()) -> int | None:
    """The object that a person chooses: they move the finger and press Enter. None: they pressed Escape.

    title: lines above the hints.
    """
    view.write([*title, *HELP, *hand.said()])
    while True:
        for key in keys.poll():
            if key == "escape":
                return None
            if key == "enter" and (found := hand.chosen()) is not None:
                return found
            if key != "enter":
                hand.press(key)
            view.write([*title, *HELP, *hand.said()])


def key_direction(key: str, yaw: float) -> Array:
    """(3,) unit vector along an axis of the workspace frame: the one nearest to where the key goes in this view."""
    if key in HEIGHT:
        return np.array([0.0, 0.0, HEIGHT[key]])
    turn = math.radians(90 * round(yaw / 90))
    right, away = TABLE[key]
    x, y = right * math.cos(turn) - away * math.sin(turn), right * math.sin(turn) + away * math.cos(turn)
    return np.array([round(x), round(y), 0.0])
