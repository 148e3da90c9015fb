"""Spoken sentences. The voices are synthesised."""

from __future__ import annotations

import sys
import wave

import numpy as np
import pytest

from core.errors import ConfigError
from language import COLORS, NOUNS, LanguageError, Object, Scene
from language.cli import main
from language.hearing import RATE, Recogniser, checked, read_sound, samples
from language.speech_grammar import speech_grammar, spoken_words

SCENE_FILE = """\
- {id: a, noun: cube, color: red, position: [0.5, 0.1, 0.0]}
- {id: b, noun: sphere, color: blue, position: [0.4, 0.0, 0.0]}
"""
SCENE = Scene([Object("cube", "red", (0.5, 0.1, 0.0)), Object("sphere", "blue", (0.4, 0.0, 0.0))])
VOICED = np.full(RATE, 3000, np.int16)


@pytest.fixture(scope="module")
def recogniser():
    pytest.importorskip("pocketsphinx", reason="the extra `speech` is not installed")
    return Recogniser()


@pytest.fixture(scope="module")
def voice():
    pytest.importorskip("espeakng_loader", reason="espeak-ng, of the extra `test`, is not installed")
    from language.voices import espeak

    return espeak("en-us+f2")


def write(path, sound, rate=RATE, channels=1):
    with wave.open(str(path), "wb") as file:
        file.setnchannels(channels)
        file.setsampwidth(2)
        file.setframerate(rate)
        file.writeframes(sound.tobytes())
    return path


def test_every_word_of_the_grammar_has_a_pronunciation(recogniser):
    everything = Scene(
        [
            *(Object(noun, "red", (0.4, 0.0, 0.0), 0.04) for noun in NOUNS),
            *(Object("cube", color, (0.4, 0.0, 0.0), 0.06) for color in COLORS),
        ]
    )
    targets = Scene([*everything, Object("cube", "red", (0.5, 0.0, 0.0), role="target")])
    assert not [word for word in spoken_words(speech_grammar(targets)) if not recogniser.knows(word)]


@pytest.mark.parametrize("said", ["reach the red cube", "pick up the blue ball", "undo"])
def test_a_spoken_sentence_is_heard(recogniser, voice, said):
    assert recogniser.hear(voice(said), speech_grammar(SCENE, points=False)) == said


def test_what_is_heard_follows_the_scene(recogniser, voice):
    sound = voice("reach the red cube")
    other = Scene([Object("cylinder", "gray", (0.4, 0.0, 0.0)), Object("sphere", "blue", (0.5, 0.0, 0.0))])
    assert recogniser.hear(sound, speech_grammar(SCENE, points=False)) == "reach the red cube"
    assert "red" not in recogniser.hear(sound, speech_grammar(other, points=False))


@pytest.mark.parametrize(
    ("sound", "message"),
    [
        (np.zeros(0, np.int16), "too short"),
        (VOICED[: RATE // 10], "too short"),
        (np.tile(VOICED, 16), "too long: 16 seconds"),
        (np.zeros(RATE, np.int16), "Nothing was heard"),
    ],
)
def test_a_sound_that_is_no_sentence_is_refused_in_one_sentence(sound, message):
    with pytest.raises(LanguageError, match=message) as error:
        checked(sound)
    assert "\n" not in str(error.value)


def test_sounds_of_another_form_are_refused(tmp_path):
    with pytest.raises(LanguageError, match="8000 samples a second; 16000 are heard"):
        samples(b"\0\0", 8000)
    with pytest.raises(LanguageError, match="ends within a sample"):
        samples(b"\0", RATE)
    with pytest.raises(LanguageError, match="2 channels of 16 bits at 44100 Hz"):
        read_sound(write(tmp_path / "a.wav", VOICED, 44_100, 2))
    (tmp_path / "b.wav").write_bytes(b"RIFF")
    with pytest.raises(LanguageError, match=r"b\.wav is no WAV file"):
        read_sound(tmp_path / "b.wav")
    with pytest.raises(LanguageError, match=r"none\.wav cannot be read"):
        read_sound(tmp_path / "none.wav")


def test_the_command_line_prints_what_is_heard(recogniser, voice, tmp_path, capsys):
    scene = tmp_path / "scene.yaml"
    scene.write_text(SCENE_FILE)
    path = write(tmp_path / "said.wav", voice("reach the red cube"))
    assert main(["hear", str(path), "--scene", str(scene)]) == 0
    assert capsys.readouterr().out.strip() == "reach the red cube"
    assert main(["hear", str(write(tmp_path / "still.wav", 0 * VOICED)), "--scene", str(scene)]) == 2
    assert "Nothing was heard" in capsys.readouterr().err


def test_without_the_extra_one_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pocketsphinx", None)
    with pytest.raises(ConfigError, match=r'pip install -e "\.\[speech\]"'):
        Recogniser()
