"""The finger of the person in a session: where it points, and which objects it singles out."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.errors import ConfigError
from envs.interactive.interactive_env import InteractiveEnv
from human import NothingPointedAt, fuse, posterior, referring_phrase
from language import LanguageError

Array = NDArray[np.float64]
MIN_NOISE = 2.0  # degrees of aiming noise that is assumed even where the config has less
MAX_GESTURES = 4  # gestures that are kept for sentences with several ("put this here")
START = (0.45, 0.0, 0.02)  # metres: where the finger points before it is moved


class Finger:
    """The finger over one world. K is the number of objects.

    aim: (3,) metres, where the finger points, or will start. ray: origin (3,) and direction (3,); None before the first
    gesture in a scene. probabilities: (K,) that the finger points at each object; None if nothing is near the ray.
    is_new: whether there was a gesture since the last instruction. fresh: gestures at one object after another since
    the last sentence.
    """

    def __init__(self, env: InteractiveEnv) -> None:
        self._env = env
        self.aim: Array = np.array(START)
        self.clear()

    def clear(self) -> None:
        """Forgets the gestures of a scene; the aim stays."""
        self._referents: deque[int] = deque(maxlen=MAX_GESTURES)
        self.ray: tuple[Array, Array] | None = None
        self.probabilities: Array | None = None
        self.is_new, self.fresh = False, 0

    def point_at(self, place: ArrayLike) -> int | None:
        """Points at a place (3,), metres. Returns the likeliest object; None if nothing is near the ray.

        Raises:
            Unreachable: the person cannot point there; nothing changes.
            ConfigError: the workspace has no person.
        """
        if not self._env.has_person:
            raise ConfigError("this workspace has no person who could point; choose workspace=collabtable")
        self.ray = self._env.point_at(place)
        self.aim = np.array(place, np.float64)
        self.probabilities = self._pointing_probabilities(self.ray)
        self.is_new = True
        if self.probabilities is None:
            return None
        likeliest = int(self.probabilities.argmax())
        self.fresh += not self.fresh or likeliest != self.last_referent
        self._referents.append(likeliest)
        return likeliest

    def _pointing_probabilities(self, ray: tuple[Array, Array]) -> Array | None:
        try:
            return posterior(*ray, self._env.scene().positions, max(self._env.config.gesture.noise_deg, MIN_NOISE))
        except NothingPointedAt:
            return None

    @property
    def last_referent(self) -> int | None:
        """The object of the last gesture that singled one out."""
        return self._referents[-1] if self._referents else None

    def referents(self, count: int, sentence: str) -> Sequence[int]:
        """The objects of the last `count` gestures, oldest first. A single one is fused with the sentence's words."""
        latest = list(self._referents)[-count:] if count else []
        if count == 1 and latest and self.probabilities is not None:
            return [self._fused(sentence, latest[0], self.probabilities)]
        return latest

    def _fused(self, sentence: str, pointed: int, probabilities: Array) -> int:
        """The object that finger and words single out together ("that red one")."""
        try:
            return int(fuse(referring_phrase(sentence), self._env.scene(), probabilities).argmax())
        except (LanguageError, NothingPointedAt):  # a correction names no object by itself
            return pointed
