"""Goals that a recorded episode achieved, for relabelling."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from envs.tasks.shared.types import Array, State


class AchievedGoal(NamedTuple):
    """referent, target: indices of objects; target None: no target. places: (K, 3) initial positions, metres."""

    referent: int
    target: int | None
    places: Array


def find_achieved_goal(
    moments: State, *, moved: float, still: float, radius: float, rng: Generator
) -> AchievedGoal | None:
    """Return the object that was moved first, and a target where it came to rest; None if that is the original goal.

    A target that stands there already is kept; otherwise a random one is moved there, at its own height: no episode
    has a target in the air.

    Args:
        moments: The T + 1 states of one episode, as in `Task.relabel`.
        moved: Metres from its initial position beyond which an object counts as moved.
        still: Metres a step below which an object is at rest.
        radius: Metres from a target within which an object is at the target.
    """
    referent = first_moved(moments, moved)
    if referent is None:
        return None
    gone, places = _gone(moments, moved)[:, referent], moments.objects[0].copy()
    other = referent != moments.referent[0]
    targets = np.flatnonzero(moments.goals[0])
    if not len(targets):
        return AchievedGoal(referent, None, places) if other else None
    place = moments.objects[_when(moments, referent, gone, still=still, rng=rng), referent]
    near = _lengths(places[targets] - place)
    if near.min() <= radius:
        target = int(targets[near.argmin()])
        return AchievedGoal(referent, target, places) if other or target != moments.target[0] else None
    target = int(rng.choice(targets))
    places[target, :2] = place[:2]
    return AchievedGoal(referent, target, places)


def first_moved(moments: State, moved: float) -> int | None:
    """Return the movable object that was first more than `moved` metres from where it began; None if none was."""
    gone = _gone(moments, moved)
    movable = np.flatnonzero(moments.movable[0] & gone.any(0))
    return int(movable[gone[:, movable].argmax(0).argmin()]) if len(movable) else None


def _gone(moments: State, moved: float) -> NDArray[np.bool_]:
    """(T + 1, K) whether objects are more than `moved` metres from where they began."""
    return _lengths(moments.objects - moments.objects[0]) > moved


def _when(moments: State, referent: int, gone: NDArray[np.bool_], *, still: float, rng: Generator) -> int:
    """A random step after the object had been moved; one at rest and released if there is any.

    This is the strategy "future" of hindsight experience replay, Andrychowicz et al. 2017 (arXiv:1707.01495).
    """
    places = moments.objects[:, referent]
    rests = np.append(False, _lengths(np.diff(places, axis=0)) < still)
    left = gone & rests & (moments.held != referent)
    return int(rng.choice(np.flatnonzero(left if left.any() else gone)))


def _lengths(vectors: Array) -> Array:
    return np.sqrt((vectors * vectors).sum(-1))
