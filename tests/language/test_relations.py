"""Registries: each relation, superlative and noun is generated, parsed, grounded and tokenized."""

from functools import cache

import numpy as np
import pytest

from language import (
    DEVICES,
    FITTINGS,
    HAND,
    NOUNS,
    RELATIONS,
    SHAPES,
    SUPERLATIVES,
    Describer,
    Instruction,
    LanguageError,
    NotUnderstood,
    Object,
    ObjectPhrase,
    Scene,
    Tokenizer,
    ground,
    matches,
    parse,
    relation,
    say,
    superlative,
    unregister,
)
from tests.helpers.language_cases import answer, random_scenes, scene, steps

BLUE_SPHERE = ObjectPhrase("sphere", "blue")


@cache
def examples(kind):
    """For each relation or superlative, the scenes, referents and phrases in which it singles out one object."""
    found = {}
    for each in random_scenes(150, counts=[3, 4, 5], seed=8):
        expressions = Describer([kind]).expressions(each)
        for referent in range(len(each)):
            for phrase in expressions.all(kind, referent):
                found.setdefault(getattr(phrase, kind), []).append((each, referent, phrase))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "known"),
    [("relation", known) for known in RELATIONS.values()] + [("superlative", known) for known in SUPERLATIVES.values()],
    ids=lambda known: getattr(known, "phrase", ""),
)
def test_each_relation_and_superlative_matters_and_is_generated_parsed_and_grounded(kind, known):
    cases = examples(kind)[known.phrase]
    assert len(cases) > 10
    for each, referent, phrase in cases[:: len(cases) // 10]:
        without = ObjectPhrase(phrase.noun, phrase.color, size=phrase.size, role=phrase.role)
        assert matches(without, each).sum() > 1
        assert known.phrase in say(phrase)
        for words in (known.phrase, *known.synonyms):
            sentence = f"reach {phrase}".replace(known.phrase, words, 1)
            assert parse(sentence) == Instruction("reach", phrase)
            assert steps(sentence, each) == [("reach", None, referent)]
            assert Tokenizer.default().unknown_words(sentence) == ()


@pytest.mark.parametrize(
    "pair",
    [
        ("left of", "right of"),
        ("in front of", "behind"),
        ("above", "below"),
        ("nearest to", "farthest from"),
    ],
)
def test_opposite_relations_exclude_each_other(pair):
    one, other = (RELATIONS[phrase].margin for phrase in pair)
    here, there = np.array([[0.4, -0.1, 0.0], [0.5, 0.1, 0.1]])
    if pair[0] in ("above", "below"):
        there = np.array([0.4, -0.05, 0.1])
        assert one(here, there) == other(there, here) != one(there, here)
    else:
        assert one(here, there) == -other(here, there) != 0


@pytest.fixture
def beyond():
    relation("beyond", "further than")(lambda subject, anchor: subject[..., 0] - anchor[..., 0])
    yield "beyond"
    unregister("beyond")


@pytest.mark.slow
def test_a_registered_relation_is_said_parsed_grounded_tokenized_and_described(beyond):
    instruction = Instruction("reach", ObjectPhrase("cube", None, beyond, (BLUE_SPHERE,)))
    assert say(instruction) == "reach the cube beyond the blue sphere"
    assert parse(say(instruction)) == parse("touch the block further than the blue ball") == instruction
    assert Tokenizer.default().unknown_words("beyond further than") == ()
    twins = Scene(Object("cube", "red", (x, 0.0, 0.0)) for x in (0.3, 0.7))
    table = Scene([*twins, Object("sphere", "blue", (0.5, 0.0, 0.0))])
    said = {phrase.relation: phrase for phrase in Describer(["relation"]).expressions(table).all("relation", 1)}
    assert ground(Instruction("reach", said[beyond]), table) == 1


@pytest.mark.slow
def test_registered_two_anchor_relations_and_superlatives_are_used_everywhere():
    relation("opposite", anchors=2)(lambda subject, one, other: one[..., 0] + other[..., 0] - 2 * subject[..., 0])
    superlative("frontmost", "foremost")(lambda positions, sizes: -positions[..., 0])
    try:
        table = Scene(
            Object("cube", color, (x, 0.0, 0.0)) for color, x in (("red", 0.3), ("blue", 0.5), ("green", 0.7))
        )
        assert steps("reach the foremost cube", table) == [("reach", None, 0)]
        assert steps("reach the cube opposite the blue one and the green one", table) == [("reach", None, 0)]
        said = {phrase.superlative for phrase in Describer(["superlative"]).expressions(table).all("superlative", 0)}
        assert "frontmost" in said
    finally:
        unregister("opposite")
        unregister("frontmost")


@pytest.mark.slow
def test_a_relation_is_parsed_only_while_it_is_registered():
    sentence = "reach the cube seaward of the blue sphere"
    assert isinstance(answer(sentence), NotUnderstood)
    relation("seaward of")(lambda subject, anchor: subject[..., 0] - anchor[..., 0])
    assert parse(sentence).phrase.relation == "seaward of"
    unregister("seaward of")
    assert isinstance(answer(sentence), NotUnderstood)


@pytest.mark.parametrize(
    "register",
    [
        lambda: relation("port of", "left to"),
        lambda: superlative("foremost", "left"),
        lambda: relation("among", anchors=3),
        lambda: relation("most between", anchors=2, best=True),
    ],
)
def test_registering_taken_words_or_invalid_relations_is_refused(register):
    with pytest.raises(LanguageError):
        register()(lambda *positions: positions[0][..., 1])
    assert not {"port of", "foremost", "among", "most between"} & {*RELATIONS, *SUPERLATIVES}


def test_an_object_is_not_related_to_itself():
    table = scene(("red cube", 0.0), ("blue cube", 0.1), ("green cube", 0.5))
    assert steps("reach the cube near the red cube", table) == [("reach", None, 1)]
    said = [str(phrase) for phrase in Describer(["relation"]).expressions(table).all("relation", 1)]
    assert "the cube near the red cube" in said
    assert not any("near the blue" in words for words in said)


def test_every_noun_is_a_shape_a_device_or_a_fitting():
    assert (*SHAPES, *DEVICES, *FITTINGS, HAND) == tuple(NOUNS)


@pytest.mark.parametrize(("verb", "noun"), [("press", "button"), ("switch", "lever"), ("turn", "wheel")])
def test_devices_are_named_like_shapes(verb, noun):
    table = scene((f"red {noun}", 0.0), (f"blue {noun}", 0.2), ("red cube", 0.4))
    for word in (noun, *NOUNS[noun]):
        assert steps(f"{verb} the red {word}", table) == [(verb, None, 0)]
        assert steps(f"{verb} the {word} left of the red {word}", table) == [(verb, None, 1)]
    assert Tokenizer.default().unknown_words(" ".join(NOUNS[noun])) == ()


@pytest.mark.slow
def test_a_new_noun_needs_one_entry(monkeypatch):
    monkeypatch.setitem(NOUNS, "cone", ("pyramid",))
    instruction = parse("lift the gray pyramid")
    assert instruction == Instruction("lift", ObjectPhrase("cone", "gray"))
    assert parse(say(instruction)) == instruction
    assert ground(instruction, scene(("red cube", 0.0), ("gray cone", 0.1))) == 1


def test_a_phrase_with_invalid_characters_is_refused(monkeypatch):
    monkeypatch.setitem(NOUNS, "cone2", ())
    with pytest.raises(LanguageError, match="write it with the letters a to z"):
        parse("reach the cube")
