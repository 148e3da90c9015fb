"""Questions that compare things: sizes, distances, likeness and numbers."""

import pytest

from language import Answer, Dialogue, Object, Refusal
from tests.helpers.room_cases import larger_room as room


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        ("which is bigger, the red cube or the drawer?", "The blue drawer: "),
        ("is the drawer larger than the yellow cube?", "Yes: "),
        ("is the yellow cube bigger than the blue cube?", "No: the yellow cube is 5 cm wide."),
        ("is the yellow cube as big as the red one?", "Yes: the yellow cube is 5 cm wide."),
        ("what is the biggest thing here?", "The blue drawer and the red fridge are equally large."),
        ("are all the cubes the same size?", "Yes: each is 5 cm wide."),
        ("are the red and the blue cube the same color?", "No: the red cube is red; the blue cube is blue."),
        ("do you have more cubes than wheels?", "Yes: "),
        ("are there fewer cubes than drawers?", "No: "),
    ],
)
def test_sizes_likeness_and_numbers_are_compared(question, answer):
    outcome = Dialogue().answer(question, room())
    assert isinstance(outcome, Answer)
    assert outcome.text.startswith(answer)


def test_the_largest_of_different_cubes_is_named_alone():
    world = room(Object("cube", "green", (0.4, -0.3, 0.035), size=0.07))
    for question in ("which cube is the biggest?", "what's the largest cube?"):
        assert Dialogue().answer(question, world).text == "The green cube is 7 cm wide."
    assert Dialogue().answer("is the green cube the biggest one?", world).text.startswith("Yes: ")


@pytest.mark.parametrize(
    ("question", "named"),
    [
        ("which cube is nearest to the lever?", "cube"),
        ("what is the closest cube to the lever?", "cube"),
        ("what's the leftmost cube?", "red cube"),
    ],
)
def test_what_is_nearest_or_outermost_is_a_thing_of_the_kind_that_was_named(question, named):
    outcome = Dialogue().answer(question, room())
    assert isinstance(outcome, Answer)
    assert named in outcome.text.partition(" is ")[0]


def test_the_outermost_thing_of_a_kind_is_confirmed():
    assert Dialogue().answer("is the red cube the leftmost one?", room()).text.startswith("Yes: ")
    assert Dialogue().answer("is the blue cube the leftmost one?", room()).text.startswith("No: ")


def test_nobody_claims_to_know_weights():
    assert isinstance(Dialogue().answer("what's the heaviest cube?", room()), Refusal)
