"""Gestures in people's sentences: "this", "that", "here" and "there" mean what is pointed at."""

import pytest

from language import Dialogue, Gesture, LanguageError, Object, Plan, Question, Refusal, Scene, board, interpret

RED, BLUE, BALL, PLACE = range(4)
TABLE = Scene(
    [
        Object("cube", "red", (0.5, 0.15, 0.025)),
        Object("cube", "blue", (0.6, 0.0, 0.025)),
        Object("sphere", "green", (0.45, -0.15, 0.025)),
        Object("cube", "yellow", (0.6, -0.25, 0.025), role="target"),
    ]
)


def steps(sentence, pointed, scene=TABLE):
    outcome = interpret(sentence, scene, pointed=pointed)
    assert isinstance(outcome, Plan), outcome
    return [(step.verb, step.object, step.goal) for step in outcome.steps]


@pytest.mark.parametrize(
    "sentence", ["put that one there", "pls put that one over there", "this block on that one plz"]
)
def test_each_pointing_word_takes_the_next_gesture(sentence):
    assert steps(sentence, [RED, BLUE]) == [("lift", RED, None), ("stack", RED, BLUE)]


def test_a_pointed_see_through_object_is_a_place():
    outcome = interpret("pls put that one there", TABLE, pointed=[RED, PLACE])
    assert outcome.steps[1].place == (0.6, -0.25)
    assert outcome.steps[1].goal == 3


def test_a_gesture_may_show_a_free_place():
    outcome = interpret("put that one over there", TABLE, pointed=[RED, Gesture(place=(0.4, 0.0))])
    assert outcome.steps[1].place == (0.4, 0.0)


def test_the_last_gesture_serves_for_further_words():
    assert steps("take this and put this on the blue block", [RED])[1] == ("stack", RED, BLUE)


def test_words_choose_among_what_a_gesture_may_show():
    assert steps("pls take that cube", [(BALL, BLUE)]) == [("lift", BLUE, None)]


def test_a_gesture_that_may_show_several_things_is_asked_about():
    outcome = interpret("pls grab this", TABLE, pointed=[(RED, BLUE)])
    assert isinstance(outcome, Question)
    assert outcome.candidates == (RED, BLUE)


def test_words_that_contradict_a_gesture_are_refused_with_what_it_shows():
    sentence = "pls take that cube"
    outcome = interpret(sentence, TABLE, pointed=[BALL])
    assert isinstance(outcome, Refusal)
    assert outcome.text == "'that cube': the gesture shows the green sphere"
    assert sentence[slice(*outcome.span)] == "that cube"


def test_a_gesture_relates_other_things_to_what_it_shows():
    assert steps("take the thing that is left of this", [BLUE])[0][1:] == (RED, None)


def test_that_in_a_relative_clause_needs_no_gesture():
    assert steps("put this on top of the cube that is blue", [RED])[1] == ("stack", RED, BLUE)


def test_a_gesture_answers_a_question():
    dialogue = Dialogue()
    assert isinstance(dialogue.answer("take the cube", TABLE), Question)
    answer = dialogue.answer("that one", TABLE, pointed=[BLUE])
    assert [step.object for step in answer.steps] == [BLUE]


def test_a_correction_keeps_the_gestures_of_the_sentence_that_it_corrects():
    dialogue = Dialogue()
    dialogue.answer("pls put this block over there", TABLE, pointed=[RED, PLACE])
    outcome = dialogue.answer("no, the blue one", TABLE)
    assert (outcome.steps[-1].object, outcome.steps[-1].place) == (BLUE, (0.6, -0.25))


def test_without_a_gesture_the_place_is_asked_for():
    outcome = interpret("put the red cube over there", TABLE)
    assert isinstance(outcome, Question)
    assert outcome.text.startswith("Where shall I put")


def test_gestures_work_on_a_board():
    world = board([("cube", "red", 1, 1, 0), ("cube", "blue", 5, 5, 0)])
    assert steps("put this on top of that", [0, 1], world) == [("lift", 0, None), ("stack", 0, 1)]


def test_an_index_that_the_scene_lacks_is_an_error():
    with pytest.raises(LanguageError, match=r"pointed=\[9\] is out of range: the scene has 4 objects"):
        interpret("take this", TABLE, pointed=[9])
