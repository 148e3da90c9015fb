"""Corrections of single words of the last sentence, of its side, its order and its length."""

import pytest

from language import Plan, Question, Refusal, Signal
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


@pytest.mark.parametrize(
    "wrong", ["oops, put it back, I wanted blue", "no no, not that. the blue one please", "no. must be blue"]
)
def test_what_was_wanted_instead_is_said_after_what_was_wrong(wrong):
    assert steps(f"take the red cube / {wrong}") == [("pick_and_place", "red"), ("grasp", "blue")]


@pytest.mark.parametrize(
    ("last", "back"),
    [
        ("put them back", ["blue", "yellow", "red"]),
        ("put all three back", ["blue", "yellow", "red"]),
        ("undo the last two", ["blue", "yellow"]),
        ("take the last two moves back", ["blue", "yellow"]),
    ],
)
def test_several_moves_are_taken_back(last, back):
    moves = "move red 6 cm to the right / move yellow 6 cm to the left / move blue 6 cm to the left / "
    outcome = outcome_of(moves + last, room())
    assert sorted(NAMES[step.object] for step in outcome.steps if step.carries) == sorted(back)
    for name in back:
        index = NAMES.index(name)
        assert outcome.result.things[index].y == pytest.approx(room().things[index].y, abs=0.005)


def test_what_is_not_where_it_was_wanted_is_asked_about():
    turns = "put blue on yellow / that is not where I wanted it"
    assert isinstance(outcome_of(turns, room()), Question)
    assert steps(f"{turns} / in the fridge")[-1] == ("put_in", "blue")


def test_the_same_is_done_with_others_in_one_sentence():
    turns = "put the red cube in the drawer and close it, then do the same with the fridge and the yellow one"
    done = [(verb, thing) for verb, thing in steps(turns) if verb in ("put_in", "close")]
    assert done == [("put_in", "red"), ("close", "drawer"), ("put_in", "yellow"), ("close", "fridge")]


def test_both_may_be_answered_with_their_order():
    assert steps("open it / both of them, the drawer first") == [("open", "drawer"), ("open", "fridge")]


def test_a_second_it_is_what_was_named_beside_the_first():
    thing, (x, y) = last_place("put yellow on the button / put it next to it")
    assert thing == YELLOW
    assert abs(x - 0.47) + abs(y - 0.18) < 0.1


def test_there_is_where_the_last_thing_went():
    thing, (x, y) = last_place("move blue 9 cm to the left / put the red cube there too")
    assert NAMES[thing] == "red"
    assert abs(x - 0.44) + abs(y + 0.09) < 0.16


def test_what_is_held_is_not_operated():
    outcome = outcome_of("pick up the red cube / flip it over", room())
    assert isinstance(outcome, Refusal)
    assert not isinstance(outcome_of("take a cube / not red, not blue, not yellow", room()), Plan)


@pytest.mark.parametrize(
    ("turns", "expected"),
    [
        ("put all the cubes in a row / the other way round", ["blue", "yellow", "red"]),
        ("move blue 9 cm to the left / a bit less", ["blue"]),
        ("where is the blue cube? / where is the red cube? / put the first one on the second", ["blue"]),
        ("which cubes can I stack? / stack the first two you named", ["blue"]),
        ("which cube is nearest to the drawer? / put that one in", ["blue"]),
    ],
)
def test_turns_go_on_from_what_was_done_or_told(turns, expected):
    outcome = outcome_of(turns, room())
    assert [NAMES[step.object] for step in outcome.steps if step.carries] == expected


def test_on_top_is_on_what_was_stacked_before():
    assert isinstance(outcome_of("stack blue on yellow / put red on top as well", room()), Refusal)


def test_up_again_takes_what_was_put_down():
    assert steps("take the red cube / now down again / up again") == [("lift", "red")]


@pytest.mark.parametrize(
    "sentence",
    [
        "open the drawer. What is in it?",
        "open the drawer, is there something in it?",
        "open the drawer and tell me what is in it",
    ],
)
def test_a_question_after_a_command_is_answered_with_the_plan(sentence):
    outcome = outcome_of(sentence, room())
    assert [(step.verb, NAMES[step.object]) for step in outcome.steps] == [("open", "drawer")]
    assert "othing is in" in outcome.notes[-1]
