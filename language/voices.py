"""Synthesised speech: voices of the engines espeak-ng and Pico, whose packages hold them.

pip install -e ".[test]"   # espeak-ng
pip install ttspico        # Pico; it is compiled
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.errors import ConfigError
from core.system import import_optional
from language.hearing import RATE, Sound

ESPEAK_RATE = 22_050
RETRIEVAL, UTF8, WORDS_A_MINUTE = 1, 1, 1  # of espeak-ng's speak_lib.h: an output, an encoding, a parameter
CALLBACK = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.POINTER(ctypes.c_short), ctypes.c_int, ctypes.c_void_p)

Voice = Callable[[str], Sound]


def resampled(sound: NDArray[Any], rate: int) -> Sound:
    """Return a sound at RATE, without what that cannot hold."""
    length = round(len(sound) * RATE / rate)
    kept = np.fft.rfft(np.asarray(sound, dtype=np.float64))[: length // 2 + 1]
    return np.clip(np.fft.irfft(kept, length) * (length / len(sound)), -32768, 32767).astype(np.int16)


@cache
def _espeak() -> ctypes.CDLL:
    (loader,) = import_optional("espeakng_loader", extra="test", what="synthesised voices")
    library = ctypes.CDLL(loader.get_library_path())
    library.espeak_Initialize(RETRIEVAL, 0, loader.get_data_path().encode(), 0)
    return library


def espeak(name: str, speed: int = 150) -> Voice:
    """Return a voice of espeak-ng.

    name: its language and variant, as in "en-us+f2". speed: words a minute.
    """

    def speak(text: str) -> Sound:
        library, pieces = _espeak(), [np.zeros(0, np.int16)]

        def keep(samples: Any, count: int, _: Any) -> int:
            if samples and count:
                pieces.append(np.ctypeslib.as_array(samples, (count,)).copy())
            return 0

        callback = CALLBACK(keep)
        library.espeak_SetSynthCallback(callback)
        if library.espeak_SetVoiceByName(name.encode()):
            raise ConfigError(f"voice={name} is none of espeak-ng")
        library.espeak_SetParameter(WORDS_A_MINUTE, speed, 0)
        said = text.encode()
        library.espeak_Synth(said, len(said) + 1, 0, 1, 0, UTF8, None, None)
        library.espeak_Synchronize()
        return resampled(np.concatenate(pieces), ESPEAK_RATE)

    return speak


@cache
def _pico(language: str) -> Any:
    try:
        from ttspico import TtsEngine
    except ImportError:
        raise ConfigError("Pico's voices need ttspico, which is not installed: pip install ttspico") from None
    return TtsEngine(language)


def pico(language: str) -> Voice:
    """Return the voice of Pico for a language, en-US or en-GB."""
    return lambda text: np.frombuffer(_pico(language).speak(text), dtype=np.int16)


VOICES: dict[str, Voice] = {
    "pico en-US": pico("en-US"),
    "pico en-GB": pico("en-GB"),
    "espeak-ng en-us+f2": espeak("en-us+f2"),
}
