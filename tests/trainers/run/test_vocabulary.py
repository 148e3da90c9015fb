"""Policies keep working when words are added to the end of the vocabulary."""

import torch

from trainers.run.checkpoint import extend_vocabulary

WORDS = ["<pad>", "<unk>", "reach", "cube"]


def payload():
    weights = {
        "encoder.query_encoder.word_embedding.weight": torch.arange(8.0).reshape(4, 2),
        "actor.weight": torch.ones(4, 3),
    }
    return {"vocabulary": WORDS, "algorithm": {"policy": weights}}


def test_added_words_are_read_as_unknown_and_the_others_as_before():
    before = payload()
    after = extend_vocabulary(before, (*WORDS, "stack", "upon"))
    assert after["vocabulary"] == [*WORDS, "stack", "upon"]
    rows = after["algorithm"]["policy"]["encoder.query_encoder.word_embedding.weight"]
    old = before["algorithm"]["policy"]["encoder.query_encoder.word_embedding.weight"]
    assert torch.equal(rows[:4], old)
    assert torch.equal(rows[4:], old[[1, 1]])
    assert torch.equal(after["algorithm"]["policy"]["actor.weight"], torch.ones(4, 3))
    assert before["vocabulary"] == WORDS
    assert len(old) == 4


def test_another_vocabulary_is_left_for_the_check_to_refuse():
    for vocabulary in (WORDS, WORDS[:3], ["<pad>", "<unk>", "cube", "reach", "stack"]):
        before = payload()
        assert extend_vocabulary(before, vocabulary) is before
