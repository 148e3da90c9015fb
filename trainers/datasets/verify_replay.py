"""Whether recorded episodes come about again: the same seed, the same actions, and the states side by side."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from torchrl.envs import EnvBase

from trainers.datasets.demonstrations import Demonstration, again


@dataclass
class Replayed:
    """largest: the greatest difference of any number recorded from what came this time; in `key` of `episode`."""

    episodes: int = 0
    steps: int = 0
    differing: int = 0  # episodes with any difference
    largest: float = 0.0
    key: str = ""
    episode: int = -1


def replay(env: EnvBase, kept: Iterable[Demonstration]) -> Replayed:
    """Play every episode again and compare all that was recorded of it. env: of one world, of the recorded config."""
    result = Replayed()
    for index, episode in enumerate(kept):
        gaps = _differences(episode, again(env, episode))
        key, gap = max(gaps.items(), key=lambda item: item[1])
        if gap > result.largest:
            result.largest, result.key, result.episode = gap, key, index
        result.differing += gap > 0
        result.episodes, result.steps = result.episodes + 1, result.steps + len(episode)
    return result


def _differences(kept: Demonstration, now: Demonstration) -> dict[str, float]:
    """The greatest difference by key; infinite where the number of values or the sentence is another.

    A format may leave out the state after the last action: then it is not compared.
    """
    out = {"sentence": 0.0 if kept.sentence == now.sentence else float("inf")}
    for recorded, came in ((kept.seen, now.seen), (kept.meant, now.meant), (kept.came_to, now.came_to)):
        out |= {key: _gap(values, came[key][: len(values)]) for key, values in recorded.items()}
    return out


def _gap(kept: NDArray, now: NDArray) -> float:
    """Between steps' values, in whatever shape a format keeps those of one step."""
    if kept.size != now.size:
        return float("inf")
    apart = np.abs(kept.astype(np.float64).ravel() - now.astype(np.float64).ravel())
    return float(np.nan_to_num(apart, nan=np.inf).max())
