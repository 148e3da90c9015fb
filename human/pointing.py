"""What a ray singles out. Pure functions of arrays: rays (..., 3), objects (..., K, 3), metres.

A ray starts at the fingertip, its origin O, and runs along the unit vector v. An object at P lies (P - O).v along it,
and beside it by the rejection P - O - ((P - O).v) v. What lies behind the fingertip, or WIDEST or more away from the
ray, can't be meant. All else is judged by its distance to the ray alone (`pointed_object`), or by its angle, with what
is known of the person's aim (`posterior`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike, NDArray

from human.pointing_ik import Array

MAX_ANGLE = np.deg2rad(45)  # nobody who points that far beside a thing means it
HIDDEN_PRIOR = 0.1  # how likely a thing is meant that the person doesn't see, beside one in plain sight


class NothingPointedAt(ValueError):
    """Nothing lies along the ray. The text is the whole message."""


class RayOffsets(NamedTuple):
    """How objects lie to a ray, each (..., K): metres along it, metres beside it, radians beside it."""

    along: Array
    distance: Array
    angle: Array


def ray_offsets(origin: ArrayLike, direction: ArrayLike, positions: ArrayLike) -> RayOffsets:
    """origin, direction (..., 3), positions (..., K, 3). Raises ValueError for a direction of no length."""
    v = unit(direction)[..., None, :]
    offset = np.asarray(positions, np.float64) - np.asarray(origin, np.float64)[..., None, :]
    along = (offset * v).sum(-1)
    distance = np.linalg.norm(offset - along[..., None] * v, axis=-1)
    return RayOffsets(along, distance, np.arctan2(distance, along))


def unit(vector: ArrayLike) -> Array:
    """The vector (..., 3) at length 1. Raises ValueError where it has none."""
    array = np.asarray(vector, np.float64)
    length = np.linalg.norm(array, axis=-1, keepdims=True)
    if not (np.isfinite(length) & (length > 0)).all():
        raise ValueError(f"direction={array.tolist()} must be three finite numbers that are not all 0")
    return array / length


def pointed_object(
    origin: ArrayLike, direction: ArrayLike, positions: ArrayLike, shown: ArrayLike | None = None
) -> NDArray[np.int64]:
    """(...) index of the object nearest to each ray (..., 3), of those at positions (..., K, 3) that can be meant.

    shown: (..., K) bool, which objects are there at all. Raises NothingPointedAt where there is none along a ray.
    """
    lies = ray_offsets(origin, direction, positions)
    distance = np.where(_possible(lies, shown), lies.distance, np.inf)
    nearest = distance.min(-1, initial=np.inf)
    if not np.isfinite(nearest).all():
        raise NothingPointedAt(_nothing(lies, ~np.isfinite(nearest)))
    return distance.argmin(-1)


def posterior(
    origin: ArrayLike,
    direction: ArrayLike,
    positions: ArrayLike,
    noise_deg: float,
    prior: ArrayLike | None = None,
    shown: ArrayLike | None = None,
) -> Array:
    """(..., K) how likely each object is meant by someone whose finger strays by noise_deg across each ray.

    noise_deg: standard deviation in each of the two directions across; 0 leaves the nearest object alone. prior:
    (..., K) how likely each was before anyone pointed (`visibility`), not normalised. shown: (..., K) bool, as above.
    Rows sum to 1. Raises NothingPointedAt.
    """
    lies = ray_offsets(origin, direction, positions)
    possible = _possible(lies, shown)
    lost = np.asarray(~possible.any(-1))
    if lost.any():
        raise NothingPointedAt(_nothing(lies, lost))
    if noise_deg == 0:
        nearest = np.where(possible, lies.distance, np.inf).argmin(-1)
        return np.eye(possible.shape[-1])[nearest]
    log = np.where(possible, -0.5 * (lies.angle / np.deg2rad(noise_deg)) ** 2, -np.inf)
    weight = np.exp(log - log.max(-1, keepdims=True)) * (1.0 if prior is None else np.asarray(prior))
    return weight / weight.sum(-1, keepdims=True)


def visibility(eyes: ArrayLike, positions: ArrayLike, size: float) -> Array:
    """(..., K) prior for `posterior`: 1, or HIDDEN for an object whose centre another hides from eyes (..., 3).

    size: metres that an object is wide.
    """
    places = np.asarray(positions, np.float64)
    sight = places - np.asarray(eyes, np.float64)[..., None, :]
    depth = np.linalg.norm(sight, axis=-1)
    lies = ray_offsets(np.asarray(eyes)[..., None, :], sight, places[..., None, :, :])  # k's line of sight, each j
    hides = (lies.distance < size / 2) & (lies.along < depth[..., None] - size / 2) & (lies.along > 0)
    return np.where(hides.any(-1), HIDDEN_PRIOR, 1.0)


def add_aiming_noise(direction: ArrayLike, noise_deg: float, rng: Generator) -> Array:
    """Directions (..., 3) turned by a normal angle of standard deviation noise_deg in both directions across them."""
    v = unit(direction)
    across = unit(_cross(v, np.eye(3)[np.abs(v).argmin(-1)]))
    turn = np.deg2rad(noise_deg) * rng.standard_normal((*v.shape[:-1], 2))
    offset = turn[..., :1] * across + turn[..., 1:] * _cross(v, across)
    angle = np.linalg.norm(offset, axis=-1, keepdims=True)
    return np.cos(angle) * v + np.sinc(angle / np.pi) * offset


def _cross(a: Array, b: Array) -> Array:
    """Of (..., 3); np.cross takes three times as long for a single one."""
    after, last = [1, 2, 0], [2, 0, 1]
    return a[..., after] * b[..., last] - a[..., last] * b[..., after]


def _possible(lies: RayOffsets, shown: ArrayLike | None) -> NDArray[np.bool_]:
    possible = np.asarray(lies.angle < MAX_ANGLE)
    return possible if shown is None else possible & np.asarray(shown, bool)


def _nothing(lies: RayOffsets, rows: NDArray[np.bool_]) -> str:
    if lies.angle.shape[-1] == 0:
        return "nothing lies along the ray: there is no object"
    nearest = np.rad2deg(lies.angle[rows].min())
    return (
        f"nothing lies along the ray: the nearest object is {nearest:.0f} degrees beside it, "
        f"and less than {np.rad2deg(MAX_ANGLE):.0f} is wanted; point at an object"
    )
