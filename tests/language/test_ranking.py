"""Questions that choose one of some things, which are named or were spoken of, and what "it" means afterwards."""

import pytest

from language import Answer, Plan
from tests.helpers.room_cases import BLUE, CYAN, ORANGE, RED, WHEEL, YELLOW, larger_room, outcome_of


def told(turns):
    """The things that the answer to the last turn is about."""
    outcome = outcome_of(turns, larger_room())
    assert isinstance(outcome, Answer), outcome
    return outcome.about


@pytest.mark.parametrize(
    ("question", "thing"),
    [
        ("which one is further left, red or cyan?", RED),
        ("which is more to the right: the blue one or the yellow one?", BLUE),
        ("which cube is closer to the wheel, the orange or the cyan?", CYAN),
        ("what is closer to the wheel, yellow or cyan?", CYAN),
        ("wich one is more to the left, yelow or blue", YELLOW),
        ("of red and blue, which is nearer to the drawer?", BLUE),
        ("red or blue - which one is nearer to the drawer?", BLUE),
        ("is red or blue closer to the drawer?", BLUE),
        ("which of red, yellow and blue is furthest from you?", BLUE),
        ("which is nearer the wheel, yellow or red?", YELLOW),
    ],
)
def test_one_of_the_named_things_is_chosen(question, thing):
    assert told(question) == (thing,)


@pytest.mark.parametrize(
    ("turns", "thing"),
    [
        ("which cubes are there? / which of them is the closest to you?", YELLOW),
        ("which cubes are there? / and which one is closest to you?", YELLOW),
        ("put the red cube next to the orange one / which of the two is nearer to the drawer?", ORANGE),
        ("where is the red cube? / and where is the blue one? / of these two, which one is further left?", RED),
        ("put the red cube on the blue one / which of those is higher up?", RED),
    ],
)
def test_they_are_the_things_that_were_spoken_of_and_no_fixed_ones(turns, thing):
    assert told(turns) == (thing,)


def test_the_answer_is_what_that_one_means_and_the_rest_is_the_other_one():
    asked = "which is closer to the yellow cube, orange or red? / "
    for turn, thing in (("touch that one", ORANGE), ("then take that one", ORANGE), ("take the other one", RED)):
        outcome = outcome_of(asked + turn, larger_room())
        assert isinstance(outcome, Plan)
        assert [step.object for step in outcome.steps] == [thing]


def test_what_was_compared_with_is_it_beside_the_thing_itself():
    asked = "which cube is closer to the cyan one, the yellow or the red? / "
    outcome = outcome_of(asked + "move the yellow one even closer to it", larger_room())
    x, y = outcome.steps[-1].place
    assert outcome.steps[-1].object == YELLOW
    assert abs(x - 0.46) + abs(y - 0.04) < 0.13


def test_a_distance_is_told_to_what_was_asked_for():
    assert "from the red wheel" in outcome_of("which is closer to the wheel, blue or cyan?", larger_room()).text
    assert WHEEL not in told("which is closer to the wheel, blue or cyan?")
