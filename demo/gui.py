"""The session in PyBullet's own window: what is typed there is said, and keys move the finger or the gripper."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from demo.loop import PLAIN
from demo.session import Session
from demo.session_config import DRIVERS
from human import Display, KeySource
from human.body.window import CLOSED, MOVES
from human.by_hand import key_direction

Array = NDArray[np.float64]
HELP = (
    "type what to do, Enter does it; arrows and page keys move the finger",
    "F1 stop, F2 shuffle, F3 go where I point, F4 policy, expert or hand",
    "by hand: arrows and page keys move the gripper, F5 shuts it; Escape leaves",
)


class Gui:
    """A person who presses keys and looks at a view of a session. hurry: don't wait for real time to pass."""

    def __init__(self, session: Session, keys: KeySource, view: Display, hurry: bool = False) -> None:
        self._session, self._keys, self._view = session, keys, view
        self._period = 0.0 if hurry else session.period
        self._typed, self._told = "", f"try: {session.example()}"
        self._left = False
        self._ray: tuple[Array, Array] | None = None

    def run(self) -> None:
        """Until Escape is pressed or the window closed."""
        due = time.monotonic()
        try:
            while not self._left:
                for key in self._keys.poll():
                    self._press(key)
                self._session.step()
                self._show()
                due = max(due + self._period, time.monotonic())
                time.sleep(max(0.0, due - time.monotonic()))
        except CLOSED:
            if not self._keys.escape_pressed():  # else the window was closed, in the middle of something
                raise

    def _press(self, key: str) -> None:
        if key == "escape":
            self._left = True
        elif len(key) == 1:
            self._typed += key
        elif key == "backspace":
            self._typed = self._typed[:-1]
        else:
            self._try(key)

    def _try(self, key: str) -> None:
        """Bad words, or a place that cannot be shown, are told, and all stays as it was."""
        self._told = ""
        does: dict[str, Callable[[], object]] = {
            "enter": self._say,
            "f1": self._session.stop,
            "f2": self._session.shuffle,
            "f3": self._session.go,
            "f4": self._drive,
            "f5": self._grip,
        }
        try:
            if key in MOVES:
                self._session.nudge(key_direction(key, self._view.yaw))
            else:
                does[key]()
        except PLAIN as error:
            self._told = str(error)

    def _say(self) -> None:
        sentence, self._typed = self._typed.strip(), ""
        if sentence:
            self._told = self._session.say(sentence).message

    def _drive(self) -> None:
        """The next driver that can be had."""
        session = self._session
        at = DRIVERS.index(session.choice.driver)
        drivers = [*DRIVERS[at + 1 :], *DRIVERS[: at + 1]]
        session.drive(next(driver for driver in drivers if driver != "policy" or session.has_policy))

    def _grip(self) -> None:
        self._session.shut = not self._session.shut

    def _show(self) -> None:
        session, show = self._session, self._session.show
        driver = session.choice.driver + (", gripper shut" if session.hand is not None and session.shut else "")
        hears = f'the policy hears: "{show.hears}"' if show.hears else ""
        lines = [f"> {self._typed}_", self._told, f"{show.status} (driven by: {driver})", hears, session.note]
        if show.pointing is not None:
            likeliest = int(show.pointing.argmax())
            lines.append(f"pointed at: {session.names()[likeliest]} ({show.pointing[likeliest]:.0%})")
        self._view.write([*HELP, *filter(None, lines)])
        if show.ray is not self._ray:
            self._ray = show.ray
            self._draw()

    def _draw(self) -> None:
        if self._ray is None:
            self._view.clear()
        else:
            origin, way = self._ray
            self._view.draw(origin, origin + way * _length(origin, way))


def _length(origin: Array, way: Array) -> float:
    """Metres to the table, or of what is drawn of a ray that never meets it."""
    return float(origin[2] / -way[2]) if way[2] < -1e-6 and origin[2] > 0 else 1.0
