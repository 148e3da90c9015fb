"""The keys and the view of `human/by_hand.py` in PyBullet's window.

On Linux, Escape closes that window, whatever it is told. So a window that is closed is one that was left.
"""

from __future__ import annotations

import ctypes
import string
import sys
import textwrap
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress

import numpy as np
import pybullet as bullet
from numpy.typing import ArrayLike

from human.by_hand import HEIGHT, TABLE
from human.pointing import Array

PLAIN = {
    bullet.B3G_LEFT_ARROW: "left",
    bullet.B3G_RIGHT_ARROW: "right",
    bullet.B3G_UP_ARROW: "up",
    bullet.B3G_DOWN_ARROW: "down",
    bullet.B3G_PAGE_UP: "pageup",
    bullet.B3G_PAGE_DOWN: "pagedown",
    bullet.B3G_RETURN: "enter",
    27: "escape",
}
PRESSED = PLAIN | {ord("u"): "pageup", ord("d"): "pagedown"} | {ord(digit): digit for digit in "0123456789"}
TYPED = {  # where sentences are typed
    **PLAIN,
    **{ord(letter): letter for letter in string.ascii_lowercase + " ,'-"},
    bullet.B3G_BACKSPACE: "backspace",
    **{bullet.B3G_F1 + number: f"f{number + 1}" for number in range(5)},
}
CLOSED = bullet.error  # what Bullet raises where a person has closed the window
UNKNOWN = -1  # any other key
PAGES = {0xFF55: "pageup", 0xFF56: "pagedown"}  # by X11's keysyms
MOVES = (*TABLE, *HEIGHT)
WAIT = 0.02  # seconds before the window is asked again, or a core would spin
HELD = 0.5  # seconds after which a key that moves the finger does so again and again

COLUMNS = 90  # letters in a line
DEPTH = 0.5  # metres from the eye to where the letters stand
SIZE = 1.2
INK, BEAM = (0.05, 0.05, 0.1), (0.9, 0.1, 0.1)


class WindowKeys:
    """What is pressed in the window of this client. An arrow or page key that is held is pressed again and again.

    names: Bullet's number of each key that counts, to its name.
    """

    def __init__(self, client: int, names: Mapping[int, str] = PRESSED) -> None:
        self._client, self._names = client, names
        self._pages = _Pages() if sys.platform.startswith("linux") else None
        self._since: dict[str, float] = {}  # when each key that is down went down

    def poll(self) -> list[str]:
        try:
            events = self._events()
        except CLOSED:
            return ["escape"]
        pressed = [key for key, state in events.items() if self._counts(key, state)]
        if not pressed:
            time.sleep(WAIT)
        return pressed

    def escape_pressed(self) -> bool:
        return "escape" in self.poll()

    def _events(self) -> dict[str, int]:
        """Bullet's state bits of each key that was touched since the last call."""
        events = bullet.getKeyboardEvents(self._client)
        known = {self._names[key]: state for key, state in events.items() if key in self._names}
        if self._pages is not None and events.get(UNKNOWN, 0) & bullet.KEY_IS_DOWN:
            known |= dict.fromkeys(self._pages.down(), bullet.KEY_IS_DOWN)
        self._since = {key: since for key, since in self._since.items() if key in known}
        return known

    def _counts(self, key: str, state: int) -> bool:
        """A key that was let go again before it was seen to be down counts as well."""
        now, fresh = time.monotonic(), key not in self._since
        since = self._since.setdefault(key, now)
        if state & bullet.KEY_WAS_RELEASED:
            del self._since[key]
        return fresh or (state & bullet.KEY_IS_DOWN > 0 and key in MOVES and now - since > HELD)


class _Pages:
    """The page keys, asked from X11: there, Bullet's window takes both for the same unknown key."""

    def __init__(self) -> None:
        self._x11 = ctypes.CDLL("libX11.so.6")
        self._x11.XOpenDisplay.restype = ctypes.c_void_p
        self._display = ctypes.c_void_p(self._x11.XOpenDisplay(None))
        self._codes = {self._x11.XKeysymToKeycode(self._display, keysym): name for keysym, name in PAGES.items()}
        self._keymap = ctypes.create_string_buffer(32)

    def down(self) -> list[str]:
        """Those that are down now."""
        self._x11.XQueryKeymap(self._display, self._keymap)
        bits = self._keymap.raw
        return [name for code, name in self._codes.items() if bits[code // 8] >> code % 8 & 1]


class WindowDisplay:
    """Writes at the top left of the window of this client, wherever its camera looks from."""

    def __init__(self, client: int) -> None:
        self._client = client
        self._lines: list[str] = []
        self._texts: list[int] = []
        self._beam: int | None = None
        self._camera: tuple = ()

    @property
    def yaw(self) -> float:
        return bullet.getDebugVisualizerCamera(self._client)[8]

    def write(self, lines: Sequence[str]) -> None:
        with suppress(CLOSED):
            self._write([part for line in lines for part in textwrap.wrap(line, COLUMNS)])

    def _write(self, lines: list[str]) -> None:
        camera = bullet.getDebugVisualizerCamera(self._client)
        moved, self._camera = camera != self._camera, camera
        for row, line in enumerate(lines):
            if moved or line != (self._lines[row] if row < len(self._lines) else None):
                self._put(row, line)
        for item in self._texts[len(lines) :]:
            bullet.removeUserDebugItem(item, self._client)
        self._texts, self._lines = self._texts[: len(lines)], lines

    def draw(self, origin: ArrayLike, target: ArrayLike) -> None:
        replaced = {} if self._beam is None else {"replaceItemUniqueId": self._beam}
        self._beam = bullet.addUserDebugLine(
            origin, target, lineColorRGB=BEAM, lineWidth=2, physicsClientId=self._client, **replaced
        )

    def clear(self) -> None:
        self.write([])
        if self._beam is not None:
            with suppress(CLOSED):
                bullet.removeUserDebugItem(self._beam, self._client)
            self._beam = None

    def _put(self, row: int, line: str) -> None:
        """Replace what stands in a row: items that are added pile up."""
        replaced = {"replaceItemUniqueId": self._texts[row]} if row < len(self._texts) else {}
        item = bullet.addUserDebugText(
            line, self._place(row), textColorRGB=INK, textSize=SIZE, physicsClientId=self._client, **replaced
        )
        self._texts[row:] = [item, *self._texts[row + 1 :]]

    def _place(self, row: int) -> Array:
        """(3,) metres, where a row of the window starts."""
        _, _, _, lens, up, ahead, _, _, _, _, distance, target = self._camera
        forward, upward = np.array(ahead), np.array(up)
        eye = np.array(target) - distance * forward
        across = np.cross(forward, upward)
        upward = np.cross(across / np.linalg.norm(across), forward)
        right, top = DEPTH / lens[0], DEPTH / lens[5]
        height = top * (0.9 - 0.07 * row)
        return eye + DEPTH * forward - 0.97 * right * across / np.linalg.norm(across) + height * upward
