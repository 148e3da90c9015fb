"""Speech to words: a recogniser that expects what can be said in a scene (`language/speech_grammar.py`).

It is PocketSphinx with its own model of English, which runs offline: `pip install -e ".[speech]"`.
"""

from __future__ import annotations

import wave
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.errors import ConfigError
from core.system import import_optional
from language.errors import LanguageError
from language.sentence_graph import SentenceGraph, sentence_graph

RATE = 16_000  # samples a second, of 16 bits each
LEAST, MOST = 0.2, 15.0  # seconds of a spoken sentence
PADDING = 0.3  # seconds of silence before and after it, which the recogniser expects
QUIET = 150  # samples below this are silence; 32767 is the loudest
NOTHING = "Nothing was heard: speak nearer to the microphone, or louder."
PRONUNCIATIONS = {  # of words that the recogniser's dictionary lacks
    "leftmost": "L EH F T M OW S T",
    "rightmost": "R AY T M OW S T",
    "topmost": "T AA P M OW S T",
    "unstack": "AH N S T AE K",
}

SELDOM = {"that": 0.02, "this": 0.1, "it": 0.5}  # how often words are said that sound like "the", of what may follow

Sound = NDArray[np.int16]


class Recogniser:
    """Hears sentences. It takes half a second to make, and a twentieth of a sound's length to hear it.

    Raises ConfigError where PocketSphinx is not installed.
    """

    def __init__(self) -> None:
        (pocketsphinx,) = import_optional("pocketsphinx", extra="speech", what="spoken sentences")
        self._decoder: Any = pocketsphinx.Decoder(pocketsphinx.Config(lm=None, cmn="batch", loglevel="FATAL"))
        for word, sounds in PRONUNCIATIONS.items():
            self._decoder.add_word(word, sounds, False)
        self._expected = ""

    def knows(self, word: str) -> bool:
        """Return whether a word has a pronunciation."""
        return self._decoder.lookup_word(word) is not None

    def hear(self, sound: Sound, grammar: str) -> str:
        """Return the words of a sound. A sound that fits badly may end within a sentence.

        Args:
            sound: (samples,) at RATE.
            grammar: JSGF of what can be said. Words without a pronunciation cannot be heard.

        Raises:
            LanguageError: there are none, or the sound is too short or too long.
        """
        checked(sound)
        self._expect(grammar)
        silence = np.zeros(round(PADDING * RATE), np.int16)
        self._decoder.start_utt()
        self._decoder.process_raw(np.concatenate((silence, sound, silence)).tobytes(), full_utt=True)
        self._decoder.end_utt()
        found = self._decoder.hyp()
        if found is None or not found.hypstr:
            raise LanguageError("The words were not understood: say it again, or type it.")
        return str(found.hypstr)

    def _expect(self, grammar: str) -> None:
        if grammar == self._expected:
            return
        graph = _graph(grammar)
        last = len(graph.arcs)
        arcs: list[tuple[Any, ...]] = [(end, last, 1.0) for end in graph.ends]
        for state, row in enumerate(graph.arcs):
            shares = {word: SELDOM.get(word, 1.0) for word in row if self.knows(word)}
            total = sum(shares.values())
            arcs += [(state, row[word], share / total, word) for word, share in shares.items()]
        self._decoder.add_fsg("scene", self._decoder.create_fsg("scene", 0, last, arcs))
        self._decoder.activate_search("scene")
        self._expected = grammar


@lru_cache(maxsize=32)
def _graph(grammar: str) -> SentenceGraph:
    return sentence_graph(grammar)


def checked(sound: Sound) -> Sound:
    """Return the sound. Raises LanguageError if it cannot be a spoken sentence."""
    seconds = len(sound) / RATE
    if seconds < LEAST:
        raise LanguageError("That was too short: hold the button while you speak.")
    if seconds > MOST:
        raise LanguageError(f"That was too long: {seconds:.0f} seconds; a spoken sentence has at most {MOST:.0f}.")
    if np.abs(sound.astype(np.int32)).max() < QUIET:
        raise LanguageError(NOTHING)
    return sound


def samples(content: bytes, rate: int) -> Sound:
    """Return the samples of 16-bit sound as it is sent. Raises LanguageError for another rate, or half a sample."""
    if rate != RATE:
        raise LanguageError(f"The sound has {rate} samples a second; {RATE} are heard.")
    if len(content) % 2:
        raise LanguageError("The sound is damaged: it ends within a sample.")
    return np.frombuffer(content, dtype="<i2").astype(np.int16)


def read_sound(path: Path) -> Sound:
    """Return the sound of a WAV file with one channel of 16 bits at RATE. Raises LanguageError for another one."""
    try:
        with wave.open(str(path), "rb") as file:
            form = file.getnchannels(), 8 * file.getsampwidth(), file.getframerate()
            content = file.readframes(min(file.getnframes(), round((MOST + 1) * RATE)))
    except OSError as error:
        raise LanguageError(f"{path} cannot be read: {error.strerror}") from None
    except (wave.Error, EOFError) as error:
        raise LanguageError(f"{path} is no WAV file: {error or 'it is empty'}") from None
    if form != (1, 16, RATE):
        raise LanguageError(
            f"{path} has {form[0]} channels of {form[1]} bits at {form[2]} Hz: it must have 1 of 16 bits at {RATE} Hz"
        )
    return samples(content, RATE)


@lru_cache(maxsize=1)
def _own() -> Recogniser:
    """Return the recogniser of this process."""
    return Recogniser()


def heard(content: bytes, rate: int, grammar: str) -> tuple[str, str]:
    """Return the words of a sound and "", or "" and the reason why there are none. For a process that only hears."""
    try:
        return _own().hear(samples(content, rate), grammar), ""
    except (LanguageError, ConfigError) as error:
        return "", str(error)
