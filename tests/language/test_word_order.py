"""Token ids of existing words do not change when words are added."""

from dataclasses import replace

from language import COLORS, NOUNS, VERBS, Color, Tokenizer, relation, unregister
from language.tokenizer import WORD_ORDER

TOKENIZER = Tokenizer.default()


def test_the_ids_of_existing_words_never_change():
    """Literal values: pretrained policies and recorded data sets store these ids."""
    ids = {"reach": 2, "it": 13, "red": 42, "cube": 57, "leftmost": 81, "between": 118, "hey": 143, "but": 153}
    assert {word: TOKENIZER.vocabulary.index(word) for word in ids} == ids
    assert TOKENIZER.vocabulary[2 : 2 + len(WORD_ORDER)] == WORD_ORDER


def test_new_words_get_ids_after_all_existing_ones(monkeypatch):
    relation("to the north of")(lambda referent, anchor: referent[..., 0] - anchor[..., 0])
    try:
        monkeypatch.setitem(COLORS, "brown", Color((0.5, 0.25, 0.0)))
        monkeypatch.setitem(NOUNS, "pyramid", ("spire",))
        monkeypatch.setitem(VERBS, "kick", replace(VERBS["push"], templates=("kick {object}",)))
        grown = Tokenizer.default().vocabulary
    finally:
        unregister("to the north of")
    assert grown[: len(TOKENIZER.vocabulary)] == TOKENIZER.vocabulary
    assert set(grown[len(TOKENIZER.vocabulary) :]) == {"north", "brown", "pyramid", "spire", "kick"}
