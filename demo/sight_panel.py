"""The part of the page that shows a camera's picture with what is recognised in it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from core.errors import ConfigError
from demo import html
from demo.session import Session
from envs.interactive.interactive_env import InteractiveEnv
from envs.perception import Detector, UnusablePicture
from envs.perception.detections import check_picture

PERIOD = 1.0  # seconds between two looks: one takes about as long as a control step
WIDTH = 384  # pixels of the picture on the page
PAIR = ("front", "side")  # cameras that look together where the simulator tells the policy where things are
NOTHING = "no camera"
OFF = "Tick the box to look."


class SightPanel:
    """A picture of one of the workspace's cameras, with what all cameras that look see together.

    With perception=camera these are the cameras that the policy's objects come from, and it looks from the start.

    Args:
        server: of the page.
        load: returns the detector for a file of weights, or the project's for None. Raises ConfigError.
    """

    def __init__(self, server: viser.ViserServer, load: Callable[[str | None], Detector]) -> None:
        self._load = load
        self._detector: Detector | None = None
        self._due = 0.0  # of the clock that never goes back
        gui: Any = server.gui
        with gui.add_folder("What I see", expand_by_default=False):
            self._on = gui.add_checkbox("Look once a second", False)
            self._camera = gui.add_dropdown("Camera", (NOTHING,), initial_value=NOTHING)
            self._picture = gui.add_image(np.zeros((16, WIDTH, 3), np.uint8), format="jpeg", visible=False)
            self._text = gui.add_html(html.hint(OFF))
        self._camera.on_update(lambda _: setattr(self, "_due", 0.0))

    def show_env(self, env: InteractiveEnv) -> None:
        """Offer the cameras of a new environment."""
        names = tuple(env.config.workspace.cameras)
        chosen = next((name for name in env.config.perception.cameras if name in names), names[0])
        self._camera.options = names
        self._camera.value = chosen
        self._on.value = env.config.perception.sees
        self._detector, self._due = None, 0.0

    def update(self, session: Session) -> None:
        """Look, if it is time. To be called after each control step."""
        if not self._on.value:
            if self._picture.visible:
                self._picture.visible = False
                self._text.content = html.hint(OFF)
            return
        if time.monotonic() < self._due:
            return
        self._due = time.monotonic() + PERIOD
        try:
            self._look(session.env)
        except UnusablePicture as error:
            self._text.content = html.message(str(error))
        except ConfigError as error:
            self._on.value = False
            self._text.content = html.message(str(error))

    def _look(self, env: InteractiveEnv) -> None:
        from envs.perception.drawing import drawn, seen_things

        shown = self._camera.value
        looking = env.config.perception.cameras or [n for n in PAIR if n in env.config.workspace.cameras] or [shown]
        if self._detector is None:
            self._detector = self._load(env.config.perception.weights)
        views = env.views(dict.fromkeys([*looking, shown]))
        for name in looking:
            check_picture(name, views[name])
        found = self._detector({name: views[name] for name in looking})
        self._picture.image = drawn(views[shown], found, WIDTH)
        self._picture.visible = True
        self._text.content = html.seen([thing.line for thing in seen_things(found)], looking)


def load_network(weights: str | None) -> Detector:
    """Return the project's detector. Raises ConfigError."""
    from envs.perception.detector import load_detector  # slow to import

    detector: Detector = load_detector(weights)
    return detector
