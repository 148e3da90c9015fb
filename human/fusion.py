"""Fusion of pointing and words: which object a ray and a phrase such as "that red one" refer to."""

from __future__ import annotations

from dataclasses import replace

from human.pointing import Array, NothingPointedAt
from language import Correction, LanguageError, ObjectPhrase, Scene, matches, parse


def referring_phrase(sentence: str) -> ObjectPhrase:
    """Returns the phrase that names the object of the sentence's last step.

    Raises:
        NotUnderstood: the sentence is outside the grammar.
        LanguageError: the sentence is a correction, which needs an instruction before it.
    """
    meaning = parse(sentence)
    if isinstance(meaning, Correction):
        raise LanguageError(f"'{sentence}' is a correction, and there is no instruction to correct; say what to do")
    return meaning.steps[-1].phrase


def fuse(phrase: ObjectPhrase, scene: Scene, weights: Array) -> Array:
    """Returns the probability that each object of the scene is the referent, (K,), summing to 1.

    Args:
        phrase: names the object; its determiner ("this", "that") is ignored, since the ray stands for it.
        scene: K objects.
        weights: (K,), the probabilities that the ray alone gives (`human.pointing.posterior`).

    Raises:
        NothingPointedAt: the ray excludes every object that the phrase fits.
    """
    fitting = weights * matches(replace(phrase, determiner="the"), scene)
    if fitting.sum() == 0:
        raise NothingPointedAt(f"the finger shows nothing that fits '{phrase}'; point at it, or say what it shows")
    return fitting / fitting.sum()
