"""Sentences as vectors of floats."""

import numpy as np

from language import COLORS, NOUNS, SentenceEmbedding, Tokenizer
from language.embedding import LATE, PHRASE_WIDTH, PHRASES

TOKENIZER = Tokenizer.default()
EMBED = SentenceEmbedding(TOKENIZER)


def embedded(*sentences):
    return EMBED(np.stack([TOKENIZER.encode(sentence) for sentence in sentences]))


def phrases(sentence):
    return embedded(sentence)[0, : PHRASES * PHRASE_WIDTH].reshape(PHRASES, PHRASE_WIDTH)


def test_phrases_have_the_colours_and_nouns_that_are_said_in_them():
    first, second, third = phrases("reach the violet ball left of the object")
    assert first[0] == first[1] == 1
    np.testing.assert_allclose(first[2:5], COLORS["purple"].rgb)
    assert first[5:].tolist() == [float(noun == "sphere") for noun in NOUNS]
    assert second.tolist() == [1.0] + [0.0] * (PHRASE_WIDTH - 1)
    assert not third.any()


def test_who_is_left_of_whom_is_told():
    one, other = embedded("reach the red cube left of the blue ball", "reach the blue ball left of the red cube")
    assert (one != other).any()
    assert ((one[PHRASES * PHRASE_WIDTH :] > 0) == (other[PHRASES * PHRASE_WIDTH :] > 0)).all()


def test_words_count_less_the_later_they_are_said():
    vector = embedded("reach the red cube")[0, PHRASES * PHRASE_WIDTH :]
    said = [vector[TOKENIZER.vocabulary.index(word)] for word in ("reach", "the", "red", "cube")]
    assert said[0] == 1
    assert said == sorted(said, reverse=True)
    assert min(said) > LATE
    assert (vector > 0).sum() == 4


def test_no_words_give_zeros_and_every_word_a_number_in_the_bounds():
    blank = EMBED(np.zeros((2, TOKENIZER.length), np.int64))
    assert blank.shape == (2, EMBED.width)
    assert blank.dtype == np.float32
    assert not blank.any()
    longest = EMBED(np.arange(TOKENIZER.length)[None] + 20)
    assert longest.min() >= 0
    assert longest.max() <= 1
