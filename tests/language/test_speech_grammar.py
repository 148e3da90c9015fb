"""What can be said aloud in a scene."""

from __future__ import annotations

import numpy as np
import pytest

from language import Object, Scene, interpret
from language.outcomes import Refusal
from language.sampling import sample
from language.sentence_graph import sentence_graph
from language.speech_grammar import speech_grammar, spoken_words

SCENE = Scene(
    [
        Object("cube", "red", (0.5, 0.1, 0.02)),
        Object("cube", "blue", (0.4, -0.1, 0.02)),
        Object("sphere", "gray", (0.5, -0.2, 0.02)),
        Object("drawer", "orange", (0.3, -0.4, 0.1)),
        Object("button", "purple", (0.6, 0.3, 0.02)),
        Object("cube", "green", (0.4, 0.2, 0.02), role="target"),
    ]
)
SPOKEN = (
    "reach the red cube",
    "pick up the ball and put it on the blue cube",
    "open the drawer then put the gray ball in it",
    "please press the purple button",
    "put the red cube to the left of the sphere",
    "take the leftmost solid cube",
    "no the blue one",
    "stop",
    "go on",
    "undo",
    "what do you see",
    "put it in the back right corner",
)


@pytest.fixture(scope="module")
def graph():
    return sentence_graph(speech_grammar(SCENE))


@pytest.mark.parametrize("sentence", SPOKEN)
def test_what_people_say_can_be_spoken(graph, sentence):
    assert graph.accepts(sentence)


@pytest.mark.parametrize("sentence", SPOKEN[:6])
def test_what_can_be_spoken_is_understood(sentence):
    assert not isinstance(interpret(sentence, SCENE), Refusal)


def test_names_are_those_of_the_scene(graph):
    for sentence in ("reach the pink cube", "reach the cylinder", "switch the lever", "open the fridge"):
        assert not graph.accepts(sentence)


def test_only_who_points_says_this():
    assert sentence_graph(speech_grammar(SCENE, points=True)).accepts("reach this")
    assert not sentence_graph(speech_grammar(SCENE, points=False)).accepts("reach this")


def test_the_generators_sentences_can_be_spoken(graph):
    for drawn in sample(100, np.random.default_rng(0), SCENE, depth=0):
        negates = "not" in drawn.sentence or "n't" in drawn.sentence
        if not negates and drawn.command.steps[0].task in ("reach", "pick_and_place", "stack", "grasp", "lift"):
            assert graph.accepts(drawn.sentence.replace(",", "")), drawn.sentence


def test_the_words_of_a_grammar_are_listed():
    words = spoken_words(speech_grammar(SCENE))
    assert {"red", "cube", "rightmost", "stop", "undo"} <= words
    assert not {"thing>", "pink", "public", "said"} & words
