"""Several things, one after the other in the order that is said."""

import pytest

from language import Dialogue, Object, Plan, Refusal, Scene, table

RED, BLUE, GREEN, YELLOW, PINK = range(5)
SCENE = Scene(
    [
        Object("sphere", "red", (0.50, 0.20, 0.025)),
        Object("sphere", "blue", (0.42, -0.15, 0.025)),
        Object("sphere", "green", (0.53, 0.0, 0.025)),
        Object("cube", "yellow", (0.40, 0.10, 0.025)),
        Object("cube", "pink", (0.47, -0.25, 0.025)),
    ],
    "human",
)
WORLD = table(SCENE, verbs=("reach",))


@pytest.mark.parametrize(
    ("sentence", "order"),
    [
        ("touch all three balls, one after the other from left to right", [BLUE, GREEN, RED]),
        ("from right to left, touch every ball", [RED, GREEN, BLUE]),
        ("go to each of the cubes, starting with the closest", [YELLOW, PINK]),
        ("touch the three things closest to you, nearest first", [YELLOW, BLUE, PINK]),
        ("touch the balls one by one, the nearest to me first", [GREEN, RED, BLUE]),
        ("touch the balls in this order: green, red, blue", [GREEN, RED, BLUE]),
        ("touch the balls, the red one last", [BLUE, GREEN, RED]),
        ("touch all the balls starting with the green one and ending with the red one", [GREEN, BLUE, RED]),
        ("touch everything from left to right except the cubes", [BLUE, GREEN, RED]),
    ],
)
def test_several_things_are_reached_in_the_order_that_is_said(sentence, order):
    outcome = Dialogue().answer(sentence, WORLD)
    assert isinstance(outcome, Plan)
    assert [step.object for step in outcome.steps] == order


def test_an_order_that_begins_with_none_of_the_things_is_refused():
    outcome = Dialogue().answer("touch all the cubes, the red ball first", WORLD)
    assert isinstance(outcome, Refusal)
    assert "red ball" in outcome.text
    assert len(outcome.suggestions) == 2


@pytest.mark.parametrize(
    ("sentence", "order"),
    [
        ("go to all the balls one after the other, start with the one on the left", [BLUE, GREEN, RED]),
        ("beginning with the red ball, touch every ball", [RED, BLUE, GREEN]),
        ("touch each ball and finish with the blue one", [RED, GREEN, BLUE]),
        ("reach for every ball, leaving the red one for last", [BLUE, GREEN, RED]),
        ("go to the balls, first the green one, then the others", [GREEN, RED, BLUE]),
    ],
)
def test_an_order_is_said_before_or_after_what_is_done(sentence, order):
    test_several_things_are_reached_in_the_order_that_is_said(sentence, order)
