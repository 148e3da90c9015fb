"""Tokenizer and vocabulary."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings

from language import COLORS, KINDS, Color, Describer, LanguageError, Tokenizer, Wording, say
from tests.helpers.language_cases import meanings, random_scenes

TOKENIZER = Tokenizer.default()
LONG = Tokenizer.default(length=300)


def test_the_vocabulary_is_the_same_each_time_and_holds_each_word_once():
    assert Tokenizer.default() == TOKENIZER
    assert TOKENIZER.vocabulary[:2] == ("<pad>", "<unk>")
    assert len(set(TOKENIZER.vocabulary)) == len(TOKENIZER.vocabulary)


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(meanings)
def test_the_vocabulary_contains_every_word_of_say(meaning):
    words = say(meaning)
    assert TOKENIZER.unknown_words(words) == ()
    assert LONG.decode(LONG.encode(words)) == words.replace(",", "")


def test_generated_sentences_fit_the_default_length():
    rng, describer = np.random.default_rng(0), Describer(KINDS)
    for each in random_scenes(100):
        for referent in np.flatnonzero(describer.nameable(each)):
            sentence = Wording().say(describer.describe(each, referent, rng), rng)
            assert TOKENIZER.unknown_words(sentence) == ()
            TOKENIZER.encode(sentence)


def test_ids_are_padded_with_zeros():
    tokens = TOKENIZER.encode("reach the cube")
    assert tokens.dtype == np.int64
    assert tokens.shape == (32,)
    assert (tokens[:3] > 1).all()
    assert (tokens[3:] == 0).all()


def test_cached_ids_are_read_only():
    with pytest.raises(ValueError, match="read-only"):
        TOKENIZER.encode("reach the cube")[0] = 5


def test_unknown_words_are_encoded_as_unk_and_reported():
    assert TOKENIZER.unknown_words("Reach the mauve cube, quickly!") == ("mauve", "quickly")
    assert TOKENIZER.decode(TOKENIZER.encode("reach the mauve cube")) == "reach the <unk> cube"


def test_capitals_and_punctuation_are_ignored():
    assert (TOKENIZER.encode("Reach  the CUBE!") == TOKENIZER.encode("reach the cube")).all()


def test_a_sentence_that_is_too_long_is_refused():
    with pytest.raises(LanguageError, match="33 words; at most 32"):
        TOKENIZER.encode("red " * 33)


@pytest.mark.parametrize("token", [-1, 10_000])
def test_an_id_outside_the_vocabulary_is_refused(token):
    with pytest.raises(LanguageError, match=f"token {token} is out of range"):
        TOKENIZER.decode([token])


def test_a_stored_vocabulary_equals_the_present_one():
    TOKENIZER.check_same(list(TOKENIZER.vocabulary))
    assert pickle.loads(pickle.dumps(TOKENIZER)) == TOKENIZER


def test_different_vocabularies_are_reported_with_their_words():
    other = ["crimson" if word == "red" else word for word in TOKENIZER.vocabulary]
    with pytest.raises(LanguageError, match="only this one has 'red'; only the other has 'crimson'"):
        TOKENIZER.check_same(other)


def test_a_different_order_is_reported_with_its_first_difference():
    other = list(TOKENIZER.vocabulary)
    place = other.index("red")
    other[place], other[place + 1] = other[place + 1], other[place]
    with pytest.raises(LanguageError, match=f"word {place} is 'red' in this one and 'green' in the other"):
        TOKENIZER.check_same(other)


def test_a_new_colour_changes_the_vocabulary(monkeypatch):
    monkeypatch.setitem(COLORS, "brown", Color((0.5, 0.25, 0.0)))
    with pytest.raises(LanguageError, match="only the other has 'brown'"):
        TOKENIZER.check_same(Tokenizer.default().vocabulary)


@pytest.mark.parametrize("vocabulary", [("the",), ("<pad>", "<unk>", "a", "a")])
def test_an_invalid_vocabulary_is_refused(vocabulary):
    with pytest.raises(LanguageError, match="<pad>"):
        Tokenizer(vocabulary)
