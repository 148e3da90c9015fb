"""Phrases that say which of several things are meant, before and after the noun."""

import pytest

from language import Plan
from tests.helpers.room_cases import (
    BLUE,
    BUTTON,
    CYAN,
    DRAWER,
    FRIDGE,
    LEVER,
    ORANGE,
    RED,
    WHEEL,
    YELLOW,
    asked_steps,
    larger_room,
    outcome_of,
)


def done(sentence):
    outcome = outcome_of(sentence, larger_room())
    assert isinstance(outcome, Plan), outcome
    return asked_steps(outcome)


def touched(sentence):
    steps = done(sentence)
    assert all(verb == "reach" for verb, _ in steps), steps
    return [thing for _, thing in steps]


@pytest.mark.parametrize(
    ("sentence", "thing"),
    [
        ("touch the cube furthest to the right", BLUE),
        ("touch the block that stands most to the left", RED),
        ("touch the right-most of the cubes", BLUE),
        ("touch the nearest of the red and blue cubes", RED),
        ("touch the block that is furthest to your left", RED),
        ("touch the cube that lies all the way over on the right", BLUE),
        ("touch the cube with the smallest distance to the fridge", RED),
        ("touch the block you are closest to", YELLOW),
        ("of the cubes on the left touch the one that is closest to the fridge", RED),
        ("touch the cube between the orange and cyan cubes", YELLOW),
        ("touch the brick you find between orange and cyan", YELLOW),
        ("touch the cube that has orange on one side and cyan on the other", YELLOW),
        ("touch the cube that is flanked by cyan and orange", YELLOW),
        ("touch the block with the orange and the cyan one as neighbours", YELLOW),
        ("between the orange and cyan cubes there's a cube, touch it", YELLOW),
        ("touch the cube that is more to the right than all the others", BLUE),
        ("touch the cube the drawer is closest to", BLUE),
    ],
)
def test_which_thing_is_said_after_the_noun(sentence, thing):
    assert touched(sentence) == [thing]


@pytest.mark.parametrize(
    ("sentence", "things"),
    [
        ("touch every cube but red, cyan and orange", {YELLOW, BLUE}),
        ("touch all the cubes except the blue one and the red one", {YELLOW, ORANGE, CYAN}),
        ("touch all cubes and leave out the yellow one", {BLUE, RED, ORANGE, CYAN}),
        ("touch the cubes, just not the yellow one", {BLUE, RED, ORANGE, CYAN}),
        ("except for yellow and red, touch all the blocks", {BLUE, ORANGE, CYAN}),
        ("touch each block, the cyan and orange ones excluded", {YELLOW, BLUE, RED}),
        ("do not touch the red cube but touch all the others", {YELLOW, BLUE, ORANGE, CYAN}),
        ("leave the cyan cube alone and touch all the other cubes", {YELLOW, BLUE, RED, ORANGE}),
        ("touch any two of the blocks which are not yellow and not blue", {RED, ORANGE}),
    ],
)
def test_what_is_excluded_is_not_touched(sentence, things):
    assert set(touched(sentence)) == things


def test_an_exclusion_after_the_place_is_none_of_the_place():
    moved = {thing for _, thing in done("put all cubes on the left side, only not the blue and the red one")}
    assert moved == {YELLOW, ORANGE, CYAN}


@pytest.mark.parametrize(
    ("sentence", "things"),
    [
        ("touch red", [RED]),
        ("tap blue first and red second", [BLUE, RED]),
        ("touch the cubes: red, blue and cyan", [RED, BLUE, CYAN]),
        ("first the yellow cube, then the cyan one: touch both", [YELLOW, CYAN]),
        ("touch cyan, and when you have done that, red", [CYAN, RED]),
        ("each cube should be touched except the cyan one", [YELLOW, BLUE, RED, ORANGE]),
        ("the lever should be touched", [LEVER]),
        ("put your fingers on the wheel", [WHEEL]),
        ("go to the button and leave it unpressed", [BUTTON]),
        ("touch the wheel, no turning", [WHEEL]),
    ],
)
def test_a_wish_to_touch_is_one(sentence, things):
    assert touched(sentence) == things


@pytest.mark.parametrize(
    "sentence", ["was the red cube touched", "the red cube should not be touched", "touch all but two cubes"]
)
def test_what_is_asked_or_forbidden_is_not_touched(sentence):
    assert not isinstance(outcome_of(sentence, larger_room()), Plan)


@pytest.mark.parametrize(
    ("sentence", "steps"),
    [
        ("choose between the red and the blue block and lift it", [("lift", RED)]),
        ("red or blue cube, take one of them", [("lift", RED)]),
        ("take the red cube, or the blue one, whichever is easier", [("lift", RED)]),
        ("open the fridge or the drawer, either will do", [("open", FRIDGE)]),
        ("take the red or the blue cube, whichever's closer to the drawer", [("lift", BLUE)]),
        ("take the red or the blue cube, whichever is nearest to the fridge", [("lift", RED)]),
        ("press the button, the lever not", [("press", BUTTON)]),
        ("any cube but the yellow one is fine, give me one", [("hand_over", BLUE)]),
        ("the drawer should be opened, but press the button first", [("press", BUTTON), ("open", DRAWER)]),
        ("open all containers but not the drawer", [("open", FRIDGE)]),
    ],
)
def test_one_of_two_is_taken(sentence, steps):
    assert done(sentence) == steps


@pytest.mark.parametrize(
    "sentence",
    [
        "open whatever the yellow cube is in",
        "open the container that holds the yellow cube",
        "open up where the yellow cube is inside",
        "find out what the yellow cube is in and open it",
        "whichever one contains the yellow cube, open it",
        "open the drawer or the fridge, whichever has the yellow cube in it",
    ],
)
def test_a_container_is_named_by_what_is_in_it(sentence):
    outcome = outcome_of(f"put the yellow cube in the fridge and close it / {sentence}", larger_room())
    assert isinstance(outcome, Plan), outcome
    assert asked_steps(outcome) == [("open", FRIDGE)]


@pytest.mark.parametrize(
    ("sentence", "things"),
    [
        ("the block between orange and cyan, touch it", [YELLOW]),
        ("rightmost cube: touch", [BLUE]),
        ("of the yellow and blue cubes touch the one closest to you", [YELLOW]),
        ("don't miss any block, touch them all", [YELLOW, BLUE, RED, ORANGE, CYAN]),
        ("touch the cubes, every one of them", [YELLOW, BLUE, RED, ORANGE, CYAN]),
        ("touch them all", [YELLOW, BLUE, RED, ORANGE, CYAN]),
        ("touch all the cubes but not, not the cyan one", [YELLOW, BLUE, RED, ORANGE]),
        ("touch the closest block to the drawer", [BLUE]),
    ],
)
def test_what_is_named_first_or_twice_is_touched_once(sentence, things):
    assert touched(sentence) == things


@pytest.mark.parametrize(
    ("sentence", "thing"),
    [
        ("give me one of the cubes other than the yellow or the orange one", BLUE),
        ("hand me a cube, not the yellow or the orange one", BLUE),
        ("hand me a block, no orange, no yellow", BLUE),
        ("give me some cube, anything but yellow and orange", BLUE),
    ],
)
def test_any_but_some_is_another_one(sentence, thing):
    assert done(sentence) == [("hand_over", thing)]


def test_one_of_some_cubes_beside_the_outermost_one_is_a_cube():
    step = outcome_of("take the cube furthest right and put it beside the leftmost one").steps[-1]
    assert step.object == BLUE
    assert step.place is not None
