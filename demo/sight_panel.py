"""The part of the page that shows a camera's picture with what is recognised in it."""

from __future__ import annotations

import base64
import io
import time
from collections.abc import Callable, Sequence

from PIL import Image

from core.errors import ConfigError
from demo.session import Session
from demo.shared_state import SharedState
from envs.interactive.interactive_env import InteractiveEnv
from envs.perception import Detector, UnusablePicture
from envs.perception.detections import check_picture

PERIOD = 1.0  # seconds between two looks: one takes about as long as a control step
WIDTH = 384  # pixels of the picture on the page
QUALITY = 80  # of the JPEG
PAIR = ("front", "side")  # cameras that look together where the simulator tells the policy where things are


class SightPanel:
    """A picture of one of the workspace's cameras, with what all cameras that look see together.

    With perception=camera these are the cameras that the policy's objects come from, and it looks from the start.

    looks: whether it looks. camera: whose picture is shown.

    Args:
        state: of the page; `sight` is what is shown.
        load: returns the detector for a file of weights, or the project's for None. Raises ConfigError.
    """

    def __init__(self, state: SharedState, load: Callable[[str | None], Detector]) -> None:
        self._state, self._load = state, load
        self._detector: Detector | None = None
        self._due = 0.0  # of the clock that never goes back
        self._cameras: tuple[str, ...] = ()
        self.looks, self.camera = False, ""

    def show_env(self, env: InteractiveEnv) -> None:
        """Offer the cameras of a new environment."""
        self._cameras = tuple(env.config.workspace.cameras)
        chosen = (name for name in env.config.perception.cameras if name in self._cameras)
        self.camera = next(chosen, self._cameras[0])
        self.looks = env.config.perception.sees
        self._detector, self._due = None, 0.0
        self._put()

    def choose(self, camera: str) -> None:
        """Show the picture of another camera, from the next look on, which is at once. Unknown names are ignored."""
        if camera in self._cameras:
            self.camera, self._due = camera, 0.0
            self._put()

    def look(self, looks: bool) -> None:
        """Look from now on, or no longer."""
        self.looks, self._due = looks, 0.0
        self._put()

    def update(self, session: Session) -> None:
        """Look, if it is time. To be called after each control step."""
        if not self.looks or time.monotonic() < self._due:
            return
        self._due = time.monotonic() + PERIOD
        try:
            self._look(session.env)
        except UnusablePicture as error:
            self._put(str(error))
        except ConfigError as error:
            self.looks = False
            self._put(str(error))

    def _put(self, note: str = "", picture: str = "", lines: Sequence[str] = (), looking: Sequence[str] = ()) -> None:
        shown = {"picture": picture, "lines": lines, "looking": looking, "note": note}
        self._state.put("sight", {"looks": self.looks, "camera": self.camera, "cameras": self._cameras, **shown})

    def _look(self, env: InteractiveEnv) -> None:
        from envs.perception.drawing import drawn, seen_things

        shown = self.camera
        looking = env.config.perception.cameras or [n for n in PAIR if n in env.config.workspace.cameras] or [shown]
        if self._detector is None:
            self._detector = self._load(env.config.perception.weights)
        views = env.views(dict.fromkeys([*looking, shown]))
        for name in looking:
            check_picture(name, views[name])
        found = self._detector({name: views[name] for name in looking})
        file = io.BytesIO()
        Image.fromarray(drawn(views[shown], found, WIDTH)).save(file, "jpeg", quality=QUALITY)
        picture = "data:image/jpeg;base64," + base64.b64encode(file.getvalue()).decode()
        self._put(picture=picture, lines=[thing.line for thing in seen_things(found)], looking=looking)


def load_network(weights: str | None) -> Detector:
    """Return the project's detector. Raises ConfigError."""
    from envs.perception.detector import load_detector  # slow to import

    detector: Detector = load_detector(weights)
    return detector
