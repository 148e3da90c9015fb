"""play.py served on a free port, and its page in a tab of the system's Chromium (by Playwright)."""

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
SOFTWARE_RENDERING = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
TIMEOUT = 120  # seconds: drawn in software, on a shared core
SIZE, WIDE = (900, 800), (1040, 640)  # pixels of a tab, (width, height)
LOW_RESOLUTION = 0.25  # device scale factor that software rendering can draw in time
BLANK = """for (const context of [WebGLRenderingContext, WebGL2RenderingContext])
  for (const name in context.prototype) if (name.startsWith("draw")) {
    const kind = Object.getOwnPropertyDescriptor(context.prototype, name);
    if (kind && typeof kind.value == "function") context.prototype[name] = () => {};
  }"""
PAUSE = "() => new Promise(done => setTimeout(done, 100))"  # milliseconds


def free_port() -> str:
    """Return a port of the loopback interface that no program listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return str(probe.getsockname()[1])


class PlayServer:
    """A process of `play.py` with these arguments in `folder`. address: the URL of its page.

    Exits with the last line of its errors if it does not start.
    """

    def __init__(self, *arguments: str, folder: Path = ROOT) -> None:
        command = [sys.executable, str(ROOT / "play.py"), "--port", free_port(), *arguments]
        environment = os.environ | {"PYTHONWARNINGS": "ignore"}
        self._errors = tempfile.TemporaryFile("w+")  # noqa: SIM115  a pipe that is not read would fill up
        pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": self._errors, "text": True}
        self.process = subprocess.Popen(command, cwd=folder, env=environment, **pipes)
        atexit.register(self.process.kill)
        assert self.process.stdout is not None
        self.address = next((line.split()[0] for line in self.process.stdout if line.startswith("http")), "")
        if not self.address:
            sys.exit(self._read_errors().strip().splitlines()[-1])

    def megabytes(self) -> float:
        """Return resident memory of the process."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.search(r"VmRSS:\s+(\d+)", status)[1]) / 1024  # type: ignore[index]

    def close(self) -> str:
        """Interrupt the process; return what it wrote to stderr; its exit code is `process.returncode`."""
        self.process.send_signal(signal.SIGINT)
        return self._read_errors()

    def _read_errors(self) -> str:
        self.process.wait(TIMEOUT)
        self._errors.seek(0)
        return self._errors.read()


class PageTab:
    """The page of `play.py` in a tab of a Playwright browser.

    sharp: full resolution, for pictures. blank: the scene is not drawn, which takes most of the time in software.
    """

    def __init__(self, browser: Any, address: str, sharp: bool = False, blank: bool = False) -> None:
        scale, size, url = (1, WIDE, f"{address}&fixedDpr=1") if sharp else (LOW_RESOLUTION, SIZE, address)
        self.tab = browser.new_page(viewport={"width": size[0], "height": size[1]}, device_scale_factor=scale)
        self.tab.set_default_timeout(1000 * TIMEOUT)
        if blank:
            self.tab.add_init_script(BLANK)
        self.tab.goto(url)
        self.field("Say").wait_for()
        self.wait_for_text("clock:")

    def field(self, label: str) -> Any:
        """Return the input element after a label."""
        return self.tab.locator(f'xpath=//*[normalize-space(text())="{label}"]/following::input[1]')

    def type_sentence(self, sentence: str) -> None:
        """Type with pauses: viser's page loses one of typing and Enter if they come within 50 ms."""
        self.tab.evaluate(PAUSE)
        self.field("Say").fill(sentence)
        self.tab.evaluate(PAUSE)

    def say(self, sentence: str) -> None:
        """Type a sentence and presses Enter."""
        self.type_sentence(sentence)
        self.field("Say").press("Enter")

    def say_and_wait(self, sentence: str) -> str:
        """Say a sentence, wait until it has ended, and return "Done in" or "Not done: ...".

        Presses Stop first, to clear the status of the sentence before.
        """
        self.press("Stop")
        self.wait_for_text("Stopped")
        self.say(sentence)
        return re.search("Done in|Not done: .*", self.wait_for_text("Done in|Not done"))[0]  # type: ignore[index]

    def wait_for_text(self, pattern: str) -> str:
        """Wait until the page contains this pattern; return the text of the element that does."""
        found = self.tab.get_by_text(re.compile(pattern)).first
        found.wait_for()
        return found.inner_text()

    def press(self, button: str) -> None:
        """Click the button with this text, after a pause: a click can be lost that comes within 50 ms of another."""
        self.tab.evaluate(PAUSE)
        self.tab.get_by_text(button, exact=True).first.click()

    def choose(self, label: str, option: str) -> None:
        """Choose an option of the drop-down list after a label."""
        self.field(label).click()
        self.tab.get_by_role("option", name=option, exact=True).click()

    def download(self, name: str) -> bytes:
        """Return the file of this name that the page offers."""
        with self.tab.expect_download() as download:
            self.tab.locator(f'a[download="{name}"]').click()
        return Path(download.value.path()).read_bytes()

    def object_names(self) -> list[str]:
        """Return the names of the scene's objects (two or three), which the page asks after an ambiguous sentence."""
        self.type_sentence("reach the object")
        question = re.search(r"Do you mean (.*), or something else\?", self.wait_for_text("Do you mean"))
        return question[1].split(", ")  # type: ignore[index]

    def clock(self) -> float:
        """Return the speed of the session's clock, as a share of real time, as the page shows it."""
        return float(re.search(r"clock: ([\d.]+)", self.wait_for_text("clock:"))[1])  # type: ignore[index]


@contextmanager
def headless_browser(*switches: str) -> Iterator[Any]:
    """Yield a Chromium without a window."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=[*SOFTWARE_RENDERING, *switches])
        yield browser
        browser.close()
