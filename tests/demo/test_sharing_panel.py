"""The page without a browser: a prepared scene, its link, and what happens where the link is opened."""

import json
import threading
import time
from contextlib import closing, redirect_stdout
from io import StringIO

import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed")

import viser

from demo.guarded_server import PageParts
from demo.page import Page
from demo.session import Session
from demo.session_config import make_config
from demo.shared_scene import DAMAGED
from demo.tab_messages import Click, OpenScene, Say
from tools.browser import free_port

pytestmark = pytest.mark.slow
TIMEOUT = 120  # seconds


class FakeTab:
    """A tab whose sections are kept."""

    number = "ab"

    def __init__(self):
        self.shown = {}

    def send(self, name, value):
        self.shown[name] = value


class RunningPage:
    """A page whose loop runs in a thread."""

    def __init__(self, session):
        with redirect_stdout(StringIO()):  # viser prints addresses
            self._server = viser.ViserServer("127.0.0.1", int(free_port()), verbose=False)
        self.parts, self.tab = PageParts(), FakeTab()
        self._loop = Page(self._server, session, self.parts).loop
        self._thread = threading.Thread(target=self._loop.run)
        self._thread.start()

    def send(self, message):
        self.parts.state.handle(self.tab, message)

    def section(self, name):
        return json.loads(self.parts.state.sections.get(name, b"null"))

    def wait_for(self, condition):
        """What a condition returns, once it is true."""
        end = time.monotonic() + TIMEOUT
        while time.monotonic() < end:
            if found := condition():
                return found
            time.sleep(0.05)
        raise AssertionError(self.entries())

    def entries(self):
        """What was said, the text and the result of each turn."""
        found = [
            json.loads(value) for name, value in list(self.parts.state.sections.items()) if name.startswith("entry ")
        ]
        return [("".join(part[0] for part in each["said"]), each["text"], each["result"]) for each in found]

    def close(self):
        self._loop.stop()
        self._thread.join()
        with redirect_stdout(StringIO()):
            self._server.stop()


def test_a_link_brings_back_the_scene_and_what_was_said():
    with (
        closing(Session(make_config(driver="expert", task="nl_reach"), 3)) as session,
        closing(RunningPage(session)) as page,
    ):
        page.send(OpenScene(text="point"))
        page.wait_for(lambda: (page.section("sayable") or [""])[0] == "reach this")
        assert page.section("choice")["shown"]["scene"] == "point"
        page.wait_for(lambda: page.section("lab")["pointing"])
        page.send(Say(text="reach this"))
        page.wait_for(lambda: page.entries()[-1][2].startswith("Done"))
        places = session.scene().positions
        page.send(Click(button="link"))
        code = page.wait_for(lambda: page.tab.shown.get("link"))
        page.send(Click(button="shuffle"))
        page.wait_for(lambda: "new scene" in page.entries()[-1][1])
        assert page.section("choice")["shown"]["scene"] == ""

        page.send(OpenScene(text=code))
        page.wait_for(lambda: "scene of a link" in page.entries()[-1][1])
        page.wait_for(lambda: page.entries()[-1][0] == "reach this" and page.entries()[-1][2].startswith("Done"))
        assert np.allclose(session.scene().positions, places, atol=0.002)

        page.send(OpenScene(text=code[:-7]))
        page.wait_for(lambda: page.entries()[-1][1] == DAMAGED)
        assert np.allclose(session.scene().positions, places, atol=0.002)
