"""Questions that compare things: sizes, distances, likeness and numbers."""

import pytest

from language import Answer, Dialogue, Object, Refusal, Scene, table
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


def test_the_middle_one_of_a_row_is_in_the_middle_from_left_to_right():
    cubes = [
        Object("cube", c, (x, y, 0.025)) for c, x, y in (("red", 0.3, 0.0), ("blue", 0.45, 0.1), ("cyan", 0.4, 0.2))
    ]
    outcome = Dialogue().answer("which one is in the middle?", table(Scene(cubes)))
    assert outcome.text.startswith("The blue cube")


def test_the_highest_of_several_stacks_is_named():
    heights = [("red", 0.3, 0), ("blue", 0.3, 1), ("cyan", 0.4, 0), ("pink", 0.4, 1), ("green", 0.4, 2)]
    cubes = [Object("cube", color, (x, 0.1, 0.025 + 0.05 * level)) for color, x, level in heights]
    outcome = Dialogue().answer("which stack is the highest now?", table(Scene(cubes)))
    assert outcome.text == "That of the green cube, the pink cube and the cyan cube, which is 3 high."
