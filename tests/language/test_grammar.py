"""`say` and `parse` are inverse to each other."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from language import Instruction, ObjectPhrase, Wording, parse, say
from tests.helpers.language_cases import meanings

seeds = st.integers(0, 2**32 - 1)


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(meanings)
def test_parse_inverts_say(meaning):
    assert parse(say(meaning)) == meaning


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(meanings, seeds)
def test_parse_inverts_say_in_any_wording(meaning, seed):
    sentence = Wording().say(meaning, np.random.default_rng(seed))
    assume(len(sentence) <= 1000)  # what is longer is refused
    assert parse(sentence) == meaning


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(meanings)
def test_parsed_phrases_have_their_positions_in_the_sentence(meaning):
    sentence = say(meaning)
    for instruction in getattr(parse(sentence), "steps", ()):
        for part in (*instruction.phrase.parts(), *(instruction.goal.parts() if instruction.goal else ())):
            assert sentence[part.position :].startswith(str(part))


@pytest.mark.parametrize(
    "sentence",
    [
        "touch the red block left of the blue ball",
        "go to the red box to the left of the blue sphere",
        "Please reach the red cube left to the blue sphere.",
        "please, reach the red cube left of the blue sphere, please!",
        "Could you please touch the red cube that is left of the blue ball?",
        "now reach the red cube which is to the left of the blue sphere, thank you.",
        "I want you to reach for the red cube on the left of the blue sphere",
        "  REACH\tthe   Red cube\nleft of the blue sphere ?!  ",
        "hey robot, move to the red cube left of the blue sphere now",
    ],
)
def test_alternative_sentences_have_the_same_meaning(sentence):
    assert parse(sentence) == parse("reach the red cube left of the blue sphere")


@pytest.mark.parametrize("word", ["object", "one", "thing"])
def test_generic_nouns_are_parsed(word):
    assert parse(f"reach the red {word}").phrase == ObjectPhrase(color="red")


@pytest.mark.parametrize("mark", ["isn't", "isn\u2019t", "ISN'T"])
def test_both_apostrophes_are_accepted(mark):
    assert parse(f"reach the cube that {mark} red") == parse("reach the cube that is not red")


def test_a_relation_attaches_to_the_nearest_object():
    phrase = parse("reach the cube left of the sphere right of the cylinder").phrase
    assert phrase.anchors == (ObjectPhrase("sphere", None, "right of", (ObjectPhrase("cylinder"),)),)


def test_between_takes_the_nearest_and():
    phrase = parse("reach the cube between the ball between this and that and the tin").phrase
    inner = ObjectPhrase("sphere", None, "between", (ObjectPhrase(determiner="this"), ObjectPhrase(determiner="that")))
    assert phrase.anchors == (inner, ObjectPhrase("cylinder"))


def test_a_longer_phrase_gives_way_to_a_shorter_one_where_the_rest_needs_it():
    """ "at the top" may follow "the left thing", but then "solid object" would be left over."""
    meaning = parse("shove the left thing at the top solid object")
    assert meaning == Instruction(
        "push", ObjectPhrase(superlative="leftmost"), ObjectPhrase(role="real", superlative="highest")
    )
    assert parse("go to the thing at the top").phrase.superlative == "highest"
