"""Checks that recorded episodes can be reproduced: same seed, same actions, and a comparison of all states."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from torchrl.envs import EnvBase

from trainers.datasets.demonstrations import Demonstration, replay_episode


@dataclass
class ReplayResult:
    """Comparison of recorded and replayed episodes.

    differing: number of episodes with any difference. max_difference: the greatest absolute difference of any recorded
    number; it is in `key` of `episode`.
    """

    episodes: int = 0
    steps: int = 0
    differing: int = 0
    max_difference: float = 0.0
    key: str = ""
    episode: int = -1


def verify_replay(env: EnvBase, recorded: Iterable[Demonstration]) -> ReplayResult:
    """Replay every episode and compare it with its recording. env: of one world, with the recorded config."""
    result = ReplayResult()
    for index, episode in enumerate(recorded):
        differences = _differences(episode, replay_episode(env, episode))
        key, difference = max(differences.items(), key=lambda item: item[1])
        if difference > result.max_difference:
            result.max_difference, result.key, result.episode = difference, key, index
        result.differing += difference > 0
        result.episodes, result.steps = result.episodes + 1, result.steps + len(episode)
    return result


def _differences(recorded: Demonstration, replayed: Demonstration) -> dict[str, float]:
    """The greatest difference of each key; infinite if the sentence or the number of values differs.

    A format may leave out the state after the last action; then that state is not compared.
    """
    out = {"sentence": 0.0 if recorded.sentence == replayed.sentence else float("inf")}
    for name in ("observations", "labels", "outcomes"):
        new = getattr(replayed, name)
        out |= {key: _difference(values, new[key][: len(values)]) for key, values in getattr(recorded, name).items()}
    return out


def _difference(recorded: NDArray, replayed: NDArray) -> float:
    """The greatest absolute difference, in whatever shape a format stores the values of a step."""
    if recorded.size != replayed.size:
        return float("inf")
    apart = np.abs(recorded.astype(np.float64).ravel() - replayed.astype(np.float64).ravel())
    return float(np.nan_to_num(apart, nan=np.inf).max())
