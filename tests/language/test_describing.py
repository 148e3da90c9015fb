"""Describer and describe: unique phrases for objects of a scene."""

from collections import Counter

import numpy as np
import pytest

from language import (
    DEFAULT_KINDS,
    KINDS,
    Describer,
    Instruction,
    LanguageError,
    Object,
    ObjectPhrase,
    Scene,
    describe,
    ground,
    matches,
    parse,
    say,
)
from tests.helpers.language_cases import TABLE, random_scenes, scene

ONE_STEP = [kind for kind in KINDS if kind != "nested"]


def described(describer, scenes, seed=1):
    """(scene, referent, instruction) for every object that can be named."""
    rng = np.random.default_rng(seed)
    for each in scenes:
        for referent in np.flatnonzero(describer.nameable(each)).tolist():
            yield each, referent, describer.describe(each, referent, rng)


@pytest.mark.slow
@pytest.mark.parametrize("redundant", [False, True])
def test_a_generated_sentence_grounds_to_its_referent(redundant):
    for each, referent, instruction in described(Describer(KINDS, redundant=redundant), random_scenes(300)):
        assert parse(say(instruction)) == instruction
        assert ground(instruction, each) == referent
        assert matches(instruction.phrase, each).sum() == 1


@pytest.mark.slow
@pytest.mark.parametrize("redundant", [False, True])
def test_every_expression_with_up_to_one_relation_grounds_to_its_referent(redundant):
    for each in random_scenes(6, counts=[2, 4, 6]):
        expressions = Describer(KINDS, redundant=redundant).expressions(each)
        for kind in ONE_STEP:
            for referent in range(len(each)):
                for phrase in expressions.all(kind, referent):
                    understood = parse(f"reach {phrase}", each)
                    assert understood.meaning == Instruction("reach", phrase)
                    assert understood.steps[0].goal == referent


@pytest.mark.parametrize("depth", [2, 3])
def test_a_nested_phrase_grounds_to_its_referent(depth):
    rng, number = np.random.default_rng(0), 0
    for each in random_scenes(60, counts=[4, 6, 8]):
        expressions = Describer(redundant=True).expressions(each)
        for referent in np.flatnonzero(expressions.nameable_nested(depth)).tolist():
            phrase = expressions.draw_nested(depth, referent, rng)
            understood = parse(f"reach {phrase}", each)
            assert phrase.depth == depth
            assert understood.meaning.phrase == phrase
            assert understood.steps[0].goal == referent
            number += 1
    assert number > 100


@pytest.mark.parametrize("kind", KINDS)
def test_only_allowed_kinds_are_generated(kind):
    said = [instruction.kind for *_, instruction in described(Describer([kind]), random_scenes(100))]
    assert set(said) == {kind}
    assert len(said) > 20


def test_every_default_kind_occurs():
    kinds = Counter(instruction.kind for *_, instruction in described(Describer(), random_scenes(200)))
    assert set(kinds) == set(DEFAULT_KINDS)
    assert min(kinds.values()) > 20


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["relation", "superlative", "negation"])
def test_words_are_added_only_to_ambiguous_heads(kind):
    for each, referent, instruction in described(Describer([kind]), random_scenes(200)):
        phrase = instruction.phrase
        without = matches(ObjectPhrase(phrase.noun, phrase.color, size=phrase.size, role=phrase.role), each)
        assert without.sum() > 1
        assert without[referent]


def test_redundant_words_are_added_only_on_request():
    table = scene(("red cube", 0.0), ("blue sphere", 0.2))
    only, also = (Describer(redundant=more).expressions(table).all("relation", 0) for more in (False, True))
    assert {phrase.head for phrase in only} == {ObjectPhrase()}
    assert "the red cube right of the sphere" in map(str, also)


def test_anchors_are_named_by_colour_and_noun():
    for each, referent, instruction in described(Describer(["relation"]), random_scenes(200)):
        found = [int(matches(anchor, each).argmax()) for anchor in instruction.phrase.anchors]
        assert len({referent, *found}) == 1 + len(found)
        for anchor in instruction.phrase.anchors:
            assert anchor.kind in ("color", "shape", "color_shape")
            assert matches(anchor, each).sum() == 1


def test_kinds_words_and_expressions_are_drawn_uniformly():
    table = scene(("red cube", 0.0), ("blue sphere", 0.2))
    describer, rng = Describer(), np.random.default_rng(0)
    drawn = [describer.phrase(table, 0, rng) for _ in range(12000)]
    related = [phrase for phrase in drawn if phrase.kind == "relation"]
    words = Counter(phrase.relation for phrase in related)
    assert set(words) == {"right of", "nearest to", "farthest from"}
    for number, counts in ((4, Counter(p.kind for p in drawn)), (3, words), (9, Counter(related))):
        assert len(counts) == number  # each relation is said of the sphere, the blue object and the blue sphere
        for count in counts.values():
            assert count == pytest.approx(sum(counts.values()) / number, rel=0.25)


def test_indistinguishable_objects_are_not_nameable():
    table = scene(("red cube", 0.0), ("red cube", 0.02), ("blue sphere", 0.2))
    assert Describer().nameable(table).tolist() == [False, False, True]
    with pytest.raises(LanguageError, match="red cube, object 0"):
        Describer().describe(table, 0, np.random.default_rng(0))
    with pytest.raises(LanguageError, match="no phrase distinguishes the red cube, object 0"):
        describe(0, table)


@pytest.mark.parametrize(("index", "name"), [(0, "the red cube"), (2, "the blue sphere"), (4, "the yellow cylinder")])
def test_describe_returns_the_simplest_name(index, name):
    assert describe(index, TABLE) == describe(TABLE[index], TABLE) == name


def test_describe_distinguishes_an_object_from_a_target_of_the_same_look():
    table = Scene([Object("cube", "red", (0.4, y, 0.0), role=role) for y, role in ((0.0, "real"), (0.3, "target"))])
    names = [describe(index, table) for index in (0, 1)]
    assert names[1] == "the transparent red cube"
    assert [ground(parse(f"reach {name}"), table) for name in names] == [0, 1]


@pytest.mark.parametrize("missing", [7, -1, Object("cube", "pink", (0.0, 0.0, 0.0))])
def test_describing_an_object_outside_the_scene_raises(missing):
    with pytest.raises(LanguageError, match=r"not in the scene|out of range"):
        describe(missing, TABLE)


def test_the_same_seed_gives_the_same_sentences():
    scenes = random_scenes(30)
    one, other = ([say(said) for *_, said in described(Describer(), scenes, seed=5)] for _ in range(2))
    assert one == other


def test_a_describer_alternates_between_scenes_correctly():
    describer, scenes = Describer(), random_scenes(20, counts=[4])
    alone = [Describer().nameable(each).tolist() for each in scenes]
    describer.nameable(scenes[0])
    assert [describer.nameable(each).tolist() for each in scenes] == alone


@pytest.mark.parametrize(("kinds", "message"), [(["colour"], "did you mean 'color'"), ([], "kinds is empty")])
def test_wrong_kinds_are_refused(kinds, message):
    with pytest.raises(LanguageError, match=message):
        Describer(kinds)
