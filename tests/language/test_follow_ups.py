"""Turns that go on from the ones before: both, again with another thing, too far, tags, what was done, what is held."""

import pytest

from language import Answer, Refusal, Signal
from tests.helpers.room_cases import BLUE, NAMES, RED, outcome_of, room

STACKED = "put the blue cube on the yellow cube / "
MOVED = "move the yellow cube to the left / "


def moved(outcome):
    """The names of the things that are put somewhere, in order."""
    return [NAMES[step.object] for step in outcome.steps if step.carries]


def left_of(outcome):
    """How far the thing that is put last goes to the left from where it was at the start of the turns, in metres."""
    step = outcome.steps[-1]
    return step.place[1] - room().things[step.object].y


@pytest.mark.parametrize("them", ["move them to the left", "move both to the left", "take both over to the left"])
def test_both_are_the_two_things_of_the_last_turn(them):
    assert moved(outcome_of(STACKED + them)) == ["blue", "yellow"]


def test_it_is_not_put_beside_itself():
    last = outcome_of("put the red cube on the blue cube / put it beside it").steps[-1]
    assert last.object == RED
    assert abs(last.place[0] - 0.44) + abs(last.place[1] + 0.18) < 0.15


def test_the_same_again_is_done_with_another_thing():
    outcome = outcome_of("put the red cube down in front of the blue one / and again but with the yellow one")
    assert moved(outcome) == ["yellow"]


@pytest.mark.parametrize("reply", ["not so far", "too far, come back a little", "too much", "move it back a tiny bit"])
def test_what_went_too_far_comes_back_a_part_of_the_way(reply):
    assert 0.005 < left_of(outcome_of(MOVED + reply)) < left_of(outcome_of(MOVED.removesuffix(" / ")))


def test_what_was_said_corrects_the_side():
    assert left_of(outcome_of(MOVED + "I said right")) < 0.06


@pytest.mark.parametrize(
    "it", ["actually leave it next to the red one", "take it off and leave it next to the red one"]
)
def test_what_is_left_beside_something_goes_there(it):
    assert moved(outcome_of(STACKED + it))[-1] == "blue"


def test_what_is_let_go_is_put_down():
    assert moved(outcome_of("let it go", room(held=RED))) == ["red"]


def test_any_but_one_chooses_among_the_others():
    (step,) = outcome_of("pick up the cube / any except the yellow one").steps
    assert step.object in (BLUE, RED)


@pytest.mark.parametrize(
    ("question", "told"),
    [
        ("the red cube is in the drawer, right?", "No: the red cube is on the table"),
        ("you're not holding anything, are you?", "No: My gripper is empty"),
        ("isn't there a red cube somewhere?", "Yes: the red cube"),
        ("got anything in the fridge?", "No: nothing"),
        ("who has the red cube?", "The red cube is on the table"),
        ("how do I say that you should stop?", "Say 'stop'"),
        ("would another cube fit in the drawer?", "Yes, that can be done"),
        ("tell me when you are ready", "Yes, I am ready"),
        ("what happens next?", "Nothing"),
    ],
)
def test_a_question_without_a_question_word_is_answered(question, told):
    outcome = outcome_of(question)
    assert isinstance(outcome, Answer)
    assert outcome.text.startswith(told)


@pytest.mark.parametrize(
    ("turns", "told"),
    [
        ("press the button / have you pressed it yet?", "Yes"),
        ("press the button / have you moved the red cube?", "No"),
        ("press the button / open the drawer / what did you do? / and before that?", "I did this: press"),
        ("press the button / open the drawer / how many things have you done so far?", "I did 2 things"),
    ],
)
def test_what_was_done_is_told(turns, told):
    assert outcome_of(turns).text.startswith(told)


@pytest.mark.parametrize(("condition", "number"), [("if that worked", 1), ("if it didn't work", 0)])
def test_a_condition_may_be_whether_the_last_plan_was_carried_out(condition, number):
    assert len(getattr(outcome_of(f"press the button / {condition}, open the drawer"), "steps", ())) == number


def test_a_warning_with_what_may_happen_is_a_signal():
    outcome = outcome_of(STACKED + "careful, it's going to fall")
    assert isinstance(outcome, Signal)
    assert outcome.control == "slower"


@pytest.mark.parametrize(
    "what", ["put the thing you are holding down", "drop what you hold", "put what is in your hand on red"]
)
def test_an_empty_gripper_is_the_reason_that_is_given(what):
    outcome = outcome_of(what)
    assert isinstance(outcome, Refusal)
    assert "nothing is in my gripper" in outcome.text


def test_what_is_unstacked_is_not_what_is_held():
    assert moved(outcome_of(STACKED + "pick up the red cube / unstack it again")) == ["red", "blue"]


@pytest.mark.parametrize(
    ("turns", "taken"),
    [
        ("pick up the cube on the right / i meant on the left", "red"),
        ("pick up the right cube / no, the left", "red"),
        ("pick up the cube on the far left / sorry i meant the far right", "blue"),
    ],
)
def test_a_side_that_is_corrected_is_that_of_the_thing_which_was_named_by_it(turns, taken):
    last = outcome_of(turns).steps[-1]
    assert last.takes
    assert NAMES[last.object] == taken


def test_a_side_is_a_place_where_the_thing_was_not_named_by_it():
    assert moved(outcome_of("pick up the blue cube / i meant to the left")) == ["blue"]
