"""Random wordings of a meaning."""

import numpy as np
import pytest

from language import HeldOut, Instruction, LanguageError, ObjectPhrase, Split, Wording, parse, say
from language.tokenizer import count_words
from tests.helpers.language_cases import PLACES, steps

TOUCH = parse("reach the gray sphere left of the cube")
HELD_OUT = HeldOut(phrases=("ball", "to the left of", "touch {object}", "grey"))
WORDS = ("ball", "to the left of", "touch", "grey")


def said(wording, meaning, number=300, seed=0):
    rng = np.random.default_rng(seed)
    return [wording.say(meaning, rng) for _ in range(number)]


def test_every_synonym_is_drawn():
    sentences = " ".join(said(Wording(), TOUCH, 600))
    for word in (
        "reach",
        "touch",
        "go to",
        "grey",
        "gray",
        "sphere",
        "ball",
        "box",
        "block",
        "left to",
        "to the left of",
    ):
        assert f"{word} " in sentences
    for polite in ("please", "could you", "thanks"):
        assert polite in sentences


@pytest.mark.slow
def test_all_wordings_have_the_same_meaning():
    for sentence in said(Wording(), TOUCH):
        assert parse(sentence) == TOUCH
    for sentence in said(Wording(), parse("pick the green cube and place it to the transparent cube")):
        assert steps(sentence, PLACES) == [("pick_and_place", 1, 3)]


def test_the_same_seed_gives_the_same_words():
    assert said(Wording(), TOUCH, 50, seed=4) == said(Wording(), TOUCH, 50, seed=4)
    assert said(Wording(), TOUCH, 50, seed=4) != said(Wording(), TOUCH, 50, seed=5)


@pytest.mark.parametrize("name", ["train", "test_length", "test_composition"])
def test_held_out_phrases_occur_in_test_paraphrase_only(name):
    split = Split(name, HeldOut((("red", "cube"),), (), HELD_OUT.phrases))
    for sentence in said(Wording(split), TOUCH):
        assert not any(word in sentence for word in WORDS)


def test_test_paraphrase_always_contains_a_held_out_phrase():
    for sentence in said(Wording(Split("test_paraphrase", HELD_OUT)), TOUCH):
        assert any(word in sentence for word in WORDS)
        assert parse(sentence) == TOUCH


def test_the_standard_sentence_never_contains_a_held_out_phrase():
    assert not any(word in say(TOUCH) for word in WORDS)


def test_test_paraphrase_without_a_possible_phrase_raises():
    wording = Wording(Split("test_paraphrase", HeldOut(phrases=("grey",))))
    with pytest.raises(LanguageError, match="cannot be said with a held-out phrase"):
        wording.say(parse("lift the red cube"), np.random.default_rng(0))


def test_holding_out_the_standard_template_is_refused():
    with pytest.raises(LanguageError, match=r"'poke \{object\}' is the standard phrase"):
        HeldOut(phrases=("poke {object}",))
    held_out = HeldOut(phrases=("nudge {object}", "nudge {object} {goal}"))
    cube, wording = ObjectPhrase("cube"), Wording(Split("train", held_out))
    for instruction in (Instruction("poke", cube), Instruction("poke", cube, cube)):
        assert all("poke" in sentence for sentence in said(wording, instruction, 40))


def test_phrases_have_no_polite_words():
    phrases = said(Wording(), ObjectPhrase("sphere", "gray"))
    assert set(phrases) == {f"the {color} {noun}" for color in ("gray", "grey") for noun in ("sphere", "ball")}


def test_a_limit_of_words_is_kept_and_changes_no_shorter_sentence():
    meaning = parse("pick the red cube left of the blue sphere and place it to the same position as the green cube")
    free, limited = (Wording(max_words=limit) for limit in (None, 18))
    sentences = [
        [wording.say(meaning, np.random.default_rng(seed)) for seed in range(60)] for wording in (free, limited)
    ]
    assert max(map(count_words, sentences[0])) > 18 >= max(map(count_words, sentences[1]))
    for one, other in zip(*sentences, strict=True):
        assert one == other or count_words(one) > 18
    with pytest.raises(LanguageError, match="in at most 3 words"):
        Wording(max_words=3).say(meaning, np.random.default_rng(0))
