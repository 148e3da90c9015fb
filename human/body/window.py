"""Keys and display of PyBullet's window, for `human/by_hand.py`.

On Linux, Escape always closes PyBullet's window. A closed window is therefore read as Escape.
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

NAMED_KEYS = {
    bullet.B3G_LEFT_ARROW: "left",
    bullet.B3G_RIGHT_ARROW: "right",
    bullet.B3G_UP_ARROW: "up",
    bullet.B3G_DOWN_ARROW: "down",
    bullet.B3G_PAGE_UP: "pageup",
    bullet.B3G_PAGE_DOWN: "pagedown",
    bullet.B3G_RETURN: "enter",
    27: "escape",
}
POINTING_KEYS = NAMED_KEYS | {ord("u"): "pageup", ord("d"): "pagedown"} | {ord(digit): digit for digit in "0123456789"}
TYPING_KEYS = {  # while sentences are typed
    **NAMED_KEYS,
    **{ord(letter): letter for letter in string.ascii_lowercase + " ,'-"},
    bullet.B3G_BACKSPACE: "backspace",
    **{bullet.B3G_F1 + number: f"f{number + 1}" for number in range(5)},
}
PROJECTION, YAW = 3, 8  # indices in PyBullet's description of a window's camera
CLOSED = bullet.error  # raised by PyBullet after a person has closed the window
UNKNOWN = -1  # PyBullet's number of any other key
PAGE_KEYSYMS = {0xFF55: "pageup", 0xFF56: "pagedown"}  # X11's keysyms
MOVES = (*TABLE, *HEIGHT)
POLL_INTERVAL = 0.02  # seconds between polls without a key press, so that no core spins
REPEAT_DELAY = 0.5  # seconds after which a held key that moves the finger repeats

COLUMNS = 90  # characters in a line
TEXT_DEPTH = 0.5  # metres from the camera to the text
TEXT_SIZE = 1.2
TEXT_COLOR, BEAM_COLOR = (0.05, 0.05, 0.1), (0.9, 0.1, 0.1)


class WindowKeys:
    """Key presses in the window of a client. Held arrow and page keys repeat."""

    def __init__(self, client: int, names: Mapping[int, str] = POINTING_KEYS) -> None:
        """Read the keys in `names`: PyBullet's number of each key, with its name."""
        self._client, self._names = client, names
        self._page_keys = _X11PageKeys() if sys.platform.startswith("linux") else None
        self._since: dict[str, float] = {}  # time at which each key that is down went down

    def poll(self) -> list[str]:
        try:
            events = self._events()
        except CLOSED:
            return ["escape"]
        pressed = [key for key, state in events.items() if self._is_press(key, state)]
        if not pressed:
            time.sleep(POLL_INTERVAL)
        return pressed

    def escape_pressed(self) -> bool:
        return "escape" in self.poll()

    def _events(self) -> dict[str, int]:
        """Return PyBullet's state bits of each key that was pressed or released since the last call."""
        events = bullet.getKeyboardEvents(self._client)
        known = {self._names[key]: state for key, state in events.items() if key in self._names}
        if self._page_keys is not None and events.get(UNKNOWN, 0) & bullet.KEY_IS_DOWN:
            known |= dict.fromkeys(self._page_keys.down(), bullet.KEY_IS_DOWN)
        self._since = {key: since for key, since in self._since.items() if key in known}
        return known

    def _is_press(self, key: str, state: int) -> bool:
        """Return whether the key counts as pressed: newly pressed, even if released again already, or repeating."""
        now, fresh = time.monotonic(), key not in self._since
        since = self._since.setdefault(key, now)
        if state & bullet.KEY_WAS_RELEASED:
            del self._since[key]
        return fresh or (state & bullet.KEY_IS_DOWN > 0 and key in MOVES and now - since > REPEAT_DELAY)


class _X11PageKeys:
    """The page keys as X11 reports them: on Linux, PyBullet's window maps both to the same unknown key."""

    def __init__(self) -> None:
        self._x11 = ctypes.CDLL("libX11.so.6")
        self._x11.XOpenDisplay.restype = ctypes.c_void_p
        self._display = ctypes.c_void_p(self._x11.XOpenDisplay(None))
        self._codes = {self._x11.XKeysymToKeycode(self._display, keysym): name for keysym, name in PAGE_KEYSYMS.items()}
        self._keymap = ctypes.create_string_buffer(32)

    def down(self) -> list[str]:
        """Return the page keys that are down now."""
        self._x11.XQueryKeymap(self._display, self._keymap)
        bits = self._keymap.raw
        return [name for code, name in self._codes.items() if bits[code // 8] >> code % 8 & 1]


class WindowDisplay:
    """Text at the top left of a client's window, independent of its camera, and the finger's line."""

    def __init__(self, client: int) -> None:
        self._client = client
        self._lines: list[str] = []
        self._texts: list[int] = []
        self._beam: int | None = None
        self._camera: tuple = ()

    @property
    def yaw(self) -> float:
        return bullet.getDebugVisualizerCamera(self._client)[YAW]

    def write(self, lines: Sequence[str]) -> None:
        with suppress(CLOSED):
            self._write([part for line in lines for part in textwrap.wrap(line, COLUMNS)])

    def _write(self, lines: list[str]) -> None:
        camera = bullet.getDebugVisualizerCamera(self._client)
        if not camera[PROJECTION][0]:  # the window has not drawn anything yet
            return
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
            origin, target, lineColorRGB=BEAM_COLOR, lineWidth=2, physicsClientId=self._client, **replaced
        )

    def clear(self) -> None:
        self.write([])
        if self._beam is not None:
            with suppress(CLOSED):
                bullet.removeUserDebugItem(self._beam, self._client)
            self._beam = None

    def _put(self, row: int, line: str) -> None:
        """Replace the text of a row; debug items that are added without replacement accumulate."""
        replaced = {"replaceItemUniqueId": self._texts[row]} if row < len(self._texts) else {}
        item = bullet.addUserDebugText(
            line,
            self._place(row),
            textColorRGB=TEXT_COLOR,
            textSize=TEXT_SIZE,
            physicsClientId=self._client,
            **replaced,
        )
        self._texts[row:] = [item, *self._texts[row + 1 :]]

    def _place(self, row: int) -> Array:
        """Return the position (3,), metres, at which a row of text begins."""
        _, _, _, projection, up, ahead, _, _, _, _, distance, target = self._camera
        forward, upward = np.array(ahead), np.array(up)
        eye = np.array(target) - distance * forward
        across = np.cross(forward, upward)
        upward = np.cross(across / np.linalg.norm(across), forward)
        right, top = TEXT_DEPTH / projection[0], TEXT_DEPTH / projection[5]
        height = top * (0.9 - 0.07 * row)
        return eye + TEXT_DEPTH * forward - 0.97 * right * across / np.linalg.norm(across) + height * upward
