"""Fusion of words and pointing: the phrase of a sentence, and probabilities of objects."""

import numpy as np
import pytest

from human import NothingPointedAt, fuse, referring_phrase
from language import LanguageError, NotUnderstood, Object, ObjectPhrase, Scene

SCENE = Scene(Object(noun, color, (0.4, 0.0, 0.0)) for noun, color in (("cube", "red"), ("cube", "blue")))


def test_the_phrase_of_the_last_step_is_returned():
    assert referring_phrase("reach that red one") == ObjectPhrase(color="red", determiner="that")
    assert referring_phrase("lift the cube, then reach the ball") == ObjectPhrase(noun="sphere")


def test_a_correction_is_refused_with_an_error_for_the_user():
    with pytest.raises(LanguageError, match="'no, the blue one' is a correction"):
        referring_phrase("no, the blue one")


def test_a_sentence_outside_the_grammar_is_refused():
    with pytest.raises(NotUnderstood):
        referring_phrase("paint the cube")


def test_probabilities_are_those_of_the_ray_where_the_words_fit():
    np.testing.assert_allclose(
        fuse(ObjectPhrase(noun="cube", determiner="that"), SCENE, np.array([0.2, 0.6])), [0.25, 0.75]
    )
    np.testing.assert_allclose(fuse(ObjectPhrase(color="red"), SCENE, np.array([0.1, 0.9])), [1, 0])


def test_words_that_fit_no_object_the_ray_allows_are_refused():
    with pytest.raises(NothingPointedAt, match="nothing that fits 'the red object'"):
        fuse(ObjectPhrase(color="red"), SCENE, np.array([0.0, 1.0]))
