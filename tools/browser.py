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
from importlib.util import find_spec
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
SOFTWARE_RENDERING = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
TIMEOUT = 120  # seconds: drawn in software, on a shared core
SIZE, WIDE = (1280, 800), (1040, 640)  # pixels of a tab, (width, height)
LOW_RESOLUTION = 0.25  # device scale factor that software rendering can draw in time
BLANK = """for (const context of [WebGLRenderingContext, WebGL2RenderingContext])
  for (const name in context.prototype) if (name.startsWith("draw")) {
    const kind = Object.getOwnPropertyDescriptor(context.prototype, name);
    if (kind && typeof kind.value == "function") context.prototype[name] = () => {};
  }"""
LATEST_ENTRY = "() => [...document.querySelectorAll('.entry')].at(-1)"
NEXT_ENTRY = "old => old ? old.nextElementSibling : document.querySelector('.entry')"  # of those that are kept
PAUSE = "() => new Promise(done => setTimeout(done, 100))"  # milliseconds


def free_port() -> str:
    """Return a port of the loopback interface that no program listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return str(probe.getsockname()[1])


class PlayServer:
    """A process of `play.py` with these arguments in `folder`. address: the first URL that it prints.

    threads: OMP_NUM_THREADS; None: as it is. Exits with the last line of its errors if it does not start.
    """

    def __init__(self, *arguments: str, folder: Path = ROOT, threads: int | None = None) -> None:
        command = [sys.executable, str(ROOT / "play.py"), "--port", free_port(), *arguments]
        environment = os.environ | {"PYTHONWARNINGS": "ignore"}
        environment |= {} if threads is None else {"OMP_NUM_THREADS": str(threads)}
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
        viewport = {"width": size[0], "height": size[1]}
        self.tab = browser.new_page(
            viewport=viewport, device_scale_factor=scale, bypass_csp=True
        )  # to wait in the page
        self.tab.set_default_timeout(1000 * TIMEOUT)
        if blank:
            self.tab.add_init_script(BLANK)
        self.tab.goto(url)
        self.wait_until_ready()

    def wait_until_ready(self) -> None:
        """Wait until the robot has been loaded, and the scene is there."""
        self.tab.locator("body[data-ready]").wait_for()
        self.tab.frame_locator("#scene").locator("canvas").first.wait_for()

    def type_sentence(self, sentence: str) -> None:
        """Type without Enter."""
        self.tab.fill("#say", sentence)

    def say(self, sentence: str) -> None:
        """Type a sentence and press Enter."""
        self.type_sentence(sentence)
        self.tab.press("#say", "Enter")

    def say_and_wait(self, sentence: str) -> str:
        """Say a sentence, wait until it has ended, and return "Done" or "Not done: ..."."""
        latest = self.tab.evaluate_handle(LATEST_ENTRY)
        self.say(sentence)
        entry = self.tab.wait_for_function(NEXT_ENTRY, arg=latest)
        result = self.tab.wait_for_function("entry => entry.querySelector('.result').textContent", arg=entry)
        return re.sub(" in [0-9.]+ s.$", "", result.json_value())

    def wait_for_text(self, pattern: str) -> str:
        """Wait until the page contains this pattern; return the text of the element that does."""
        found = self.tab.get_by_text(re.compile(pattern)).last
        found.wait_for()
        return found.inner_text()

    def wait_for_turn(self, pattern: str) -> str:
        """Wait until the latest turn of the conversation contains this pattern; return its text."""
        turn = self.tab.locator(".entry").last.filter(has_text=re.compile(pattern))
        turn.wait_for()
        return turn.inner_text()

    def press(self, button: str) -> None:
        """Press the button with this name."""
        self.tab.get_by_role("button", name=button, exact=True).first.click()

    def open_lab(self, folder: str | None = None) -> None:
        """Open the Lab, and a folder of it."""
        if self.tab.locator("#lab").is_hidden():
            self.press("Lab")
        if folder is not None:
            self.tab.locator("#lab details", has=self.tab.get_by_text(folder, exact=True)).evaluate(
                "e => e.open = true"
            )

    def choose(self, label: str, option: str) -> None:
        """Choose an option of a drop-down list of the bar."""
        self.tab.locator(".bar").get_by_label(label).select_option(option)

    def download(self, button: str) -> bytes:
        """Press a button, and return the file that the page sends."""
        with self.tab.expect_download() as download:
            self.press(button)
        return Path(download.value.path()).read_bytes()

    def object_names(self) -> list[str]:
        """Return the names of the scene's objects, where it is a table to reach for things."""
        chips = self.tab.locator("#chips .chip")
        chips.first.wait_for()
        return [text.removeprefix("reach ") for text in chips.all_inner_texts()]

    def clock(self) -> float:
        """Return the speed of the session's clock, as a share of real time, as the page shows it."""
        text = self.tab.locator("#lab").get_by_text(re.compile("^clock: ")).text_content()
        return float(re.search(r"clock: ([\d.]+)", text)[1])  # type: ignore[index]


@contextmanager
def headless_browser(*switches: str) -> Iterator[Any]:
    """Yield a Chromium without a window. Exits with one line where there is none."""
    if CHROMIUM is None or find_spec("playwright") is None:
        sys.exit('error: this requires Chromium, and pip install -e ".[test]"')
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=[*SOFTWARE_RENDERING, *switches])
        yield browser
        browser.close()
