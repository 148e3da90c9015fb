"""Held-out words and pairs are excluded from training and required by their test splits."""

import numpy as np
import pytest

from language import KINDS, Describer, HeldOut, Instruction, LanguageError, Split, ground
from tests.helpers.language_cases import random_scenes

HELD_OUT = HeldOut(
    color_noun=(("red", "cube"), ("blue", "sphere"), ("gray", "cylinder"), ("green", "cube")),
    relation_noun=(("left of", "cube"), ("near", "sphere"), ("between", "cylinder")),
    phrases=("ball",),
)
NEVER = ("train", "test_length", "test_paraphrase")


def described(split, kinds=KINDS, number=120):
    """(scene, referent, phrase) for every object that can be named, several times."""
    describer, rng = Describer(kinds, split, redundant=True), np.random.default_rng(0)
    for each in random_scenes(number, counts=[3, 5, 7], seed=1):
        for referent in np.flatnonzero(describer.nameable(each)).tolist():
            for _ in range(4):
                yield each, referent, describer.phrase(each, referent, rng)


def held_out(phrase):
    """The pairs in it that are held out."""
    pairs = [(part.color, part.noun) for part in phrase.parts() if (part.color, part.noun) in HELD_OUT.color_noun]
    return pairs + [
        (part.relation, part.noun) for part in phrase.parts() if (part.relation, part.noun) in HELD_OUT.relation_noun
    ]


@pytest.mark.slow
@pytest.mark.parametrize("name", NEVER)
def test_train_never_contains_a_held_out_pair(name):
    said = [phrase for *_, phrase in described(Split(name, HELD_OUT))]
    assert len(said) > 1000
    assert not any(map(held_out, said))
    assert {phrase.kind for phrase in said} == set(KINDS)


@pytest.mark.slow
def test_test_composition_always_contains_a_held_out_pair():
    said = [phrase for *_, phrase in described(Split("test_composition", HELD_OUT))]
    assert len(said) > 500
    assert all(map(held_out, said))
    assert {pair for phrase in said for pair in held_out(phrase)} == {*HELD_OUT.color_noun, *HELD_OUT.relation_noun}


def test_without_a_split_held_out_and_other_pairs_occur():
    said = [bool(held_out(phrase)) for *_, phrase in described(Split("all", HELD_OUT), number=30)]
    assert True in said
    assert False in said


@pytest.mark.parametrize("name", [*NEVER, "test_composition"])
def test_phrases_of_every_split_are_unique(name):
    for each, referent, phrase in described(Split(name, HELD_OUT), number=20):
        assert ground(Instruction("reach", phrase), each) == referent


@pytest.mark.parametrize("depth", [2, 3])
@pytest.mark.parametrize("name", ["train", "test_composition"])
def test_nested_phrases_stay_within_the_split(name, depth):
    rng, split = np.random.default_rng(0), Split(name, HELD_OUT)
    said = []
    for each in random_scenes(40, counts=[5, 7], seed=4):
        expressions = Describer(split=split, redundant=True).expressions(each)
        for referent in np.flatnonzero(expressions.nameable_nested(depth)).tolist():
            phrase = expressions.draw_nested(depth, referent, rng)
            assert phrase.depth == depth
            said.append(bool(held_out(phrase)))
    assert len(said) > 50
    assert set(said) == {name == "test_composition"}


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: HeldOut(color_noun=(("rad", "cube"),)), "did you mean 'red'"),
        (lambda: HeldOut(relation_noun=(("left of", "cub"),)), "did you mean 'cube'"),
        (lambda: HeldOut(relation_noun=(("left off", "cube"),)), "did you mean 'left of'"),
        (lambda: HeldOut(phrases=("bal",)), "did you mean 'ball'"),
        (lambda: HeldOut(phrases=("sphere",)), "hold out a synonym"),
        (lambda: Split("training"), "did you mean 'train'"),
        (lambda: Split("test_composition"), "needs color_noun or relation_noun"),
        (lambda: Split("test_paraphrase"), "needs phrases"),
    ],
)
def test_an_invalid_split_is_refused(make, message):
    with pytest.raises(LanguageError, match=message):
        make()
