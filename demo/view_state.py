"""What is to be seen besides the scene."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SCORE = ("success", "wrong object", "wrong target", "failed", "out of time")


@dataclass
class Show:
    """What a session lets people see.

    status: what the robot does, or how it ended. hears: the words that the policy is given. meant: the object that it
    is to deal with, and where that goes. attention: (K,) in [0, 1], where the policy looks. pointing: (K,) how likely
    each object is pointed at. ray: the finger's origin and direction, metres. rewards: each term, summed. score: how
    often it ended how.
    """

    status: str = "Say what to do, or point at something."
    hears: str = ""
    meant: tuple[int, ...] = ()
    attention: Array | None = None
    pointing: Array | None = None
    ray: tuple[Array, Array] | None = None
    rewards: dict[str, float] = field(default_factory=dict)
    score: dict[str, int] = field(default_factory=lambda: dict.fromkeys(SCORE, 0))
