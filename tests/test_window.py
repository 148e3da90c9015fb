"""The real window on a screen of its own, with real key presses: what `by_hand=true` is for a person."""

from __future__ import annotations

import os
import queue
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SLOW = 90  # seconds that a busy machine may need for the next thing to happen; one at leisure needs 10 for all of them
PROGRAM = """
from conf.overrides import compose
from envs import read_env
from envs.interactive.by_hand import HandEnv, play
from envs.experts import Oracle
from human.body.window import WindowView

class Told(WindowView):
    def write(self, lines):
        super().write(lines)
        print("|".join(lines), flush=True)

    def draw(self, origin, target):
        super().draw(origin, target)
        print("target", *(f"{metres:.3f}" for metres in target), flush=True)

    def clear(self):
        super().clear()
        print("cleared", flush=True)

env = HandEnv(read_env(compose(["task=reach_gesture", "gesture.frames=3"])), seed=0)
keys, view = env.face()
print("played", play(env, Oracle(env), 5, keys, Told(view._client)), flush=True)
env.close()
"""


class Screen:
    """An X server without a screen. Skips the test where there is none, or none that draws."""

    def __init__(self, folder: Path) -> None:
        server = shutil.which("Xvfb")
        if server is None:
            pytest.skip("Xvfb is not installed")
        pytest.importorskip("Xlib", reason="python-xlib is not installed: it presses the keys")
        read, write = os.pipe()
        words = [server, "-displayfd", str(write), "-screen", "0", "1024x768x24", "-nolisten", "tcp"]
        with open(folder / "xvfb.log", "wb") as log:
            self._server = subprocess.Popen(words, pass_fds=[write], stdout=log, stderr=log, stdin=subprocess.DEVNULL)
        os.close(write)
        with os.fdopen(read) as pipe:
            number = pipe.readline().strip()  # it takes a free one; nothing, where it ends
        if not number:
            self.close()
            pytest.skip(f"Xvfb does not start: {(folder / 'xvfb.log').read_text()[-200:]}")
        self.name = f":{number}"

    def environment(self) -> dict[str, str]:
        """One thread of OpenGL in software leaves the other core to the simulation."""
        path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
        return os.environ | {"DISPLAY": self.name, "LP_NUM_THREADS": "1", "PYTHONPATH": path, "OMP_NUM_THREADS": "1"}

    def check(self) -> None:
        """Skips where PyBullet opens no window here: OpenGL in software is missing."""
        code = "import pybullet as b; print('opened', b.connect(b.GUI), flush=True)"
        tried = subprocess.run(
            [sys.executable, "-c", code], env=self.environment(), capture_output=True, text=True, timeout=SLOW
        )
        if "opened 0" not in tried.stdout:
            pytest.skip(f"no OpenGL in software: {(tried.stdout + tried.stderr).strip()[-200:]}")

    def close(self) -> None:
        self._server.terminate()
        self._server.wait(10)


class Played:
    """A program, what it prints, and a keyboard."""

    def __init__(self, screen: Screen, folder: Path, *words: str) -> None:
        from Xlib import display

        self._screen = screen
        self._log = open(folder / "errors.log", "w+")  # noqa: SIM115
        self.process = subprocess.Popen(
            [sys.executable, *words],
            env=screen.environment(),
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=self._log,
            stdin=subprocess.DEVNULL,
            text=True,
        )
        self._lines: queue.Queue[str | None] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()
        self._display = display.Display(screen.name)

    def _read(self) -> None:
        for line in self.process.stdout:
            self._lines.put(line.strip())
        self._lines.put(None)

    def until(self, words: str) -> str:
        """The next line that has these words. Skips where PyBullet opens no window at all."""
        seen, deadline = [], time.monotonic() + SLOW
        while time.monotonic() < deadline:
            try:
                line = self._lines.get(timeout=1)
            except queue.Empty:
                continue
            seen.append(line)
            if line is None:
                break
            if words in line:
                return line
        self._screen.check()
        self._log.seek(0)
        raise AssertionError(f"{words!r} never came, but {seen}; {self._log.read()[-1000:]}")

    def press(self, name: str, until: str | None = None) -> str:
        """Tap a key, or hold it until a line with these words comes, which is returned."""
        from Xlib import XK, X
        from Xlib.ext import xtest

        code = self._display.keysym_to_keycode(XK.string_to_keysym(name))
        line = ""
        for event in (X.KeyPress, X.KeyRelease):
            xtest.fake_input(self._display, event, code)
            self._display.sync()
            if until is None:
                time.sleep(0.05)
            elif event == X.KeyPress:
                line = self.until(until)
        return line

    def picture(self):
        """(768, 1024, 3) what is on the screen."""
        import numpy as np
        from Xlib import X

        root = self._display.screen().root
        raw = root.get_image(0, 0, 1024, 768, X.ZPixmap, 0xFFFFFFFF).data
        return np.frombuffer(raw, np.uint8).reshape(768, 1024, 4)[..., 2::-1]

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait(10)
        self._display.close()
        self._log.close()


@pytest.fixture
def start(tmp_path):
    """Starts a program on a screen of its own."""
    screen = Screen(tmp_path)
    programs = []

    def begin(*words):
        programs.append(Played(screen, tmp_path, *words))
        return programs[-1]

    try:
        yield begin
    finally:
        for program in programs:
            program.close()
        screen.close()


def test_play_opens_the_window_draws_the_robot_and_ends_with_escape(start):
    played = start("play.py", "--gui")
    deadline = time.monotonic() + SLOW
    while not is_drawn(played.picture()) and played.process.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.5)
    if played.process.poll() is not None:
        played.until("an end")  # skips where PyBullet opens no window at all
    played.press("Escape")
    assert played.process.wait(60) == 0


def test_a_person_at_the_window_chooses_with_keys(start):
    played = start("-c", PROGRAM)
    target = metres_in(played.until("target"))
    assert "arrows" in played.until("pointing at")
    for key, axis, metres in (
        ("Left", 0, -0.05),
        ("Up", 1, 0.05),
        ("Right", 0, 0.05),
        ("u", 2, 0.05),
        ("Down", 1, -0.05),
    ):
        target[axis] += metres
        played.press(key)
        assert metres_in(played.until("target")) == pytest.approx(target, abs=1e-3), key
        played.until("pointing at")
    played.press("2")
    played.until("step 2 cm")
    lower = metres_in(played.press("Next", until="target"))  # page down
    assert lower[:2] == pytest.approx(target[:2], abs=1e-3)
    assert lower[2] < target[2]
    played.press("w")  # PyBullet's own key, which would draw wires
    assert is_drawn(played.picture())
    played.press("Return")
    meant = played.until("meant:").split("|")[1]
    assert meant in played.until("|success|")
    played.press("Return")
    played.until("arrows")
    played.press("Escape")
    result = played.until("played")
    assert result.count("Played(") == 1
    assert "success" in result
    assert played.process.wait(60) == 0


def metres_in(line: str) -> list[float]:
    return [float(metres) for metres in line.split()[1:]]


def is_drawn(picture):
    """Dark words on the pale wall at the top left, a blue arm, and no panels, which are dark at the left edge."""
    words, below = picture[15:130, 10:400], picture[200:700, 0:200]
    written = 0.01 < (words < 90).all(-1).mean() < 0.3 and (words > 200).all(-1).mean() > 0.5
    red, blue = (picture[..., channel].astype(int) for channel in (0, 2))
    return written and (blue > red + 60).mean() > 0.005 and (below > 70).all(-1).mean() > 0.8
