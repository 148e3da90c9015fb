"""Sentences of which only a part is understood are not acted on: words that limit, lengths, conditions, signals."""

import pytest

from language import Dialogue, Plan, Question, Refusal, Signal
from tests.helpers.room_cases import BLUE, DRAWER, FRIDGE, MARK, NAMES, OBJECTS, RED, YELLOW
from tests.helpers.room_cases import room as room_of

OBJECTS_WITHOUT_MARK = OBJECTS[:MARK]


def room(**facts):
    return room_of(OBJECTS_WITHOUT_MARK, **facts)


def steps(sentence, world=None):
    outcome = Dialogue().answer(sentence, world or room())
    assert isinstance(outcome, Plan), outcome
    return [(step.verb, NAMES[step.object], None if step.goal is None else NAMES[step.goal]) for step in outcome.steps]


def answer(sentence, **facts):
    return Dialogue().answer(sentence, room(**facts))


@pytest.mark.parametrize(
    "sentence",
    [
        "I've burnt my fingers, put some ice in my palm, hurry!",
        "The lamp in the hall comes on with that button, and it's dark out there, so go on.",
        "don't give me the blue cube but put it in the drawer",
        "hold on to the yellow cube and open the drawer",
    ],
)
def test_a_signal_within_a_longer_sentence_is_none(sentence):
    assert not isinstance(answer(sentence), Signal)


@pytest.mark.parametrize("sentence", ["stop it, or else", "hold on a second", "don't", "stop! leave the red cube"])
def test_a_stop_counts_whatever_follows_it(sentence):
    assert answer(sentence).control in ("stop", "wait")


@pytest.mark.parametrize(
    "sentence",
    [
        "press neither the button nor the lever",
        "not the red, not the blue - the other one on the right side please grab",
        "have the button pressed by nobody",
        "keep the yellow cube in the gripper while you also pick up blue",
        "put the red cube in the drawer, that is if it is open",
        "pull the handle until the drawer is fully open",
    ],
)
def test_a_word_that_limits_is_never_left_out(sentence):
    assert isinstance(answer(sentence, held=YELLOW), Refusal | Question)


@pytest.mark.parametrize(
    ("sentence", "expected"),
    [
        ("neither the button nor the drawer, just pull the lever", [("switch", "lever", None)]),
        ("instead of the button switch the lever", [("switch", "lever", None)]),
        ("rather than opening the drawer open the fridge", [("open", "fridge", None)]),
    ],
)
def test_what_is_excluded_first_is_not_done(sentence, expected):
    assert steps(sentence) == expected


def test_what_follows_but_is_done_instead():
    world = room(open=frozenset((DRAWER, FRIDGE)))
    assert steps("don't put the red cube in the drawer but in the fridge", world)[-1] == ("put_in", "red", "fridge")


def test_a_word_that_may_be_either_of_two_verbs_is_asked_about():
    assert isinstance(answer("clothes the fridge", open=frozenset([FRIDGE])), Question)


def test_a_length_that_cannot_be_kept_leads_to_no_other_place():
    assert isinstance(answer("move the blue cube 15 cm to your right"), Refusal)


def test_a_list_as_the_answer_to_a_question_is_not_cut_to_one_thing():
    dialogue = Dialogue()
    assert isinstance(dialogue.answer("pick up the cube", room()), Question)
    assert not isinstance(dialogue.answer("red and blue"), Plan)


def test_both_is_not_cut_to_the_one_that_was_spoken_of():
    dialogue, world = Dialogue(), room()
    dialogue.answer("pick up the red cube", world)
    dialogue.answer("put it on the blue cube")
    outcome = dialogue.answer("put both on the left")
    assert not isinstance(outcome, Plan) or {RED, BLUE} <= {step.object for step in outcome.steps}


def test_which_is_farthest_is_never_answered_with_none():
    assert "The blue cube is" in answer("which one of the solid blocks is the furthest from you?").message
