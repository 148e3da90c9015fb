"""The panel "What I see": a picture with what is recognised in it, and what it says where nothing can be seen."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed")

from core.errors import ConfigError
from demo import sight_panel
from demo.session import Session
from demo.session_config import make_config
from demo.sight_panel import SightPanel
from envs.perception import Detections, UnusablePicture
from envs.perception.detections import COLOR_NAMES, NOUN_NAMES


class Element(SimpleNamespace):
    """An element of a page, or a folder."""

    def on_update(self, function):
        self.updated = function

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass


class Gui:
    """Makes elements and keeps them by their names."""

    def __init__(self):
        self.elements = {}

    def _add(self, name, **values):
        self.elements[name] = Element(**values)
        return self.elements[name]

    def add_folder(self, label, expand_by_default):
        return self._add("folder", label=label, expand_by_default=expand_by_default)

    def add_checkbox(self, label, value):
        return self._add("on", label=label, value=value)

    def add_dropdown(self, label, options, initial_value):
        return self._add("camera", label=label, options=options, value=initial_value)

    def add_image(self, image, format, visible):
        return self._add("picture", image=image, visible=visible)

    def add_html(self, content):
        return self._add("text", content=content)


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


@pytest.fixture(scope="module")
def session():
    session = Session(make_config(driver="expert", task="nl_reach"), seed=3)
    yield session
    session.close()


def panel_of(session, load):
    gui = Gui()
    panel = SightPanel(SimpleNamespace(gui=gui), load)
    panel.show_env(session.env)
    return panel, gui.elements


def test_the_panel_is_folded_and_looks_only_when_it_is_asked_to(session):
    panel, elements = panel_of(session, lambda weights: Truth())
    assert elements["folder"].label == "What I see"
    assert not elements["folder"].expand_by_default
    panel.update(session)
    assert not elements["picture"].visible


def test_the_picture_of_the_chosen_camera_shows_what_is_recognised(session, monkeypatch):
    monkeypatch.setattr(sight_panel, "PERIOD", 1e6)  # seconds: the next look is due after the test
    truth = Truth()
    panel, elements = panel_of(session, lambda weights: truth)
    assert set(elements["camera"].options) >= {"front", "side", "top", "wrist"}
    elements["on"].value = True
    panel.update(session)
    assert truth.cameras == ["front", "side"]
    assert elements["picture"].visible
    assert elements["picture"].image.shape == (sight_panel.WIDTH, sight_panel.WIDTH, 3)
    assert "red cube" in elements["text"].content
    first = elements["picture"].image
    elements["camera"].value = "top"
    panel.update(session)
    assert elements["picture"].image is first  # the next look is not due yet
    elements["camera"].updated(None)
    panel.update(session)
    assert elements["picture"].image is not first
    elements["on"].value = False
    panel.update(session)
    assert not elements["picture"].visible


def test_what_hinders_seeing_is_said(session):
    def blind(views):
        raise UnusablePicture("the picture of camera front is black")

    panel, elements = panel_of(session, lambda weights: blind)
    elements["on"].value = True
    panel.update(session)
    assert "the picture of camera front is black" in elements["text"].content

    def missing(weights):
        raise ConfigError("there are no weights")

    panel, elements = panel_of(session, missing)
    elements["on"].value = True
    panel.update(session)
    assert "there are no weights" in elements["text"].content
    assert not elements["on"].value
