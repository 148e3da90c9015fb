"""Turns that take something out or back again, or do the same with another thing, in few words."""

import pytest

from tests.helpers.room_cases import (
    BLUE,
    CYAN,
    DRAWER,
    FRIDGE,
    ORANGE,
    RED,
    YELLOW,
    asked_steps,
    larger_room,
    outcome_of,
)

STACKED = "put the yellow cube on the blue cube / "
MOVED = "move the yellow cube a bit to the left / "


@pytest.mark.parametrize(
    "out",
    [
        "I want it out of the drawer",
        "I need it back out of there",
        "out of the drawer again with it",
        "pull that one back out please",
        "changed my mind, I'd like the red one out of there",
        "out with it again",
        "the red one: out again",
    ],
)
def test_what_was_put_in_comes_out_again(out):
    found = asked_steps(outcome_of(f"open the drawer / put the red cube in the drawer / {out}", larger_room()))
    assert found == [("take_out", RED)]


def test_the_other_one_comes_out_of_where_it_is():
    start = "open the drawer and the fridge / put the red cube in the drawer / put the yellow cube in the fridge"
    turns = f"{start} / take the red cube out / put it on the table / take the other one out too"
    assert asked_steps(outcome_of(turns, larger_room())) == [("take_out", YELLOW)]


@pytest.mark.parametrize(
    "back",
    [
        "put it back to the spot you took it from",
        "never mind, back to its place with it",
        "it should stand where it stood before, so put it back",
        "leave it where it was, put it back there",
        "return it to its old place",
        "back it goes",
    ],
)
def test_what_was_moved_goes_back_once(back):
    outcome = outcome_of(STACKED + back, larger_room())
    placed = [step for step in outcome.steps if step.carries]
    assert [step.object for step in placed] == [YELLOW]
    assert placed[0].place == pytest.approx((0.34, 0.0), abs=0.01)


@pytest.mark.parametrize(
    "same",
    ["now orange, same thing", "same again but orange", "same thing: orange", "the orange one, same direction"],
)
def test_the_same_is_done_with_another_thing(same):
    outcome = outcome_of(MOVED + same, larger_room())
    step = outcome.steps[-1]
    assert step.object == ORANGE
    assert step.place[1] > -0.08


@pytest.mark.parametrize(
    "said", ["next, cyan goes on top of orange", "same thing: cyan onto orange", "next up, cyan on orange"]
)
def test_the_next_pair_is_said_in_short(said):
    step = outcome_of("stack the red cube on the yellow cube / " + said, larger_room()).steps[-1]
    assert (step.verb, step.object, step.goal) == ("stack", CYAN, ORANGE)


@pytest.mark.parametrize("said", ["don't forget the drawer", "don't forget to close the drawer", "next the drawer"])
def test_what_is_not_to_be_forgotten_is_done_too(said):
    outcome = outcome_of(f"open the drawer and the fridge / close the fridge / {said}", larger_room())
    assert asked_steps(outcome) == [("close", DRAWER)]


@pytest.mark.parametrize(
    "said", ["a bit right", "sorry, a bit right", "no, a bit right", "good, but a bit more to the right"]
)
def test_a_bit_right_is_a_side(said):
    step = outcome_of("move the blue cube to the left / " + said, larger_room()).steps[-1]
    assert step.object == BLUE


def test_one_of_two_may_be_both():
    outcome = outcome_of("open one of the containers / why not both", larger_room())
    assert outcome.result.open == {DRAWER, FRIDGE}


def test_what_is_lowered_where_it_was_lifted_stands_there_again():
    world = larger_room()
    outcome = outcome_of("pick up the yellow cube / lower the block at the spot from which you lifted it", world)
    assert [step.object for step in outcome.steps] == [YELLOW]
    assert outcome.steps[-1].place == (world.things[YELLOW].x, world.things[YELLOW].y)


@pytest.mark.parametrize("asked", ["I can't find the red cube, where is it", "I don't know where the red one is"])
def test_who_does_not_see_a_thing_asks_for_it(asked):
    assert outcome_of(asked, larger_room()).about == (RED,)
