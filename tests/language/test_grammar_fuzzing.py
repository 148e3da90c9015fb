"""Any input is parsed or raises one of the three errors."""

import string

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from language import NothingFits, NotUnderstood, SeveralFit, Tokenizer, Understood, parse, say
from tests.helpers.language_cases import TABLE, answer, meanings

WORDS = st.sampled_from([*Tokenizer.default().vocabulary[2:], ",", ".", "!", "?", "-", "\x00", "'", "\u202e", "\ud800"])
HOSTILE = st.text(max_size=60) | st.text(st.characters(categories=["Cs", "Cc", "Cf", "Mn", "Lo"]), max_size=40)


def check(sentence):
    got = answer(sentence, TABLE)
    assert isinstance(got, Understood | NotUnderstood | NothingFits | SeveralFit)
    if isinstance(got, Understood):
        assert len(say(got.meaning)) > 1000 or parse(say(got.meaning)) == got.meaning
    else:
        assert 0 <= got.position <= len(sentence)
        assert 0 < len(str(got)) < 1000
        str(got).encode()  # so that it can be printed


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(HOSTILE | st.lists(WORDS | st.text(max_size=5), max_size=40).map(" ".join))
def test_any_text_is_parsed_or_raises_one_of_the_three_errors(text):
    check(text)


@settings(max_examples=50, deadline=None)
@given(st.text(alphabet=string.printable, max_size=1100))
def test_long_noise_is_parsed_or_raises_one_of_the_three_errors(text):
    check(text)


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(meanings.map(say), st.data())
def test_a_corrupted_sentence_is_parsed_or_raises_one_of_the_three_errors(sentence, data):
    words = sentence.split(" ")
    at = data.draw(st.integers(0, len(words) - 1))
    check(sentence[: data.draw(st.integers(0, len(sentence)))])
    check(" ".join(words[:at] + words[at + 1 :]))
    check(" ".join(data.draw(st.permutations(words))))


def test_the_deepest_nesting_within_the_length_limit_is_handled():
    for nest in ("the one by " * 89 + "it", "the one between " * 30 + "the red cube" + " and the sphere" * 30):
        check(f"reach {nest}")
    check("after you " * 90 + "reach the ball")
    check(" and ".join(["lift the sphere"] * 45))
    check("no " * 300 + "the ball")
