"""The panel "What I see": a picture with what is recognised in it, and what it says where nothing can be seen."""

import base64
import io
import json

import numpy as np
import pytest

pytest.importorskip("websockets", reason="websockets is not installed")
from PIL import Image

from core.errors import ConfigError
from demo import sight_panel
from demo.shared_state import SharedState
from demo.sight_panel import SightPanel
from envs.perception import Detections, UnusablePicture
from envs.perception.detections import COLOR_NAMES, NOUN_NAMES
from tests.helpers.sessions import session_fixture


class Truth:
    """A detector that sees one red cube, where there is one."""

    def __call__(self, views):
        self.cameras = list(views)
        nouns, colors = np.eye(len(NOUN_NAMES))[:1] * 0, np.eye(len(COLOR_NAMES))[:1] * 0
        nouns[0, NOUN_NAMES.index("cube")], colors[0, COLOR_NAMES.index("red")] = 1, 1
        return Detections(
            positions=np.array([[0.44, 0.0, 0.025]]),
            covariances=1e-6 * np.eye(3)[None],
            nouns=nouns,
            colors=colors,
            sizes=np.array([0.05]),
            yaws=np.zeros(1),
            shares=np.zeros(1),
            targets=np.zeros(1),
            presence=np.ones(1),
        )


session = session_fixture(driver="expert", task="nl_reach")


def panel_of(session, load):
    state = SharedState()
    panel = SightPanel(state, load)
    panel.show_env(session.env)
    return panel, lambda: json.loads(state.sections["sight"])


def test_the_panel_looks_only_when_it_is_asked_to(session):
    panel, shown = panel_of(session, lambda weights: Truth())
    panel.update(session)
    assert not shown()["looks"]
    assert not shown()["picture"]


def test_the_picture_of_the_chosen_camera_shows_what_is_recognised(session, monkeypatch):
    monkeypatch.setattr(sight_panel, "PERIOD", 1e6)  # seconds: the next look is due after the test
    truth = Truth()
    panel, shown = panel_of(session, lambda weights: truth)
    assert set(shown()["cameras"]) >= {"front", "side", "top", "wrist"}
    panel.look(True)
    panel.update(session)
    assert truth.cameras == shown()["looking"] == ["front", "side"]
    first = shown()["picture"]
    picture = Image.open(io.BytesIO(base64.b64decode(first.removeprefix("data:image/jpeg;base64,"))))
    assert picture.size == (sight_panel.WIDTH, sight_panel.WIDTH)
    assert "red cube" in " ".join(shown()["lines"])
    panel.update(session)
    assert shown()["picture"] == first  # the next look is not due yet
    panel.choose("top")
    panel.choose("nothing")
    panel.update(session)
    assert shown()["camera"] == "top"
    assert shown()["picture"] not in ("", first)
    panel.look(False)
    panel.update(session)
    assert not shown()["picture"]


def test_what_hinders_seeing_is_said(session):
    def blind(views):
        raise UnusablePicture("the picture of camera front is black")

    panel, shown = panel_of(session, lambda weights: blind)
    panel.look(True)
    panel.update(session)
    assert "the picture of camera front is black" in shown()["note"]

    def missing(weights):
        raise ConfigError("there are no weights")

    panel, shown = panel_of(session, missing)
    panel.look(True)
    panel.update(session)
    assert "there are no weights" in shown()["note"]
    assert not shown()["looks"]
