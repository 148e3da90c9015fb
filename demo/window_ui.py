"""User interface in PyBullet's own window: a typed sentence is said, and keys move the finger or the gripper."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from demo.real_time_loop import USER_ERRORS
from demo.session import Session
from demo.session_config import DRIVERS
from human import Display, KeySource
from human.body.window import CLOSED, MOVES
from human.by_hand import key_direction

Array = NDArray[np.float64]
HELP = (
    "type an instruction and press Enter; arrow and page keys move the finger",
    "F1 stop, F2 shuffle, F3 go where I point, F4 policy, expert or hand",
    "by hand: arrow and page keys move the gripper, F5 closes it; Escape quits",
)


class WindowUI:
    """Passes keys to a session and shows its state. real_time: False takes control steps without waiting."""

    def __init__(self, session: Session, keys: KeySource, display: Display, real_time: bool = True) -> None:
        self._session, self._keys, self._display = session, keys, display
        self._period = session.period if real_time else 0.0
        self._typed, self._message = "", f"try: {session.example()}"
        self._quit = False
        self._ray: tuple[Array, Array] | None = None

    def run(self) -> None:
        """Runs until Escape is pressed or the window is closed."""
        due = time.monotonic()
        try:
            while not self._quit:
                for key in self._keys.poll():
                    self._press(key)
                self._session.step()
                self._show()
                due = max(due + self._period, time.monotonic())
                time.sleep(max(0.0, due - time.monotonic()))
        except CLOSED:
            if not self._keys.escape_pressed():  # an error of PyBullet's, not the closed window
                raise

    def _press(self, key: str) -> None:
        if key == "escape":
            self._quit = True
        elif len(key) == 1:
            self._typed += key
        elif key == "backspace":
            self._typed = self._typed[:-1]
        else:
            self._act(key)

    def _act(self, key: str) -> None:
        """Does what the key stands for. A user error becomes the message, and changes nothing."""
        self._message = ""
        actions: dict[str, Callable[[], object]] = {
            "enter": self._say,
            "f1": self._session.stop,
            "f2": self._session.shuffle,
            "f3": self._session.go_where_pointed,
            "f4": self._change_driver,
            "f5": self._toggle_gripper,
        }
        try:
            if key in MOVES:
                self._session.nudge(key_direction(key, self._display.yaw))
            else:
                actions[key]()
        except USER_ERRORS as error:
            self._message = str(error)

    def _say(self) -> None:
        sentence, self._typed = self._typed.strip(), ""
        if sentence:
            self._message = self._session.say(sentence).message

    def _change_driver(self) -> None:
        """The next available driver."""
        session = self._session
        at = DRIVERS.index(session.config.driver)
        drivers = [*DRIVERS[at + 1 :], *DRIVERS[: at + 1]]
        session.set_driver(next(driver for driver in drivers if driver != "policy" or session.has_policy))

    def _toggle_gripper(self) -> None:
        self._session.gripper_closed = not self._session.gripper_closed

    def _show(self) -> None:
        session, view = self._session, self._session.view
        gripper = ", gripper closed" if session.hand_target is not None and session.gripper_closed else ""
        status = f"{view.status} (driven by: {session.config.driver}{gripper})"
        policy_sentence = f'the policy hears: "{view.policy_sentence}"' if view.policy_sentence else ""
        lines = [f"> {self._typed}_", self._message, status, policy_sentence, session.note]
        if view.pointing is not None:
            likeliest = int(view.pointing.argmax())
            lines.append(f"pointed at: {session.object_names()[likeliest]} ({view.pointing[likeliest]:.0%})")
        self._display.write([*HELP, *filter(None, lines)])
        if view.ray is not self._ray:
            self._ray = view.ray
            self._draw_ray()

    def _draw_ray(self) -> None:
        if self._ray is None:
            self._display.clear()
        else:
            origin, direction = self._ray
            self._display.draw(origin, origin + direction * _ray_length(origin, direction))


def _ray_length(origin: Array, direction: Array) -> float:
    """Metres to the table; 1 for a ray that does not meet it."""
    return float(origin[2] / -direction[2]) if direction[2] < -1e-6 and origin[2] > 0 else 1.0
