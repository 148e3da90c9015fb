"""play.py on a port of its own, and somebody who has it open in a tab of the system's Chromium."""

from __future__ import annotations

import atexit
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
SOFTWARE = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PATIENCE = 120  # seconds: without a graphics card, on a shared core
SIZE, WIDE = (900, 800), (1040, 640)  # pixels of a tab
SMALL = 0.25  # of the pixels' sides: what a browser without a graphics card can draw in time
BREATH = "() => new Promise(rested => setTimeout(rested, 100))"


def free_port() -> str:
    """One that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return str(probe.getsockname()[1])


class Served:
    """play.py on a port of its own. address: of its page."""

    def __init__(self, *words: str) -> None:
        command = [sys.executable, "play.py", "--port", free_port(), *words]
        environment = os.environ | {"PYTHONWARNINGS": "ignore"}
        self._errors = tempfile.TemporaryFile("w+")  # noqa: SIM115  a pipe that nobody reads would fill up
        pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": self._errors, "text": True}
        self.process = subprocess.Popen(command, cwd=ROOT, env=environment, **pipes)
        atexit.register(self.process.kill)
        assert self.process.stdout is not None
        self.address = next((line.split()[0] for line in self.process.stdout if line.startswith("http")), "")
        if not self.address:
            sys.exit(self._said().strip().splitlines()[-1])

    def megabytes(self) -> float:
        """Resident memory."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.search(r"VmRSS:\s+(\d+)", status)[1]) / 1024  # type: ignore[index]

    def close(self) -> str:
        """Interrupt it. Returns what it wrote to stderr; its exit code is `process.returncode`."""
        self.process.send_signal(signal.SIGINT)
        return self._said()

    def _said(self) -> str:
        self.process.wait(PATIENCE)
        self._errors.seek(0)
        return self._errors.read()


class Visitor:
    """Somebody with the page open in a tab of a browser (Playwright's)."""

    def __init__(self, browser: Any, address: str, sharp: bool = False) -> None:
        scale, size, view = (1, WIDE, f"{address}/?fixedDpr=1") if sharp else (SMALL, SIZE, address)
        self.tab = browser.new_page(viewport={"width": size[0], "height": size[1]}, device_scale_factor=scale)
        self.tab.set_default_timeout(1000 * PATIENCE)
        self.tab.goto(view)
        self.field("Say").wait_for()
        self.shows("clock:")

    def field(self, label: str) -> Any:
        """The input behind a label."""
        return self.tab.locator(f'xpath=//*[normalize-space(text())="{label}"]/following::input[1]')

    def types(self, sentence: str) -> None:
        """As slowly as fingers: viser's page forgets what is typed within 50 ms of Enter, or the other way round."""
        self.tab.evaluate(BREATH)
        self.field("Say").fill(sentence)
        self.tab.evaluate(BREATH)

    def says(self, sentence: str) -> None:
        self.types(sentence)
        self.field("Say").press("Enter")

    def gets(self, sentence: str) -> str:
        """Say it, and wait until it is done or not; how it ended. What ended before is wiped away first."""
        self.presses("Stop")
        self.shows("Stopped")
        self.says(sentence)
        return re.search("Done in|Not done: .*", self.shows("Done in|Not done"))[0]  # type: ignore[index]

    def shows(self, words: str) -> str:
        """Wait until the page has this pattern; the text of the element that does."""
        found = self.tab.get_by_text(re.compile(words)).first
        found.wait_for()
        return found.inner_text()

    def presses(self, button: str) -> None:
        self.tab.get_by_text(button, exact=True).first.click()

    def chooses(self, label: str, option: str) -> None:
        self.field(label).click()
        self.tab.get_by_role("option", name=option, exact=True).click()

    def takes(self, name: str) -> bytes:
        """The file of this name that the page offers."""
        with self.tab.expect_download() as taken:
            self.tab.locator(f'a[download="{name}"]').click()
        return Path(taken.value.path()).read_bytes()

    def objects(self) -> list[str]:
        """What stands there, several things, as the page calls them."""
        self.types("reach the object")
        return re.split(" or ", re.search(r"Do you mean (.*)\?", self.shows("Do you mean"))[1])  # type: ignore[index]

    def clock(self) -> float:
        """Of real time, as the page tells."""
        return float(re.search(r"clock: ([\d.]+)", self.shows("clock:"))[1])  # type: ignore[index]


@contextmanager
def browsing() -> Iterator[Any]:
    """A browser without a screen."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE)
        yield browser
        browser.close()
