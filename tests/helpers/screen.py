"""A virtual screen (Xvfb), and programs that run on it, with their output, their keyboard and their picture."""

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

ROOT = Path(__file__).resolve().parents[2]
TIMEOUT = 90  # seconds for the next event on a busy machine; an idle one needs 10 for all of them


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
        """Skips the test if PyBullet cannot open a window here, because software OpenGL is missing."""
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

    def exit_code(self) -> int:
        """The exit code of a program that is ending. An error is raised with what it printed if it is not 0."""
        code = self.process.wait(TIMEOUT)
        self._log.seek(0)
        assert code == 0, f"exit code {code}; {self._log.read()[-2000:]}"
        return code

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
