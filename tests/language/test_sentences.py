"""Saying and parsing are one another's inverse."""

import string

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from language_cases import instructions, scene

from language import (
    COLORS,
    NOUNS,
    RELATIONS,
    TEMPLATES,
    Describer,
    Instruction,
    LanguageError,
    NotUnderstood,
    Object,
    ObjectPhrase,
    Scene,
    Tokenizer,
    ground,
    parse,
    relation,
    say,
    unregister,
)
from language.lexicon import lexicon

BLUE_SPHERE = ObjectPhrase("sphere", "blue")


@given(instructions)
def test_what_is_said_is_understood(instruction):
    assert parse(say(instruction)) == instruction


@pytest.mark.parametrize(
    ("phrase", "words", "kind"),
    [
        (ObjectPhrase(), "reach the object", "object"),
        (ObjectPhrase(color="red"), "reach the red object", "color"),
        (ObjectPhrase("cube"), "reach the cube", "shape"),
        (ObjectPhrase("cube", "red"), "reach the red cube", "color_shape"),
        (
            ObjectPhrase(relation="left of", anchor=BLUE_SPHERE),
            "reach the object left of the blue sphere",
            "relation",
        ),
    ],
)
def test_each_kind_says_itself(phrase, words, kind):
    instruction = Instruction("reach", phrase)
    assert say(instruction) == words
    assert instruction.kind == phrase.kind == kind


@pytest.mark.parametrize(
    "sentence",
    [
        "touch the red block left of the blue ball",
        "go to the red box to the left of the blue sphere",
        "Please reach the red cube left to the blue sphere.",
        "please, reach the red cube left of the blue sphere, please!",
        "  REACH\tthe   Red cube\nleft of the blue sphere ?!  ",
    ],
)
def test_other_ways_to_say_it_mean_the_same(sentence):
    assert parse(sentence) == parse("reach the red cube left of the blue sphere")


@pytest.mark.parametrize("word", ["object", "one", "thing"])
def test_any_noun_has_several_words(word):
    assert parse(f"reach the red {word}").phrase == ObjectPhrase(color="red")


def test_a_relation_belongs_to_the_nearest_object():
    phrase = parse("reach the cube left of the sphere right of the cylinder").phrase
    assert phrase.anchor == ObjectPhrase("sphere", None, "right of", ObjectPhrase("cylinder"))


@pytest.mark.parametrize(
    ("sentence", "position", "expects", "hint"),
    [
        ("reach the rred cube", 10, "red", "did you mean 'red'"),
        ("reach the red cube left off the ball", 24, "of", "did you mean 'of'"),
        ("Rech the red cube", 0, "reach", "did you mean 'reach'"),
        ("reach the red", 13, "cube", "ends too early"),
        ("reach red cube", 6, "the", "Expected here: the"),
        ("reach the cube cube", 15, "left", "the end of the sentence"),
        ("", 0, "reach", "ends too early"),
    ],
)
def test_a_sentence_outside_the_grammar_is_told_where_and_what_was_meant(sentence, position, expects, hint):
    with pytest.raises(NotUnderstood, match=hint) as caught:
        parse(sentence)
    assert caught.value.position == position
    assert expects in caught.value.expected


def test_an_overlong_sentence_is_refused():
    with pytest.raises(NotUnderstood, match="at most 1000"):
        parse("reach the " + "red " * 1_000_000 + "cube")


def parse_or_error(text):
    try:
        return parse(text)
    except LanguageError as error:
        return error


LEXICON_WORDS = st.sampled_from([*lexicon().words(), ",", ".", "!", "-", "\x00", "'"])


@settings(max_examples=300)
@given(st.text(max_size=60) | st.lists(LEXICON_WORDS | st.text(max_size=5), max_size=40).map(" ".join))
def test_any_text_gives_an_instruction_or_a_language_error(text):
    answer = parse_or_error(text)
    if isinstance(answer, Instruction):
        assert parse(say(answer)) == answer
    else:
        assert len(str(answer)) < 1000


