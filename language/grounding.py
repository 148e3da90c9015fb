"""Which object of a scene the words mean."""

from __future__ import annotations

import numpy as np

from language.colors import COLORS
from language.errors import NothingFits, SeveralFit
from language.instruction import Instruction, ObjectPhrase
from language.objects import NOUNS, Scene
from language.relations import HOLDS, RELATIONS


def matches(phrase: ObjectPhrase, scene: Scene) -> np.ndarray:
    """(K,) bool, which objects of the scene the phrase fits.

    A relation is seen from one object: raises NothingFits or SeveralFit where the anchor's phrase names none
    or several.
    """
    fits = _head_matches(phrase, scene)
    if phrase.relation is not None and phrase.anchor is not None:
        anchor = _the_one(phrase.anchor, scene)
        positions = scene.positions
        fits &= RELATIONS[phrase.relation].margin(positions, positions[anchor]) > HOLDS
        fits[anchor] = False  # nothing is beside itself, whatever the relation's function says
    return fits


def ground(instruction: Instruction, scene: Scene) -> int:
    """The index of the one object that the instruction names. Raises NothingFits or SeveralFit."""
    return _the_one(instruction.phrase, scene)


def _the_one(phrase: ObjectPhrase, scene: Scene) -> int:
    candidates = np.flatnonzero(matches(phrase, scene)).tolist()
    if len(candidates) == 1:
        return candidates[0]
    if candidates:
        listed = "; ".join(_describe_place(scene, index) for index in candidates)
        raise SeveralFit(f"'{phrase}' may be any of {len(candidates)}: {listed}", tuple(candidates))
    raise _nothing_fits(phrase, scene)


def _head_matches(phrase: ObjectPhrase, scene: Scene) -> np.ndarray:
    fits = np.ones(len(scene), dtype=bool)
    if phrase.noun is not None:
        fits &= scene.nouns == list(NOUNS).index(phrase.noun)
    if phrase.color is not None:
        fits &= scene.colors == list(COLORS).index(phrase.color)
    return fits


def _nothing_fits(phrase: ObjectPhrase, scene: Scene) -> NothingFits:
    part = _failing_part(phrase, scene)
    present = ", ".join(f"a {thing.color} {thing.noun}" for thing in scene) or "nothing at all"
    return NothingFits(f"nothing fits '{phrase}': there is no {part}; there is {present}", part)


def _failing_part(phrase: ObjectPhrase, scene: Scene) -> str:
    """The fewest words of the phrase that no object fits."""
    parts = (ObjectPhrase(color=phrase.color), ObjectPhrase(noun=phrase.noun), phrase.head)
    for part in parts:
        if not _head_matches(part, scene).any():
            return part.label
    return f"{phrase.label} {phrase.relation} {phrase.anchor}"


def _describe_place(scene: Scene, index: int) -> str:
    thing = scene[index]
    x, y, z = thing.position
    return f"the {thing.color} {thing.noun} at ({x:.2f}, {y:.2f}, {z:.2f})"
