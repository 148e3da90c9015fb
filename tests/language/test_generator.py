"""Nameable objects of the generator, compared with a brute-force search over all phrases."""

from functools import cache

import numpy as np
import pytest

from language import COLORS, KINDS, NOUNS, RELATIONS, ROLES, SUPERLATIVES, Describer, ObjectPhrase, matches
from language.relations import ABSENT, CLEAR
from tests.helpers.language_cases import random_scenes


@pytest.mark.slow
@pytest.mark.parametrize("redundant", [False, True])
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "nested"])
def test_an_object_is_nameable_if_and_only_if_some_phrase_fits_it_alone(kind, redundant):
    for each in random_scenes(24, counts=range(1, 5), seed=3):
        named = Describer([kind], redundant=redundant).nameable(each).tolist()
        brute = Brute(each, redundant)
        possible = set().union(*map(brute.named, brute.every(kind)))
        assert named == [index in possible for index in range(len(each))]


class Brute:
    """Generates every phrase of a kind for a scene, and finds the object that each fits."""

    def __init__(self, scene, redundant):
        self.scene, self.fewest = scene, 1 if redundant else 2
        self.fits = cache(lambda phrase: matches(phrase, scene))
        self.heads = [head for head in all_heads(scene) if self.fits(head).any()]

    def every(self, kind):
        anchors = [head for head in self.heads if head.kind in ("color", "shape", "color_shape") and not head.role]
        for head in self.heads:
            words = {"noun": head.noun, "color": head.color, "size": head.size, "role": head.role}
            if kind == "superlative":
                yield from (ObjectPhrase(**words, superlative=known) for known in SUPERLATIVES)
            elif kind == "negation":
                yield from (ObjectPhrase(**words, excluded=ObjectPhrase(color=c)) for c in COLORS if not head.color)
                yield from (ObjectPhrase(**words, excluded=ObjectPhrase(noun)) for noun in NOUNS if not head.noun)
            elif kind == "relation":
                for known in RELATIONS.values():
                    for chosen in [(a,) for a in anchors] if known.anchors == 1 else pairs(anchors):
                        yield ObjectPhrase(**words, relation=known.phrase, anchors=chosen)
            elif kind == ObjectPhrase(head.noun, head.color, size=head.size).kind:
                yield head

    def named(self, phrase):
        """A set with the index of the object that the phrase clearly fits; empty if another one may fit, or none."""
        fits = self.fits(ObjectPhrase(phrase.noun, phrase.color, size=phrase.size, role=phrase.role))
        more = phrase.excluded or phrase.superlative or phrase.relation
        if more and fits.sum() < self.fewest:
            return set()
        if phrase.excluded:
            fits = self.excluding(phrase, fits)
        elif phrase.superlative:
            known = SUPERLATIVES[phrase.superlative]
            fits = ahead(known.score(self.scene.seen, self.scene.sizes), fits, known.clear)
        elif phrase.relation:
            fits = self.related(phrase, fits)
        return set(fits.nonzero()[0].tolist()) if fits.sum() == 1 else set()

    def excluding(self, phrase, fits):
        return fits & self.fits(phrase) if self.fits(phrase.excluded).any() else np.zeros_like(fits)

    def related(self, phrase, fits):
        known = RELATIONS[phrase.relation]
        anchors = [self.fits(anchor) for anchor in phrase.anchors]
        seen_from = [int(anchor.argmax()) for anchor in anchors]
        if any(anchor.sum() != 1 for anchor in anchors) or len(set(seen_from)) < len(anchors):
            return np.zeros_like(fits)
        margin = known.margin(self.scene.seen, *(self.scene.seen[index] for index in seen_from))
        margin[seen_from] = -np.inf
        if known.best:
            return ahead(margin, fits, CLEAR)
        possible = fits & (margin >= ABSENT)
        return possible if (margin[possible] > CLEAR).all() else np.zeros_like(fits)


def all_heads(scene):
    """Every combination of noun, colour, size and role that an object of the scene could have."""
    for noun, color in {(n, c) for thing in scene for n in (None, thing.noun) for c in (None, thing.color)}:
        for size in (None, "small", "large"):
            for role in (None, *ROLES) if scene.targets.any() else (None,):
                yield ObjectPhrase(noun, color, size=size, role=role)


def pairs(things):
    return [(one, other) for one in things for other in things]


def ahead(score, fits, clear):
    """The object with the best score, and all objects with scores near it."""
    score = np.where(fits, score, -np.inf)
    return np.isfinite(score) & (score >= score.max() - clear)
