"""What an episode asks for: sentences keep their full length."""

from dataclasses import replace

import numpy as np
import pytest

from envs.mdp.goals import in_bytes, sentence_bytes
from language import MAX_WORDS, LanguageError, Tokenizer, parse
from language.tokenizer import count_words
from tests.helpers.env_cases import make, task_of

VARIED_RELATIONS = ["task.kinds=[relation]", "task.varied=true"]
LONGEST = (
    "pick the solid object between the pink cube and the purple cube and place it to the same position as "
    "the transparent object between the purple cube and the pink object, please"
)


def test_a_sentence_of_175_bytes_is_observed_whole():
    assert (len(LONGEST), count_words(LONGEST)) == (175, MAX_WORDS)
    env = make("kuka", "step", "nl_pick_and_place", *VARIED_RELATIONS)
    td = env.start([replace(env.task.draw(np.random.default_rng(0)), sentence=LONGEST)], seed=0)
    observed = bytes(td["privileged", "sentence"][0].numpy()).rstrip(b"\0").decode()
    assert observed == env.sentence() == LONGEST
    assert parse(observed) == parse(LONGEST)
    assert env.tokenizer.decode(td["instruction"][0]) == LONGEST.replace(",", "")
    env.close()


def test_drawn_sentences_fit_the_tokens_and_the_bytes():
    task, tokenizer, rng = (
        task_of("nl_pick_and_place", *VARIED_RELATIONS),
        Tokenizer.default(),
        np.random.default_rng(0),
    )
    for _ in range(300):
        sentence = task.draw(rng).sentence
        tokenizer.encode(sentence)
        assert bytes(in_bytes(sentence, sentence_bytes(tokenizer))).rstrip(b"\0").decode() == sentence


def test_every_sentence_of_known_words_fits():
    tokenizer = Tokenizer.default()
    longest = max(tokenizer.vocabulary, key=len)
    in_bytes(", ".join([longest] * MAX_WORDS), sentence_bytes(tokenizer))


def test_a_sentence_that_does_not_fit_is_an_error():
    assert bytes(in_bytes("reach", 8)) == b"reach\0\0\0"
    with pytest.raises(LanguageError, match="a sentence has 5 bytes; at most 4 fit"):
        in_bytes("reach", 4)