@given(st.text(alphabet=string.printable, max_size=1100))
def test_long_noise_gives_an_instruction_or_a_language_error(text):
    assert len(str(parse_or_error(text))) < 1000


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ObjectPhrase("kube"), "did you mean 'cube'"),
        (lambda: ObjectPhrase(color="yelow"), "did you mean 'yellow'"),
        (lambda: ObjectPhrase(relation="left off", anchor=BLUE_SPHERE), "did you mean 'left of'"),
        (lambda: ObjectPhrase(relation="left of"), "give both or none"),
        (lambda: Instruction("reech", ObjectPhrase()), "did you mean 'reach'"),
    ],
)
def test_an_instruction_that_could_not_be_said_cannot_be_made(make, message):
    with pytest.raises(LanguageError, match=message):
        make()


@pytest.fixture
def beyond():
    relation("beyond", "further than")(lambda subject, anchor: subject[..., 0] - anchor[..., 0])
    yield "beyond"
    unregister("beyond")


def test_a_registered_relation_is_said_parsed_grounded_tokenized_and_described(beyond):
    instruction = Instruction("reach", ObjectPhrase("cube", None, beyond, BLUE_SPHERE))
    assert say(instruction) == "reach the cube beyond the blue sphere"
    assert parse(say(instruction)) == parse("touch the block further than the blue ball") == instruction
    assert Tokenizer.default().unknown_words("beyond further than") == ()
    twins = Scene(Object("cube", "red", (x, 0.0, 0.0)) for x in (0.3, 0.7))
    table = Scene([*twins, Object("sphere", "blue", (0.5, 0.0, 0.0))])
    described = Describer(["relation"]).describe(table, 1, np.random.default_rng(0))
    assert described.phrase.relation == beyond
    assert ground(described, table) == 1


def test_a_relation_is_not_understood_before_it_is_registered_nor_after_it_is_forgotten():
    sentence = "reach the cube seaward of the blue sphere"
    assert isinstance(parse_or_error(sentence), NotUnderstood)
    relation("seaward of")(lambda subject, anchor: subject[..., 0] - anchor[..., 0])
    assert parse(sentence).phrase.relation == "seaward of"
    unregister("seaward of")
    assert isinstance(parse_or_error(sentence), NotUnderstood)


@pytest.fixture
def near():
    relation("near")(lambda subject, anchor: 0.2 - np.linalg.norm(subject - anchor, axis=-1))
    yield "near"
    unregister("near")


def test_nothing_is_beside_itself_even_where_a_relation_holds_both_ways(near):
    table = scene(("red cube", 0.0), ("blue cube", 0.1), ("green cube", 0.5))
    assert ground(parse("reach the cube near the red cube"), table) == 1
    describer, rng = Describer(["relation"]), np.random.default_rng(0)
    said = {say(describer.describe(table, 1, rng)) for _ in range(100)}
    assert "reach the cube near the red cube" in said
    assert not any("near the blue" in words for words in said)


def test_words_that_mean_a_relation_cannot_mean_another():
    with pytest.raises(LanguageError, match="already"):
        relation("port of", "left to")(lambda subject, anchor: subject[..., 1])


def test_a_new_colour_noun_and_verb_are_one_line_each(monkeypatch):
    monkeypatch.setitem(COLORS, "grey", (0.5, 0.5, 0.5, 1.0))
    monkeypatch.setitem(NOUNS, "cone", ("pyramid",))
    monkeypatch.setitem(TEMPLATES, "push", ("push {object}", "shove {object} away"))
    instruction = parse("shove the grey pyramid away")
    assert instruction == Instruction("push", ObjectPhrase("cone", "grey"))
    assert parse(say(instruction)) == instruction
    assert ground(instruction, scene(("red cube", 0.0), ("grey cone", 0.1))) == 1
    assert Tokenizer.default().unknown_words("push shove away grey cone pyramid") == ()


def test_every_relation_tells_two_sides_apart():
    for known in RELATIONS.values():
        here, there = scene(("red cube", -0.1), ("red cube", 0.1)).positions
        assert known.margin(here, there) == -known.margin(there, here) != 0
