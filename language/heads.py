"""Heads of phrases: which combinations of colour, noun, size and role fit which objects of a scene."""

from __future__ import annotations

import numpy as np

from language.objects import SIZES, Scene


def head_matches(scene: Scene) -> np.ndarray:
    """Returns (H, K, K) float32: whether the head made for one object fits another; 0 if the head does not exist.

    Heads are numbered by bits for colour, noun, size and role; H is 4, 8 or 16, as far as the scene needs the bits.
    """
    count = len(scene)
    same = np.ones((4, count, count), dtype=np.float32)
    same[1] = scene.colors[:, None] == scene.colors
    same[2] = scene.nouns[:, None] == scene.nouns
    np.multiply(same[1], same[2], out=same[3])
    words = size_words(scene)
    if any(words):
        sized = np.array([[word == other and word is not None for other in words] for word in words])
        same = np.concatenate((same, same * sized))
    if scene.targets.any():
        if not any(words):
            same = np.concatenate((same, np.zeros_like(same)))
        same = np.concatenate((same, same * (scene.targets[:, None] == scene.targets)))
    return same


def size_words(scene: Scene) -> list[str | None]:
    """Returns each object's size as a word, None if no word fits."""
    return [
        next((word for word, size in SIZES.items() if size.low < x < size.high), None) for x in scene.sizes.tolist()
    ]
