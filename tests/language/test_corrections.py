"""Corrections of single words of the last sentence, of its side, its order and its length."""

import pytest

from language import Plan, Question, Signal
from tests.helpers.room_cases import BLUE, NAMES, WHEEL, YELLOW, larger_room, outcome_of, room


def steps(turns, world=None):
    outcome = outcome_of(turns, world or room())
    assert isinstance(outcome, Plan | Signal), outcome
    return [(step.verb, NAMES[step.object]) for step in outcome.steps]


def last_place(turns):
    outcome = outcome_of(turns, room())
    assert isinstance(outcome, Plan), outcome
    return outcome.steps[-1].object, outcome.steps[-1].place


@pytest.mark.parametrize(
    "correction",
    ["beside, not on", "not on, beside", "I said beside!", "no, next to", "near, I meant", "next to instead of on"],
)
def test_another_preposition_puts_the_thing_there(correction):
    thing, (x, y) = last_place(f"stack blue on yellow / {correction}")
    base = room().things[YELLOW]
    assert thing == BLUE
    assert 0.03 < abs(x - base.x) + abs(y - base.y) < 0.15


@pytest.mark.parametrize(
    ("turns", "expected"),
    [
        ("open the drawer / close, not open", [("close", "drawer")]),
        ("push the blue cube / I meant pick up", [("lift", "blue")]),
        ("close the drawer / I said open", [("open", "drawer")]),
    ],
)
def test_another_verb_is_done_with_the_same_thing(turns, expected):
    assert steps(turns) == expected


def test_another_verb_may_come_with_another_thing():
    outcome = outcome_of("press the button / turn, not press. and the wheel", larger_room())
    assert [(step.verb, step.object) for step in outcome.steps] == [("turn", WHEEL)]


@pytest.mark.parametrize(
    ("correction", "shift"),
    [
        ("I said 8 cm", 0.08),
        ("3 cm, not 5", 0.03),
        ("right, not left", -0.05),
        ("a bit too much, half of it back", 0.025),
    ],
)
def test_another_length_or_direction_counts_from_where_it_stood(correction, shift):
    thing, (_, y) = last_place(f"move yellow 5 cm to the left / {correction}")
    assert thing == YELLOW
    assert y - room().things[YELLOW].y == pytest.approx(shift, abs=0.004)


@pytest.mark.parametrize("more", ["a bit more, same direction", "in the same direction again"])
def test_the_same_direction_is_that_of_the_last_move(more):
    _, (_, y) = last_place(f"move yellow 3 cm to the left / {more}")
    assert y > room().things[YELLOW].y + 0.035


def test_i_said_with_a_tag_corrects():
    turns = "put the red cube in the drawer / hold on, I said the fridge, didn't I?"
    assert steps(turns)[-1] == ("put_in", "red")
    assert NAMES[outcome_of(turns, room()).steps[-1].goal] == "fridge"


@pytest.mark.parametrize(
    ("turns", "expected"),
    [
        ("take the cube on the left / the other left", "blue"),
        ("take the cube on the left / no, my left", "blue"),
        ("take the cube on my left", "blue"),
        ("take the leftmost cube / I meant my left, so on your right", "blue"),
        ("take the cube on your left", "red"),
    ],
)
def test_my_left_is_on_the_right_of_the_robot(turns, expected):
    assert steps(turns)[-1][1] == expected


def test_two_things_in_two_containers_change_places():
    turns = "put red in the drawer and blue in the fridge / "
    for said in ("other way round please", "exchange the contents of drawer and fridge"):
        result = outcome_of(turns + said, room()).result
        assert {NAMES[i]: NAMES[box] for i, box in result.inside.items()} == {"red": "fridge", "blue": "drawer"}


@pytest.mark.parametrize(
    ("turns", "expected"),
    [
        ("touch the blue cube / touch the red cube / now the first one again", "blue"),
        ("touch the blue cube / touch the red cube / touch yellow / the second one once more", "red"),
    ],
)
def test_the_first_one_again_is_told_by_what_was_done(turns, expected):
    assert steps(turns) == [("reach", expected)]


def test_the_second_one_that_was_offered():
    turns = "put yellow on another cube"
    asked = outcome_of(turns, larger_room())
    assert isinstance(asked, Question)
    chosen = outcome_of(f"{turns} / the second one you mentioned", larger_room())
    assert chosen.steps[-1].goal == asked.candidates[1]


def test_the_next_one_to_the_right():
    assert steps("touch the red cube / and now the next one to the right") == [("reach", NAMES[YELLOW])]
