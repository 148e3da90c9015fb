"""The window on a virtual screen (Xvfb) with real key presses, as a person uses `by_hand=true` and `play.py --gui`."""

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

ROOT = Path(__file__).resolve().parents[3]
TIMEOUT = 90  # seconds for the next event on a busy machine; an idle one needs 10 for all of them
PROGRAM = """
from conf.overrides import compose
from envs import read_env
from envs.interactive.by_hand import ByHandEnv, run_by_hand
from envs.experts import Oracle
from human.body.window import WindowDisplay

class PrintingDisplay(WindowDisplay):
    def write(self, lines):
        super().write(lines)
        print("|".join(lines), flush=True)

    def draw(self, origin, target):
        super().draw(origin, target)
        print("target", *(f"{metres:.3f}" for metres in target), flush=True)

    def clear(self):
        super().clear()
        print("cleared", flush=True)

env = ByHandEnv(read_env(compose(["task=reach_gesture", "gesture.frames=3"])), seed=0)
keys, _ = env.user_interface()
# A window is always client 0 of PyBullet.
print("results", run_by_hand(env, Oracle(env), 5, keys, PrintingDisplay(0)), flush=True)
env.close()
"""


class Screen:
    """An X server without a screen. Skips the test if Xvfb is missing or does not start."""

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
            number = pipe.readline().strip()  # it chooses a free one; "" if it has ended
        if not number:
            self.close()
            pytest.skip(f"Xvfb does not start: {(folder / 'xvfb.log').read_text()[-200:]}")
        self.name = f":{number}"

    def environment(self) -> dict[str, str]:
        """OpenGL in software gets one thread, which leaves the other core to the simulation."""
        path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
        return os.environ | {"DISPLAY": self.name, "LP_NUM_THREADS": "1", "PYTHONPATH": path, "OMP_NUM_THREADS": "1"}

    def check(self) -> None:
        """Skips the test if PyBullet cannot open a window here, for want of OpenGL in software."""
        code = "import pybullet as b; print('opened', b.connect(b.GUI), flush=True)"
        tried = subprocess.run(
            [sys.executable, "-c", code], env=self.environment(), capture_output=True, text=True, timeout=TIMEOUT
        )
        if "opened 0" not in tried.stdout:
            pytest.skip(f"no OpenGL in software: {(tried.stdout + tried.stderr).strip()[-200:]}")

    def close(self) -> None:
        self._server.terminate()
        self._server.wait(10)


class Program:
    """A running program, the lines that it prints, and a keyboard."""

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
        """The next line that contains these words. Skips the test if PyBullet cannot open a window at all."""
        seen, deadline = [], time.monotonic() + TIMEOUT
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
        """Taps a key, or holds it until a line with these words comes. Returns that line."""
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
        """(768, 1024, 3) uint8, the content of the screen."""
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
    """A function that starts a program on a virtual screen."""
    screen = Screen(tmp_path)
    programs = []

    def begin(*words):
        programs.append(Program(screen, tmp_path, *words))
        return programs[-1]

    try:
        yield begin
    finally:
        for program in programs:
            program.close()
        screen.close()


@pytest.mark.slow
def test_play_draws_the_robot_in_a_window_and_ends_with_escape(start):
    program = start("play.py", "--gui")
    deadline = time.monotonic() + TIMEOUT
    while not is_drawn(program.picture()) and program.process.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.5)
    if program.process.poll() is not None:
        program.until("an end")  # skips if PyBullet cannot open a window at all
    program.press("Escape")
    assert program.process.wait(60) == 0


@pytest.mark.slow
def test_keys_at_the_window_choose_the_referent(start):
    program = start("-c", PROGRAM)
    target = metres_in(program.until("target"))
    assert "arrows" in program.until("pointing at")
    for key, axis, metres in (
        ("Left", 0, -0.05),
        ("Up", 1, 0.05),
        ("Right", 0, 0.05),
        ("u", 2, 0.05),
        ("Down", 1, -0.05),
    ):
        target[axis] += metres
        program.press(key)
        assert metres_in(program.until("target")) == pytest.approx(target, abs=1e-3), key
        program.until("pointing at")
    program.press("2")
    program.until("step 2 cm")
    lower = metres_in(program.press("Next", until="target"))  # page down
    assert lower[:2] == pytest.approx(target[:2], abs=1e-3)
    assert lower[2] < target[2]
    program.press("w")  # a key of PyBullet's own, which would draw wireframes
    assert is_drawn(program.picture())
    program.press("Return")
    meant = program.until("meant:").split("|")[1]
    assert meant in program.until("|success|")
    program.press("Return")
    program.until("arrows")
    program.press("Escape")
    result = program.until("results")
    assert result.count("EpisodeResult(") == 1
    assert "success" in result
    assert program.process.wait(60) == 0


def metres_in(line: str) -> list[float]:
    return [float(metres) for metres in line.split()[1:]]


def is_drawn(picture):
    """Dark words on the pale wall at the top left, a blue arm, and no panels, which would be dark at the left edge."""
    words, below = picture[15:130, 10:400], picture[200:700, 0:200]
    written = 0.01 < (words < 90).all(-1).mean() < 0.3 and (words > 200).all(-1).mean() > 0.5
    red, blue = (picture[..., channel].astype(int) for channel in (0, 2))
    return written and (blue > red + 60).mean() > 0.005 and (below > 70).all(-1).mean() > 0.8
