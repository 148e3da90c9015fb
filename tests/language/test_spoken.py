"""Sentences whose speaker begins again."""

import pytest

from language.spoken import fluent


@pytest.mark.parametrize(
    ("sentence", "said"),
    [
        ("is the, is the fridge open", "is the fridge open"),
        ("um where's, where's the blue cube", "um where's the blue cube"),
        ("put the... put the cube down", "put the cube down"),
        ("I want, I want the red one", "I want the red one"),
    ],
)
def test_what_was_begun_before_is_left_out(sentence, said):
    assert fluent(sentence) == said


@pytest.mark.parametrize("sentence", ["stop, stop", "cyan on red, red on blue", "stack yellow on red, red on gray"])
def test_what_is_said_twice_for_a_reason_stays(sentence):
    assert fluent(sentence) == sentence
