from collections import Counter

import numpy as np
import pytest
from language_cases import random_scenes, scene

from language import KINDS, Describer, LanguageError, ground, matches, parse, say
from language.generator import ABSENT, CLEAR
from language.relations import RELATIONS


def described(describer, scenes, seed=1):
    """(scene, referent, instruction) for every object that can be named."""
    rng = np.random.default_rng(seed)
    for each in scenes:
        for referent in np.flatnonzero(describer.nameable(each)).tolist():
            yield each, referent, describer.describe(each, referent, rng)


def test_a_generated_sentence_is_understood_as_its_referent():
    for each, referent, instruction in described(Describer(), random_scenes(400)):
        assert parse(say(instruction)) == instruction
        assert ground(instruction, each) == referent
        assert matches(instruction.phrase, each).sum() == 1


def test_every_kind_occurs():
    kinds = Counter(instruction.kind for *_, instruction in described(Describer(), random_scenes(200)))
    assert set(kinds) == set(KINDS)
    assert min(kinds.values()) > 20


@pytest.mark.parametrize("kind", KINDS)
def test_only_allowed_kinds_are_said(kind):
    said = [instruction.kind for *_, instruction in described(Describer([kind]), random_scenes(100))]
    assert set(said) == {kind}


def test_a_relation_is_said_only_where_the_rest_is_ambiguous():
    for each, referent, instruction in described(Describer(["relation"]), random_scenes(300)):
        without = matches(instruction.phrase.head, each)
        assert without.sum() > 1
        assert without[referent]


def test_a_relation_is_seen_from_one_other_object():
    for each, referent, instruction in described(Describer(["relation"]), random_scenes(300)):
        anchor = instruction.phrase.anchor
        assert anchor.kind in ("color", "shape", "color_shape")
        assert matches(anchor, each).sum() == 1
        assert not matches(anchor, each)[referent]


def test_a_relation_is_clear_and_never_borderline():
    for each, referent, instruction in described(Describer(["relation"]), random_scenes(300)):
        phrase = instruction.phrase
        anchor = int(np.argmax(matches(phrase.anchor, each)))
        margins = RELATIONS[phrase.relation].margin(each.positions, each.positions[anchor])
        others = matches(phrase.head, each)
        others[[referent, anchor]] = False
        assert margins[referent] > CLEAR
        assert (margins[others] < ABSENT).all()


def test_an_object_is_nameable_just_where_some_sentence_names_it():
    for each in random_scenes(60, counts=range(1, 5), seed=3):
        for kind in KINDS:
            named = Describer([kind]).nameable(each).tolist()
            expressions = _expressions(each, kind)
            assert named == [any(_names(each, k, words) for words in expressions) for k in range(len(each))]


def _expressions(each, kind):
    """Every phrase of the kind that could be said of the scene, written out by hand."""
    colors, nouns = {thing.color for thing in each}, {thing.noun for thing in each}
    plain = {
        "color": [f"the {color} object" for color in colors],
        "shape": [f"the {noun}" for noun in nouns],
        "color_shape": [f"the {color} {noun}" for color in colors for noun in nouns],
    }
    if kind != "relation":
        return plain[kind]
    anchors = [phrase for phrases in plain.values() for phrase in phrases]
    heads = ["the object", *anchors]
    return [f"{head} {word} {anchor}" for head in heads for word in RELATIONS for anchor in anchors]


def _names(each, referent, words):
    phrase = parse(f"reach {words}").phrase
    if phrase.relation is None:
        return np.flatnonzero(matches(phrase, each)).tolist() == [referent]
    anchors = np.flatnonzero(matches(phrase.anchor, each)).tolist()
    rivals = matches(phrase.head, each)
    if len(anchors) != 1 or anchors == [referent] or rivals.sum() < 2 or not rivals[referent]:
        return False
    margins = RELATIONS[phrase.relation].margin(each.positions, each.positions[anchors[0]])
    rivals[[referent, *anchors]] = False
    return bool(margins[referent] > CLEAR and (margins[rivals] < ABSENT).all())


def test_kinds_and_expressions_are_drawn_evenly():
    table = scene(("red cube", 0.0), ("blue sphere", 0.2))
    rng = np.random.default_rng(0)
    said = Counter(say(Describer().describe(table, 0, rng)) for _ in range(4000))
    related = [count for words, count in said.items() if "right of" in words]
    assert len(related) == 3  # the object right of: the sphere, the blue object, the blue sphere
    plain = [said[f"reach the {name}"] for name in ("red object", "cube", "red cube")]
    for count in (*plain, sum(related)):
        assert 850 < count < 1150
    assert min(related) > 260


def test_twins_that_stand_side_by_side_are_not_nameable():
    table = scene(("red cube", 0.0), ("red cube", 0.02), ("blue sphere", 0.2))
    assert Describer().nameable(table).tolist() == [False, False, True]
    with pytest.raises(LanguageError, match="red cube, object 0"):
        Describer().describe(table, 0, np.random.default_rng(0))


def test_the_same_seed_gives_the_same_sentences():
    scenes = random_scenes(30)
    one, other = ([say(said) for *_, said in described(Describer(), scenes, seed=5)] for _ in range(2))
    assert one == other


def test_scenes_asked_in_turn_do_not_mix():
    describer, scenes = Describer(), random_scenes(20, counts=[4])
    alone = [Describer().nameable(each).tolist() for each in scenes]
    describer.nameable(scenes[0])
    assert [describer.nameable(each).tolist() for each in scenes] == alone


@pytest.mark.parametrize(("kinds", "message"), [(["colour"], "did you mean 'color'"), ([], "kinds is empty")])
def test_wrong_kinds_are_refused(kinds, message):
    with pytest.raises(LanguageError, match=message):
        Describer(kinds)
