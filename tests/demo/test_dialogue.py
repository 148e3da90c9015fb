"""Dialogues about one scene: instructions, questions and answers, corrections, nonsense."""

import pytest

from demo.dialogue import MAX_CHARACTERS, Dialogue
from language import Object, Scene

RED_CUBE, BLUE_CUBE, RED_BALL = range(3)
SCENE = Scene(
    [
        Object("cube", "red", (0.4, 0.1, 0.025)),
        Object("cube", "blue", (0.4, -0.1, 0.025)),
        Object("sphere", "red", (0.5, 0.2, 0.025)),
    ]
)


def no_gestures(count):
    return ()


def result_of(*sentences, pointed=no_gestures):
    """The interpretation of the last sentence."""
    dialogue = Dialogue()
    return [dialogue.hear(sentence, SCENE, pointed) for sentence in sentences][-1]


def goals(result):
    assert result.understood is not None, result.message
    return [step.goal for step in result.understood.steps]


@pytest.mark.parametrize(
    ("sentences", "objects"),
    [
        (["reach the blue cube"], [BLUE_CUBE]),
        (["reach the red cube", "no, the blue one"], [BLUE_CUBE]),
        (["reach the cube", "the blue one"], [BLUE_CUBE]),
        (["reach the cube", "blue"], [BLUE_CUBE]),
        (["reach the red object", "sphere"], [RED_BALL]),
        (["reach the cube", "reach the sphere"], [RED_BALL]),  # an instruction instead of an answer
        (["reach the cube", "what?", "the red one"], [RED_CUBE]),
        (["reach the sphere then reach the red cube"], [RED_BALL, RED_CUBE]),
        (["reach the cube then reach the sphere", "blue cube"], [BLUE_CUBE, RED_BALL]),
        (["reach the sphere then reach the cube", "the red one"], [RED_BALL, RED_CUBE]),
    ],
)
def test_the_last_sentence_of_a_dialogue_is_understood(sentences, objects):
    assert goals(result_of(*sentences)) == objects


def test_an_ambiguous_sentence_gets_a_question_with_its_candidates():
    result = result_of("reach the cube")
    assert result.understood is None
    assert result.message == "Do you mean the red cube or the blue cube?"
    assert (result.candidates, result.position) == ((RED_CUBE, BLUE_CUBE), len("reach "))


def test_a_gesture_gives_the_referent_of_this():
    assert goals(result_of("reach this", pointed=lambda count: [RED_BALL][:count])) == [RED_BALL]


@pytest.mark.parametrize(
    "sentence", ["hello", "reach the", "<script>alert(1)</script>", "reach the green cube", "\0", "no"]
)
def test_a_sentence_that_is_not_understood_gets_a_message_and_keeps_the_previous_one(sentence):
    dialogue = Dialogue()
    before = dialogue.hear("reach the red cube", SCENE, no_gestures).understood
    result = dialogue.hear(sentence, SCENE, no_gestures)
    assert result.understood is None
    assert result.message
    assert dialogue.previous is before


def test_a_preview_changes_nothing():
    dialogue = Dialogue()
    dialogue.hear("reach the cube", SCENE, no_gestures)
    assert goals(dialogue.preview("the red one", SCENE, no_gestures)) == [RED_CUBE]
    assert dialogue.previous is None


def test_long_sentences_are_cut():
    assert len(result_of("reach " * 10_000).sentence) == MAX_CHARACTERS


def test_a_wish_for_speed_is_answered_with_where_to_set_it():
    assert "under Time" in Dialogue().hear("go faster please", SCENE, no_gestures).message
