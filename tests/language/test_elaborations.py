"""What is said beside a command, of what is held, or once more: elaborations, remarks, tags, and places alone."""

from dataclasses import replace

import numpy as np
import pytest

from language import Answer, Dialogue, Plan, Refusal
from tests.helpers.room_cases import BLUE, BUTTON, DRAWER, FRIDGE, HAND, RED, WHEEL, YELLOW, asked_steps, outcome_of
from tests.helpers.room_cases import larger_room as room


@pytest.mark.parametrize(
    ("sentence", "verb", "goal"),
    [
        ("into the drawer please", "put_in", DRAWER),
        ("on the yellow one", "stack", YELLOW),
        ("next to the yellow one", "pick_and_place", None),
        ("here's my hand, drop it in", "hand_over", HAND),
    ],
)
def test_a_place_alone_is_where_the_held_thing_goes(sentence, verb, goal):
    outcome = Dialogue().answer(sentence, replace(room(), held=RED))
    last = outcome.steps[-1]
    assert (last.verb, last.object, last.goal) == (verb, RED, goal)


@pytest.mark.parametrize(
    ("sentence", "begins"),
    [
        ("the drawer is empty, huh?", "Yes"),
        ("the fridge is open, no?", "No"),
        ("the yellow one is in the fridge, eh?", "No"),
        ("might I trouble you to tell me whether the drawer is open?", "No"),
        ("who can tell me how many cubes there are?", "There are"),
    ],
)
def test_a_statement_with_a_tag_and_a_polite_opening_ask(sentence, begins):
    outcome = Dialogue().answer(sentence, room())
    assert isinstance(outcome, Answer)
    assert outcome.text.startswith(begins)


def test_what_is_left_on_the_table_is_on_no_side():
    text = Dialogue().answer("which cubes are left on the table?", room()).text
    assert all(color in text for color in ("yellow", "blue", "red", "orange", "cyan"))


@pytest.mark.parametrize("sides", ["back left", "front right", "rear right"])
def test_two_sides_of_the_table_are_its_corner(sides):
    outcome = Dialogue().answer(f"move the orange cube to the {sides} of the table", room())
    corner = Dialogue().answer(f"move the orange cube to the {sides} corner", room())
    assert outcome.steps == corner.steps


def test_behind_and_to_the_left_of_a_thing_is_both():
    world = room()
    outcome = Dialogue().answer("put the cyan cube behind and to the left of the yellow one", world)
    x, y = outcome.steps[-1].place
    assert x > world.things[YELLOW].x + 0.02
    assert y > world.things[YELLOW].y + 0.02


@pytest.mark.parametrize(
    ("sentence", "steps"),
    [
        ("the red wheel, turn the wheel", [("turn", WHEEL)]),
        ("drawer. open the drawer. yeah the blue one", [("open", DRAWER)]),
        ("only open the drawer", [("open", DRAWER)]),
        ("open the fridge, leave the drawer as is", [("open", FRIDGE)]),
        ("press the button, wait until it settles, then turn the wheel", [("press", BUTTON), ("turn", WHEEL)]),
        ("open the drawer, all the cold air is getting out", [("open", DRAWER)]),
        ("make the wheel go round and round", [("turn", WHEEL)]),
        ("press it, the grey button", [("press", BUTTON)]),
        ("the wheel has to be turned before lunch", [("turn", WHEEL)]),
        ("the drawer ought to have the red cube in it", [("open", DRAWER), ("put_in", RED)]),
        ("opne the drwer and put the blok in red colour in it", [("open", DRAWER), ("put_in", RED)]),
        ("open the drawer if it's shut, otherwise close it", [("open", DRAWER)]),
    ],
)
def test_what_is_said_twice_or_beside_a_command_is_done_once(sentence, steps):
    assert asked_steps(Dialogue().answer(sentence, room())) == steps


def test_what_is_too_close_is_not_closed():
    outcome = Dialogue().answer("the yellow cube is way too close to the edge, push it in a bit", room())
    assert [step.object for step in outcome.steps] == [YELLOW, YELLOW]


def test_a_colour_among_cubes_is_no_device():
    outcome = Dialogue().answer("the yellow cube goes on the left, and the cyan one on the right", room())
    assert not any(step.verb == "switch" for step in outcome.steps)


