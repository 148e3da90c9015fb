"""How well words and finger identify the referent: beliefs over a scene's objects, their accuracy and calibration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from envs.tasks import EpisodeSpec
from human import Person, fuse, posterior, ray_offsets, visibility
from language import parse
from trainers.evaluation.evaluation import wilson

Array = NDArray[np.float64]


class PointedScene(NamedTuple):
    """A gesture among K objects.

    origin, direction: (3,) of the finger's ray, metres and unit length. positions: (K, 3), metres. referent: index of
    the object that the person aimed at. prior: (K,) probability of each object without the gesture, unnormalised.
    """

    origin: Array
    direction: Array
    positions: Array
    referent: int
    prior: Array


def accuracy_by_cue(episodes: Sequence[EpisodeSpec], person: Person, noise_deg: float, size: float) -> dict[str, Any]:
    """Return accuracy and calibration of the belief from the words, the finger, both, and both with `insider_belief`.

    size: of the objects, metres. Every episode has a gesture.
    """
    beliefs: dict[str, list[Array]] = {name: [] for name in ("words", "finger", "both", "insider")}
    for episode in episodes:
        scene, gesture = episode.scene, episode.gesture
        assert gesture is not None
        prior = visibility(person.eyes, scene.positions, size)
        command: Any = parse(episode.sentence)
        phrase = command.steps[-1].phrase
        finger = posterior(gesture.origin, gesture.direction, scene.positions, noise_deg, prior)
        shown = PointedScene(gesture.origin, gesture.direction, scene.positions, episode.referent, prior)
        beliefs["words"].append(fuse(phrase, scene, prior))
        beliefs["finger"].append(finger)
        beliefs["both"].append(fuse(phrase, scene, finger))
        beliefs["insider"].append(fuse(phrase, scene, insider_belief(person, shown, noise_deg)))
    referents = [episode.referent for episode in episodes]
    return {name: calibration(each, referents) for name, each in beliefs.items()}


def insider_belief(person: Person, shown: PointedScene, noise_deg: float) -> Array:
    """Return (K,) belief of an observer who knows this person's kinematics: an upper bound for all observers.

    `posterior` assumes that the direction is noisy and the fingertip is where it is seen. In fact the noise displaces
    the aim, and the arm is solved again for the displaced aim. So each object is judged from the fingertip that the
    person would have when pointing at that object.
    """
    if noise_deg == 0:
        return posterior(shown.origin, shown.direction, shown.positions, noise_deg, shown.prior)
    height = shown.positions[0, 2] - shown.origin[2]
    spot = shown.origin + shown.direction * (height / shown.direction[2])  # all the information of the ray
    fingertips = np.array([person.aim(place).origin for place in shown.positions])
    sight = spot - fingertips
    distance = np.linalg.norm(sight, axis=1)
    spots = np.broadcast_to(spot, (len(fingertips), 1, 3))
    angle = ray_offsets(fingertips, shown.positions - fingertips, spots).angle[:, 0]
    solid_angle = np.abs(sight[:, 2]) / distance**3  # of a spot of unit area
    log = -0.5 * (angle / np.deg2rad(noise_deg)) ** 2 + np.log(solid_angle)
    weight = np.exp(log - log.max()) * shown.prior
    return weight / weight.sum()


def calibration(beliefs: Sequence[Array], referents: Sequence[int]) -> dict[str, Any]:
    """Return `accuracy` of the likeliest object, and "expected": the accuracy that calibrated beliefs would have."""
    right = [int(belief.argmax()) == referent for belief, referent in zip(beliefs, referents, strict=True)]
    return {**accuracy(right), "expected": round(float(np.mean([belief.max() for belief in beliefs])), 4)}


def accuracy(right: Sequence[bool]) -> dict[str, Any]:
    """Return the share that is right, with its 95 % Wilson interval: {"right", "low", "high"}."""
    low, high = wilson(sum(right), len(right))
    return {"right": round(sum(right) / len(right), 4), "low": round(low, 4), "high": round(high, 4)}
