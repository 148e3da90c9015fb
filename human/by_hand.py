"""Pointing with the keyboard: keys move the place that the finger points at, until a person chooses an object.

Keys come from a `KeySource`; text and the finger's line go to a `Display`. `human/body/window.py` implements both for
PyBullet's window.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from human.arms import Unreachable
from human.pointing import Array, NothingPointedAt

STEPS = {**{str(cm): cm / 100 for cm in range(1, 10)}, "0": 0.10}  # key -> metres of one move
TABLE = {"right": (1, 0), "left": (-1, 0), "up": (0, 1), "down": (0, -1)}  # key -> (right, away) seen by the viewer
HEIGHT = {"pageup": 1, "pagedown": -1}
HELP = (
    "arrows: finger left, right, away from you, towards you; page up, page down (or u, d): higher, lower",
    "1-9, 0: steps of 1-9, 10 cm; Enter: choose; Escape: leave",
)


class KeySource(Protocol):
    """Key presses: "left", "right", "up", "down", "pageup", "pagedown", "enter", "escape", "0" to "9"."""

    def poll(self) -> list[str]:
        """Return the keys pressed since the last call, oldest first."""

    def escape_pressed(self) -> bool:
        """Return whether Escape was pressed since the last call. Other keys pressed since then are discarded."""


class Display(Protocol):
    """Where text and the finger's line are shown."""

    @property
    def yaw(self) -> float:
        """Degrees by which the viewer looks to the left of the y axis."""

    def write(self, lines: Sequence[str]) -> None:
        """Show these lines in place of the earlier ones."""

    def draw(self, origin: ArrayLike, target: ArrayLike) -> None:
        """Show the line from the fingertip (3,) to the target (3,), metres, in place of the earlier one."""

    def clear(self) -> None:
        """Remove all lines."""


class PointingPerson(Protocol):
    """The person whose finger the keys move."""

    def point(self, target: Array) -> Array:
        """Point at target (3,), metres; return the fingertip (3,). Raises Unreachable, and then nothing moves."""

    def nearest(self) -> int:
        """Return the object nearest to the finger's ray. Raises NothingPointedAt."""

    def meant(self) -> int:
        """Return the referent, given the ray and the words. Raises NothingPointedAt."""

    def name(self, index: int) -> str:
        """Return this object's name in words."""


class KeyboardPointer:
    """The place that the finger points at, moved by keys.

    Attributes:
        target: (3,) metres in the workspace frame, where the finger points.
        step: metres of one move.
        note: the reason why the last key had no effect, or "".
    """

    def __init__(self, person: PointingPerson, display: Display, start: ArrayLike, bounds: Sequence[float]) -> None:
        """Point at `start`.

        Args:
            person: points where the keys lead.
            display: shows the finger's line.
            start: (3,) metres.
            bounds: x0, x1, y0, y1, z0, z1 of the target, metres.

        Raises:
            Unreachable: the person can't point at `start`.
        """
        self._person, self._display = person, display
        self._low, self._high = np.reshape(bounds, (3, 2)).T
        self.step, self.note = STEPS["5"], ""
        self._point_at(np.asarray(start, np.float64))

    def press(self, key: str) -> None:
        """Move the finger or sets the step. If the arm can't follow, the finger stays and `note` gives the reason."""
        self.note = ""
        self.step = STEPS.get(key, self.step)
        if key not in TABLE and key not in HEIGHT:
            return
        target = self.target + self.step * key_direction(key, self._display.yaw)
        if (target < self._low - 1e-9).any() or (target > self._high + 1e-9).any():
            self.note = "the finger stays: that is too far away from the table"
            return
        try:
            self._point_at(target)
        except Unreachable as error:
            self.note = f"the finger stays: {error}"

    def chosen(self) -> int | None:
        """Return the referent; None if there is none, and then `note` gives the reason."""
        try:
            self.note = ""
            return self._person.meant()
        except NothingPointedAt as error:
            self.note = str(error)
            return None

    def status(self) -> list[str]:
        """Return lines of text: the object pointed at, the step and the note."""
        try:
            shown = self._person.name(self._person.nearest())
        except NothingPointedAt:
            shown = "nothing"
        return [f"pointing at {shown}", f"step {self.step * 100:.0f} cm", self.note]

    def _point_at(self, target: Array) -> None:
        tip = self._person.point(target)
        self.target = target
        self._display.draw(tip, target)


def choose_object(pointer: KeyboardPointer, keys: KeySource, display: Display, title: Sequence[str] = ()) -> int | None:
    """Let a person move the finger until they press Enter or Escape.

    Args:
        pointer: moved by the keys.
        keys: where key presses come from.
        display: shows the title, the help and the pointer's status.
        title: lines above the help.

    Returns:
        The object chosen with Enter; None for Escape.
    """
    display.write([*title, *HELP, *pointer.status()])
    while True:
        for key in keys.poll():
            if key == "escape":
                return None
            if key == "enter" and (chosen := pointer.chosen()) is not None:
                return chosen
            if key != "enter":
                pointer.press(key)
            display.write([*title, *HELP, *pointer.status()])


def key_direction(key: str, yaw: float) -> Array:
    """Return the axis of the workspace frame nearest to the key's direction in this view, a unit vector (3,).

    yaw: degrees by which the viewer looks to the left of the y axis.
    """
    if key in HEIGHT:
        return np.array([0.0, 0.0, HEIGHT[key]])
    turn = math.radians(90 * round(yaw / 90))
    right, away = TABLE[key]
    x, y = right * math.cos(turn) - away * math.sin(turn), right * math.sin(turn) + away * math.cos(turn)
    return np.array([round(x), round(y), 0.0])
