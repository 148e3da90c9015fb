"""Which object a ray refers to, alone or together with words. Pure functions of arrays: rays (..., 3), metres.

A ray starts at the fingertip, its origin O, and runs along the unit vector v. An object at P lies at (P - O).v along
the ray; its offset from the ray is the rejection P - O - ((P - O).v) v. Objects behind the fingertip, or MAX_ANGLE or
more away from the ray, cannot be the referent. All others are compared by their distance to the ray alone
(`pointed_object`), or by their angle and the known aiming error of the person (`posterior`). `fuse` adds a phrase such
as "that red one".
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike, NDArray

from human.arms import Array
from language import Correction, LanguageError, ObjectPhrase, Scene, matches, parse

MAX_ANGLE = np.deg2rad(45)  # between the ray and an object that can be the referent
HIDDEN_PRIOR = 0.1  # prior weight of an object that the person does not see; 1 for a visible one


class NothingPointedAt(ValueError):
    """No object lies along the ray. The text is the whole message."""


class RayOffsets(NamedTuple):
    """Positions relative to a ray, each (..., K).

    along: metres along the ray. distance: metres from the ray. angle: radians from the ray, seen from its origin.
    """

    along: Array
    distance: Array
    angle: Array


def ray_offsets(origin: ArrayLike, direction: ArrayLike, positions: ArrayLike) -> RayOffsets:
    """Return how positions lie relative to rays.

    Args:
        origin, direction: (..., 3); the direction may have any length but 0.
        positions: (..., K, 3) metres.

    Raises:
        ValueError: a direction of length 0, or one that is not finite.
    """
    v = unit(direction)[..., None, :]
    offset = np.asarray(positions, np.float64) - np.asarray(origin, np.float64)[..., None, :]
    along = (offset * v).sum(-1)
    distance = np.linalg.norm(offset - along[..., None] * v, axis=-1)
    return RayOffsets(along, distance, np.arctan2(distance, along))


def unit(vector: ArrayLike) -> Array:
    """Return vectors (..., 3) scaled to length 1. Raises ValueError for length 0 and for non-finite numbers."""
    array = np.asarray(vector, np.float64)
    length = np.linalg.norm(array, axis=-1, keepdims=True)
    if not (np.isfinite(length) & (length > 0)).all():
        raise ValueError(f"direction={array.tolist()} must be three finite numbers that are not all 0")
    return array / length


def pointed_object(
    origin: ArrayLike, direction: ArrayLike, positions: ArrayLike, shown: ArrayLike | None = None
) -> NDArray[np.int64]:
    """Return the index (...) of the object nearest to each ray, among those that can be the referent.

    Args:
        origin, direction: (..., 3).
        positions: (..., K, 3) metres.
        shown: (..., K) bool, which objects are present; None: all.

    Raises:
        NothingPointedAt: no object lies along one of the rays.
    """
    offsets = ray_offsets(origin, direction, positions)
    distance = np.where(_possible(offsets, shown), offsets.distance, np.inf)
    nearest = distance.min(-1, initial=np.inf)
    if not np.isfinite(nearest).all():
        raise NothingPointedAt(_nothing_message(offsets, ~np.isfinite(nearest)))
    return distance.argmin(-1)


def posterior(
    origin: ArrayLike,
    direction: ArrayLike,
    positions: ArrayLike,
    noise_deg: float,
    prior: ArrayLike | None = None,
    shown: ArrayLike | None = None,
) -> Array:
    """Return the probability (..., K) that each object is the referent, given normally distributed aiming errors.

    Args:
        origin, direction: (..., 3).
        positions: (..., K, 3) metres.
        noise_deg: standard deviation of the aiming error in each of the two directions across the ray, in degrees;
            0 gives the nearest object all the probability.
        prior: (..., K), probabilities before the gesture (`visibility`), not necessarily normalised; None: uniform.
        shown: (..., K) bool, which objects are present; None: all.

    Raises:
        NothingPointedAt: no object lies along one of the rays.
    """
    offsets = ray_offsets(origin, direction, positions)
    possible = _possible(offsets, shown)
    without = np.asarray(~possible.any(-1))
    if without.any():
        raise NothingPointedAt(_nothing_message(offsets, without))
    if noise_deg == 0:
        nearest = np.where(possible, offsets.distance, np.inf).argmin(-1)
        return np.eye(possible.shape[-1])[nearest]
    log = np.where(possible, -0.5 * (offsets.angle / np.deg2rad(noise_deg)) ** 2, -np.inf)
    weight = np.exp(log - log.max(-1, keepdims=True)) * (1.0 if prior is None else np.asarray(prior))
    return weight / weight.sum(-1, keepdims=True)


def visibility(eyes: ArrayLike, positions: ArrayLike, size: float) -> Array:
    """Return a prior (..., K) for `posterior`: 1, or HIDDEN_PRIOR where another object hides an object's centre.

    Args:
        eyes: (..., 3) metres.
        positions: (..., K, 3) metres.
        size: width of the objects, metres.
    """
    places = np.asarray(positions, np.float64)
    sight = places - np.asarray(eyes, np.float64)[..., None, :]
    depth = np.linalg.norm(sight, axis=-1)
    # Entry [..., k, j]: object j relative to the line of sight to object k.
    offsets = ray_offsets(np.asarray(eyes)[..., None, :], sight, places[..., None, :, :])
    hides = (offsets.distance < size / 2) & (offsets.along < depth[..., None] - size / 2) & (offsets.along > 0)
    return np.where(hides.any(-1), HIDDEN_PRIOR, 1.0)


def add_aiming_noise(direction: ArrayLike, noise_deg: float, rng: Generator) -> Array:
    """Return directions (..., 3) turned by a normal angle in each of the two directions across them.

    noise_deg: standard deviation of each angle, degrees.
    """
    v = unit(direction)
    across = unit(_cross(v, np.eye(3)[np.abs(v).argmin(-1)]))
    turn = np.deg2rad(noise_deg) * rng.standard_normal((*v.shape[:-1], 2))
    offset = turn[..., :1] * across + turn[..., 1:] * _cross(v, across)
    angle = np.linalg.norm(offset, axis=-1, keepdims=True)
    return np.cos(angle) * v + np.sinc(angle / np.pi) * offset


def _cross(a: Array, b: Array) -> Array:
    """Return the cross product of arrays (..., 3); np.cross takes three times as long for a single vector."""
    following, last = [1, 2, 0], [2, 0, 1]
    return a[..., following] * b[..., last] - a[..., last] * b[..., following]


def _possible(offsets: RayOffsets, shown: ArrayLike | None) -> NDArray[np.bool_]:
    possible = np.asarray(offsets.angle < MAX_ANGLE)
    return possible if shown is None else possible & np.asarray(shown, bool)


def _nothing_message(offsets: RayOffsets, rows: NDArray[np.bool_]) -> str:
    if offsets.angle.shape[-1] == 0:
        return "nothing lies along the ray: there is no object"
    nearest = np.rad2deg(offsets.angle[rows].min())
    return (
        f"nothing lies along the ray: the nearest object is {nearest:.0f} degrees beside it, "
        f"and less than {np.rad2deg(MAX_ANGLE):.0f} is wanted; point at an object"
    )


def referring_phrase(sentence: str) -> ObjectPhrase:
    """Return the phrase that names the object of the sentence's last step.

    Raises:
        NotUnderstood: the sentence is outside the grammar.
        LanguageError: the sentence is a correction, which needs an instruction before it.
    """
    meaning = parse(sentence)
    if isinstance(meaning, Correction):
        raise LanguageError(f"'{sentence}' is a correction, and there is no instruction to correct; say what to do")
    return meaning.steps[-1].phrase


def fuse(phrase: ObjectPhrase, scene: Scene, weights: Array) -> Array:
    """Return the probability that each object of the scene is the referent, (K,), summing to 1.

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