def test_beside_a_container_is_not_in_it():
    outcome = Dialogue().answer("put the yellow cube over by the fridge", room())
    assert isinstance(outcome, Refusal)
    assert "does not reach" in outcome.text


def test_a_length_is_corrected():
    dialogue, world = Dialogue(), room()
    long = dialogue.answer("move the yellow cube 10 cm to the left", world)
    short = dialogue.answer("correction, make that 5 centimetres", long.result)
    assert short.steps[-1].place[1] == pytest.approx(world.things[YELLOW].y + 0.05, abs=0.005)


def test_an_english_sentence_with_one_foreign_word_is_read():
    assert asked_steps(Dialogue().answer("grab teh bleu cube", room()))[0][1] == BLUE


def test_all_cubes_find_room_around_the_middle():
    world = room()
    outcome = Dialogue().answer("gather all of the cubes in the middle of the table", world)
    assert isinstance(outcome, Plan)
    assert len(outcome.notes) == len(set(outcome.notes))


def test_where_it_was_is_where_the_thing_before_stood():
    world = room()
    outcome = Dialogue().answer("move the red cube over to the right and put the yellow one where it was", world)
    assert outcome.steps[-1].object == YELLOW
    assert outcome.steps[-1].place == pytest.approx((world.things[RED].x, world.things[RED].y), abs=0.02)


def test_a_bit_towards_the_middle_is_a_bit():
    world = room()
    outcome = Dialogue().answer("the red cube is too close to the edge of the table", world)
    moved = np.subtract(outcome.steps[-1].place, (world.things[RED].x, world.things[RED].y))
    assert 0.01 < np.hypot(*moved) < 0.08
    assert moved[1] * world.things[RED].y < 0


@pytest.mark.parametrize(("held", "begins"), [({}, "Yes"), ({RED: DRAWER}, "No")])
def test_whether_there_is_room_is_told(held, begins):
    outcome = Dialogue().answer("is there still room in the drawer?", replace(room(), inside=held))
    assert outcome.text.startswith(begins)


@pytest.mark.parametrize(
    ("turns", "step"),
    [
        ("touch the red cube / wait, that was supposed to be yellow, not red", ("reach", YELLOW)),
        ("touch the red cube / yellow is what I wanted", ("reach", YELLOW)),
        ("turn the wheel / two more of those", ("turn", WHEEL)),
        ("grab yellow / grab blue / give me the one you had before", ("hand_over", YELLOW)),
        ("put red on yellow / I need the one underneath", ("hand_over", YELLOW)),
    ],
)
def test_a_turn_goes_on_from_the_ones_before(turns, step):
    outcome = outcome_of(turns, room())
    assert asked_steps(outcome)[-1] == step


@pytest.mark.parametrize(
    "last",
    [
        "ctrl z",
        "let's pretend that never happened",
        "on second thoughts we don't need the drawer",
        "mmm, better before",
    ],
)
def test_what_was_done_is_undone_in_other_words(last):
    outcome = outcome_of(f"open the drawer / {last}", room())
    assert (outcome.control, asked_steps(outcome)) == ("undo", [("close", DRAWER)])


def test_the_last_two_of_one_thing_undo_that_one():
    outcome = outcome_of("open the drawer / reverse the last two things you did", room())
    assert (outcome.control, asked_steps(outcome)) == ("undo", [("close", DRAWER)])
    assert isinstance(outcome_of("undo the last two things", room()), Refusal)


@pytest.mark.parametrize("last", ["where did you find it?", "where did it come from?", "where was it before?"])
def test_where_a_thing_was_before_is_told(last):
    world = replace(room(), inside={RED: DRAWER})
    assert "was in the blue drawer" in outcome_of(f"give me the red cube / {last}", world).text


@pytest.mark.parametrize(("turns", "begins"), [("", "Yes"), ("put red on yellow / ", "No")])
def test_whether_a_thing_bears_another_is_told(turns, begins):
    assert outcome_of(f"{turns}could the yellow cube take another one on top?", room()).text.startswith(begins)


def test_what_a_person_will_have_is_given_and_not_left_out():
    outcome = Dialogue().answer("put yellow on the cyan one and I'll have red", room())
    assert asked_steps(outcome)[-1] == ("hand_over", RED)
