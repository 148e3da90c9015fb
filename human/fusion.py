"""Finger and words together: which object is meant by "that red one" and a ray."""

from __future__ import annotations

from dataclasses import replace

from human.pointing import Array, NothingPointedAt
from language import Correction, ObjectPhrase, Scene, matches, parse


def named(sentence: str) -> ObjectPhrase:
    """The words for the object, in a sentence that a task begins with: never a correction. Raises NotUnderstood."""
    meaning = parse(sentence)
    assert not isinstance(meaning, Correction)
    return meaning.steps[-1].phrase


def meant(phrase: ObjectPhrase, scene: Scene, weights: Array) -> Array:
    """(K,) how likely each object of the scene is meant: what the finger says of it (`posterior`), where the words fit.

    Raises NothingPointedAt where the finger excludes all that the words fit.
    """
    together = weights * matches(replace(phrase, determiner="the"), scene)
    if together.sum() == 0:
        raise NothingPointedAt(f"the finger shows nothing that fits '{phrase}'; point at it, or say what it shows")
    return together / together.sum()
