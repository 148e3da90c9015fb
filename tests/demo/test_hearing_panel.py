"""Sounds of tabs become words, beside the simulation."""

from __future__ import annotations

import base64
import json
import time
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("msgspec", reason="the extra `play` is not installed")

from demo import hearing_panel
from demo.hearing_panel import HearingPanel
from demo.shared_state import SharedState
from demo.tab_messages import MAX_SOUND, Hear, TabCheck
from language import Object, Scene
from language.hearing import RATE
from language.speech_grammar import speech_grammar

SCENE = Scene([Object("cube", "red", (0.5, 0.1, 0.0)), Object("sphere", "blue", (0.4, 0.0, 0.0))])
TASK = SimpleNamespace(verbs=("reach",), verb="reach")
SESSION = SimpleNamespace(env=SimpleNamespace(task=TASK, has_person=False), scene=lambda: SCENE)


class Listener:
    """A tab that keeps what it is sent."""

    def __init__(self):
        self.sent = []

    def send(self, name, value):
        self.sent.append((name, value))

    def wait(self):
        end = time.monotonic() + 60
        while not self.sent and time.monotonic() < end:
            time.sleep(0.02)
        return self.sent.pop(0)


@pytest.fixture
def panel():
    state = SharedState()
    panel = HearingPanel(state)
    yield panel
    panel.close()


def message(pcm, rate=RATE):
    return json.dumps({"do": "hear", "pcm": base64.b64encode(pcm).decode(), "rate": rate})


def test_a_sound_passes_the_check_of_messages_and_no_longer_one():
    check = TabCheck()
    assert check.read(message(b"\1\2")) == Hear(pcm=b"\1\2", rate=RATE)
    assert check.read(message(bytes(MAX_SOUND + 2))) is None
    assert check.read(message(b"", 0)) is None
    assert check.read('{"do": "hear", "pcm": "no base64", "rate": 16000}') is None
    assert check.read('{"do": "hear", "pcm": "AAAA", "rate": "fast"}') is None


@pytest.mark.parametrize(
    ("pcm", "rate", "note"),
    [
        (b"", RATE, "too short"),
        (bytes(2 * RATE), RATE, "Nothing was heard"),
        (np.full(16 * RATE, 3000, np.int16).tobytes(), RATE, "too long"),
        (np.full(RATE, 3000, np.int16).tobytes(), 44_100, "44100 samples a second"),
        (b"\0" * 9999, RATE, "ends within a sample"),
    ],
)
def test_a_sound_that_is_no_sentence_is_answered_in_one_sentence(panel, monkeypatch, pcm, rate, note):
    panel._installed = True
    tab = Listener()
    panel.take(SESSION, tab, pcm, rate)
    name, value = tab.wait()
    assert name == "heard"
    assert note in value["note"]
    assert value["words"] == ""


def test_without_the_extra_the_page_says_what_to_install(monkeypatch):
    monkeypatch.setattr(hearing_panel, "find_spec", lambda name: None)
    state, tab = SharedState(), Listener()
    panel = HearingPanel(state)
    assert not json.loads(state.sections["speech"])["installed"]
    panel.take(SESSION, tab, bytes(2 * RATE), RATE)
    assert 'pip install -e ".[speech]"' in tab.wait()[1]["note"]


def test_words_are_heard_in_a_process_of_their_own(panel):
    pytest.importorskip("pocketsphinx", reason="the extra `speech` is not installed")
    pytest.importorskip("espeakng_loader", reason="espeak-ng, of the extra `test`, is not installed")
    from language.voices import espeak

    tab = Listener()
    panel.take(SESSION, tab, espeak("en-us+f2")("reach the red cube").tobytes(), RATE)
    assert tab.wait() == ("heard", {"words": "reach the red cube", "note": ""})


def test_a_person_who_does_not_point_says_no_this():
    assert "this" not in speech_grammar(SCENE, ("reach",), points=False)
