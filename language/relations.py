"""Spatial relations: registered pure functions of positions.

    @relation("left of", "to the left of")
    def _left_of(subject, anchor):
        return subject[..., 1] - anchor[..., 1]

That is all a relation needs: grammar, vocabulary, describer and parser read the registry.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from language.errors import LanguageError, check_known

Margin = Callable[[np.ndarray, np.ndarray], np.ndarray]

HOLDS = 0.03  # metres: less than this no person would call one thing left of another


@dataclass(frozen=True)
class Relation:
    """A way to say where one thing is, seen from another.

    phrase: what we say; synonyms: what we also understand.
    margin: takes the positions of subject and anchor, (..., 3) metres in the workspace frame, broadcasting,
        and gives (...) metres: the more above 0, the clearer the relation. It holds above HOLDS.
    """

    phrase: str
    synonyms: tuple[str, ...]
    margin: Margin


RELATIONS: dict[str, Relation] = {}


def relation(phrase: str, *synonyms: str) -> Callable[[Margin], Margin]:
    """Registers a margin function under its phrase. Raises LanguageError where the words are taken."""

    def register(margin: Margin) -> Margin:
        taken = {words for known in RELATIONS.values() for words in (known.phrase, *known.synonyms)}
        for words in (phrase, *synonyms):
            if words in taken:
                raise LanguageError(f"{words!r} is a relation already")
        RELATIONS[phrase] = Relation(phrase, synonyms, margin)
        return margin

    return register


def unregister(phrase: str) -> None:
    """Forgets a relation. Raises LanguageError where there is none."""
    check_known("relation", phrase, RELATIONS)
    del RELATIONS[phrase]


@relation("left of", "to the left of", "left to")
def _left_of(subject: np.ndarray, anchor: np.ndarray) -> np.ndarray:
    return subject[..., 1] - anchor[..., 1]


@relation("right of", "to the right of", "right to")
def _right_of(subject: np.ndarray, anchor: np.ndarray) -> np.ndarray:
    return anchor[..., 1] - subject[..., 1]
