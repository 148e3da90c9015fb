"""Scenes that are drawn and described but never simulated: all that is needed to learn what is meant."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase

from envs.gestures import RAY_WIDTH, ray_of
from envs.observation import OBJECT_WIDTH, Bounds, clipped, lasting_rows
from envs.tasks import Episode, Reach
from language import Tokenizer


def described(task: Reach, tokenizer: Tokenizer, bounds: Bounds, slots: int, count: int, seed: int) -> TensorDictBase:
    """(count,) objects, objects_mask, instruction, privileged/referent and, where a person points, gesture.

    They have the shapes and bounds of the observation of a world with so many slots. The gesture is the finger's own
    ray, even where episodes are shown the one that a camera reads.
    """
    rng = np.random.default_rng(seed)
    rows, shown = np.zeros((count, slots, OBJECT_WIDTH)), np.zeros((count, slots), bool)
    words, referents = np.zeros((count, tokenizer.length), np.int64), np.zeros(count, np.int64)
    rays = np.zeros((count, RAY_WIDTH))
    for i in range(count):
        episode = task.draw(rng)
        order = rng.permutation(slots)[: len(episode.scene)]
        rows[i, order], shown[i, order] = lasting_rows(episode.scene, episode.yaw), True
        words[i], referents[i] = encoded(tokenizer, episode), order[episode.referent]
        rays[i] = ray_of(episode.gesture)
    values = {
        "objects": clipped(rows, bounds.objects),
        "objects_mask": torch.from_numpy(shown),
        "instruction": torch.from_numpy(words),
        "privileged": TensorDict({"referent": torch.from_numpy(referents)}, [count]),
    }
    if task.points:
        values["gesture"] = clipped(rays, bounds.gesture)
    return TensorDict(values, [count])


def encoded(tokenizer: Tokenizer, episode: Episode) -> NDArray[np.int64]:
    """(L,) the tokens that the policy reads."""
    return tokenizer.encode(episode.sentence if episode.heard is None else episode.heard)
