"""Spatial relations and superlatives: registered pure functions of positions in the viewer's frame.

    @relation("left of", "to the left of")
    def _left_of(subject, anchor):
        return subject[..., 1] - anchor[..., 1]

    @superlative("leftmost")
    def _leftmost(positions, sizes):
        return positions[..., 1]

Nothing else is needed: grammar, vocabulary, describer and parser read the registries. Positions are in metres in the
viewer's frame (`language/viewpoint.py`): x away from the viewer, y to the viewer's left, z up.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from language.errors import LanguageError, check_known

Margin = Callable[..., np.ndarray]

# Thresholds of a margin, in metres. A relation holds above HOLDS; below that, a person would not call one object left
# of another. It is generated only if the margin of the referent is above CLEAR and those of all other candidates are
# below ABSENT.
HOLDS, CLEAR, ABSENT = 0.03, 0.05, 0.01

NEAR = 0.2  # metres between centres up to which objects are near
BESIDE = 0.13  # metres of sideways offset up to which an object is above another, or between two


@dataclass(frozen=True)
class Relation:
    """A spatial relation of an object to one or two anchors.

    phrase: used by `say`. synonyms: also understood.
    margin: maps the positions of the subject and of each anchor, (..., 3) metres in the viewer's frame, broadcast
        against each other, to (...) metres: the greater, the clearer the relation. It holds above HOLDS.
    anchors: their number, 1 or 2 ("between").
    best: whether the relation selects the object with the greatest margin, whatever its value ("nearest to").
    """

    phrase: str
    synonyms: tuple[str, ...]
    margin: Margin
    anchors: int = 1
    best: bool = False


@dataclass(frozen=True)
class Superlative:
    """A superlative, which selects one of several objects by a score.

    phrase: used by `say`. synonyms: also understood.
    score: maps positions (..., 3) in the viewer's frame and sizes (...), metres, to (...) numbers; the greatest is
        selected.
    tie: scores within `tie` of the greatest are equally good. clear: the lead from which it is generated.
    after: phrases that are understood after the noun: "the cube on the left".
    """

    phrase: str
    synonyms: tuple[str, ...]
    score: Margin
    tie: float
    clear: float
    after: tuple[str, ...] = ()


RELATIONS: dict[str, Relation] = {}
SUPERLATIVES: dict[str, Superlative] = {}


def relation(phrase: str, *synonyms: str, anchors: int = 1, best: bool = False) -> Callable[[Margin], Margin]:
    """Decorator that registers a margin function as a `Relation`. Raises LanguageError if a phrase is in use."""

    def register(margin: Margin) -> Margin:
        _check_free((phrase, *synonyms))
        if anchors not in (1, 2) or (best and anchors != 1):
            raise LanguageError(f"{phrase!r}: anchors={anchors}, best={best}; give 1 anchor, or 2 without best")
        RELATIONS[phrase] = Relation(phrase, synonyms, margin, anchors, best)
        return margin

    return register


def superlative(
    phrase: str, *synonyms: str, tie: float = ABSENT, clear: float = CLEAR, after: tuple[str, ...] = ()
) -> Callable[[Margin], Margin]:
    """Decorator that registers a score function as a `Superlative`. Raises LanguageError if a phrase is in use."""

    def register(score: Margin) -> Margin:
        _check_free((phrase, *synonyms))
        SUPERLATIVES[phrase] = Superlative(phrase, synonyms, score, tie, clear, after)
        return score

    return register


def unregister(phrase: str) -> None:
    """Remove a relation or superlative from its registry. Raises LanguageError if there is none of this phrase."""
    check_known("relation or superlative", phrase, [*RELATIONS, *SUPERLATIVES])
    (RELATIONS if phrase in RELATIONS else SUPERLATIVES).pop(phrase)


def _check_free(phrases: tuple[str, ...]) -> None:
    registered: list[Relation | Superlative] = [*RELATIONS.values(), *SUPERLATIVES.values()]
    taken = {words for known in registered for words in (known.phrase, *known.synonyms)}
    for words in phrases:
        if words in taken:
            raise LanguageError(f"{words!r} is already registered")


def _sideways(offset: np.ndarray) -> np.ndarray:
    return np.hypot(offset[..., 0], offset[..., 1])


def _distance(subject: np.ndarray, anchor: np.ndarray) -> np.ndarray:
    offset = subject - anchor
    return np.sqrt((offset * offset).sum(-1))


@relation("left of", "to the left of", "left to", "on the left of")
def _left_of(subject: np.ndarray, anchor: np.ndarray) -> np.ndarray:
    return subject[..., 1] - anchor[..., 1]


@relation("right of", "to the right of", "right to", "on the right of")
def _right_of(subject: np.ndarray, anchor: np.ndarray) -> np.ndarray:
    return anchor[..., 1] - subject[..., 1]


@relation("in front of", "before")
def _in_front_of(subject: np.ndarray, anchor: np.ndarray) -> np.ndarray:
    return anchor[..., 0] - subject[..., 0]


@relation("behind", "in back of")
def _behind(subject: np.ndarray, anchor: np.ndarray) -> np.ndarray:
    return subject[..., 0] - anchor[..., 0]


@relation("above", "over")
def _above(subject: np.ndarray, anchor: np.ndarray) -> np.ndarray:
    offset = subject - anchor
    return np.minimum(offset[..., 2], BESIDE - _sideways(offset))


@relation("below", "under", "underneath", "beneath")
def _below(subject: np.ndarray, anchor: np.ndarray) -> np.ndarray:
    offset = anchor - subject
    return np.minimum(offset[..., 2], BESIDE - _sideways(offset))


@relation("near", "close to", "next to", "beside", "by")
def _near(subject: np.ndarray, anchor: np.ndarray) -> np.ndarray:
    return NEAR - _distance(subject, anchor)


@relation("nearest to", "closest to", best=True)
def _nearest_to(subject: np.ndarray, anchor: np.ndarray) -> np.ndarray:
    return -_distance(subject, anchor)


@relation("farthest from", "furthest from", best=True)
def _farthest_from(subject: np.ndarray, anchor: np.ndarray) -> np.ndarray:
    return _distance(subject, anchor)


@relation("between", "in between", anchors=2)
def _between(subject: np.ndarray, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The smallest of the distances to both ends and to the side of the corridor between them."""
    way = other - one
    length = np.maximum(np.sqrt((way * way).sum(-1)), 1e-9)
    along = ((subject - one) * way).sum(-1) / length
    aside = _distance(subject, one + way * (along / length)[..., None])
    return np.minimum(np.minimum(along, length - along), BESIDE - aside)


@superlative("leftmost", "left", after=("on the left",))
def _leftmost(positions: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    return positions[..., 1]


@superlative("rightmost", "right", after=("on the right",))
def _rightmost(positions: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    return -positions[..., 1]


@superlative("nearest", "closest")
def _nearest(positions: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    return -_sideways(positions)


@superlative("farthest", "furthest", "most distant")
def _farthest(positions: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    return _sideways(positions)


@superlative("highest", "topmost", "top", after=("at the top",))
def _highest(positions: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    return positions[..., 2]


@superlative("lowest", "bottom", after=("at the bottom",))
def _lowest(positions: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    return -positions[..., 2]


@superlative("largest", "biggest", tie=0.003, clear=0.01)
def _largest(positions: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    return sizes


@superlative("smallest", "littlest", tie=0.003, clear=0.01)
def _smallest(positions: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    return -sizes
