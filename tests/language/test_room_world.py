"""Sentences in a room: steps that people imply, containers, devices, the person's hand."""

import pytest

from language import Answer, Dialogue, Plan, Question, Refusal
from tests.helpers.room_cases import BLUE, DRAWER, NAMES, RED, room


def steps(sentence, world=None, dialogue=None):
    outcome = (dialogue or Dialogue()).answer(sentence, world or room())
    assert isinstance(outcome, Plan), outcome
    return [(step.verb, NAMES[step.object], None if step.goal is None else NAMES[step.goal]) for step in outcome.steps]


def test_a_closed_drawer_is_opened_before_something_goes_in_and_the_plan_says_so():
    outcome = Dialogue().answer("put the red cube in the drawer", room())
    assert [step.verb for step in outcome.steps] == ["open", "lift", "put_in"]
    assert [step.implied for step in outcome.steps] == [True, False, False]
    assert any("open the blue drawer first" in note for note in outcome.notes)


@pytest.mark.parametrize(
    ("sentence", "expected"),
    [
        ("put the red cube in the drawer and close it", ["open", "lift", "put_in", "close"]),
        ("open the fridge. put the blue cube inside. shut it.", ["open", "lift", "put_in", "close"]),
        ("the yellow cube belongs in the fridge", ["open", "lift", "put_in"]),
        ("swap the red cube and the blue one", ["lift", "pick_and_place"] * 3),
        ("stack the red cube on the blue one and press the button", ["lift", "stack", "press"]),
        ("give the button a push", ["press"]),
        ("pull the lever", ["switch"]),
    ],
)
def test_several_steps_are_done_in_the_world_that_those_before_leave(sentence, expected):
    assert [verb for verb, _, _ in steps(sentence)] == expected


def test_what_is_in_a_closed_container_is_taken_out_of_it():
    world = room(inside={RED: DRAWER})
    assert steps("bring me the red cube", world) == [
        ("open", "drawer", None),
        ("take_out", "red", "drawer"),
        ("hand_over", "red", "hand"),
    ]


def test_what_is_held_is_meant_first_and_is_put_down_before_another_step():
    world = room(held=RED)
    assert steps("put it in the drawer", room(held=RED, open=frozenset({DRAWER}))) == [("put_in", "red", "drawer")]
    assert [verb for verb, _, _ in steps("press the button", world)] == ["pick_and_place", "press"]


@pytest.mark.parametrize(
    ("sentence", "facts", "words"),
    [
        ("put the red cube in the drawer", {"inside": {BLUE: DRAWER}, "open": frozenset({DRAWER})}, ["drawer is full"]),
        ("open the drawer", {"open": frozenset({DRAWER})}, ["drawer", "open already"]),
        ("lift the whole fridge", {}, ["fridge", "fixed"]),
        ("pour water on the red cube", {}, ["cannot pour water"]),
        ("put the green cube in the drawer", {}, ["no green cube"]),
        ("put the red cube on the sofa", {}, ["sofa"]),
    ],
)
def test_a_refusal_says_the_true_reason_and_offers_two_sentences_that_can_be_said(sentence, facts, words):
    world = room(**facts)
    outcome = Dialogue().answer(sentence, world)
    assert isinstance(outcome, Refusal), outcome
    assert all(word in outcome.text for word in words), outcome.text
    assert len(outcome.suggestions) == 2
    assert all(isinstance(Dialogue().answer(each, world), Plan) for each in outcome.suggestions), outcome.suggestions


@pytest.mark.parametrize("sentence", ["which cube is next to the mark?", "is the red cube on the blue one?", "why?"])
def test_a_question_is_never_carried_out(sentence):
    assert isinstance(Dialogue().answer(sentence, room()), Answer)


def test_a_question_names_three_things_at_most_and_something_else():
    outcome = Dialogue().answer("take the cube", room())
    assert isinstance(outcome, Question)
    assert outcome.text.endswith("or something else?")
    assert "(" not in outcome.text


def test_conditions_are_compared_with_the_world():
    assert steps("close the drawer if it is open", room(open=frozenset({DRAWER}))) == [("close", "drawer", None)]
    assert isinstance(Dialogue().answer("close the drawer if it is open", room()), Answer)


@pytest.mark.parametrize(
    "sentence",
    ["..  pick up the red cube", "1. pick up the red cube", "- PICK UP THE RED CUBE!!", "um pick up the uh red cube"],
)
def test_marks_numbers_capitals_and_hums_make_no_difference(sentence):
    assert steps(sentence) == [("lift", "red", None)]


def test_a_bit_is_less_than_a_plain_move():
    plain, bit = (
        Dialogue().answer(f"move the yellow cube {words}to the left", room()).steps[-1].place[1]
        for words in ("", "a bit ")
    )
    assert 0 < bit < plain


@pytest.mark.parametrize(
    ("sentence", "expected"),
    [
        ("pick up the red cube and put it in the drawer", ["open", "lift", "put_in"]),
        ("walk to the fridge, open it and put the red cube in it", ["open", "lift", "put_in"]),
        ("put yellow next to red, then blue next to yellow", ["lift", "pick_and_place"] * 2),
        ("stack(red, cube.blue); button.press()", ["lift", "stack", "press"]),
        ("when you have pressed the button hand me the red cube", ["press", "lift", "hand_over"]),
        ("put the yellow cube on the red one, and when that is done press the button", ["lift", "stack", "press"]),
        ("it would be nicer with the red one on the blue one", ["lift", "stack"]),
        ("the red cube would look better on the blue one", ["lift", "stack"]),
        ("stack red on blue, no wait, blue on red", ["lift", "stack"]),
        ("my kid left the red cube on the table, put it in the drawer", ["open", "lift", "put_in"]),
        ("the yellow cube, which I like, and which is small, goes on the red one", ["lift", "stack"]),
    ],
)
def test_wordings_of_strangers_are_the_steps_that_they_mean(sentence, expected):
    assert [verb for verb, _, _ in steps(sentence)] == expected


def test_a_place_after_on_the_table_counts():
    moved = Dialogue().answer("put the red cube on the table to the left of the blue cube", room()).steps[-1]
    assert moved.place[1] > -0.18
    assert abs(moved.place[0] - 0.44) < 0.08


@pytest.mark.parametrize("sentence", ["shut the drawer and shut the window", "no cube should be left of the red one"])
def test_what_is_understood_in_part_is_not_done(sentence):
    assert isinstance(Dialogue().answer(sentence, room(open=frozenset({DRAWER}))), Refusal | Question)


def test_a_length_before_a_middle_is_no_direction():
    assert isinstance(Dialogue().answer("put the red cube 2 cm at the center side", room()), Plan | Question | Refusal)


@pytest.mark.parametrize(
    "sentence",
    [
        "I spilled juice next to the yellow cube, so can you open the drawer while I wipe?",
        "The cat keeps jumping into the boxes, better open the drawer.",
        "Message from reception: open the drawer. Best regards, Hannelore",
        "open the drawer because my glasses are in there",
        "To make room, open the drawer before everything melts.",
    ],
)
def test_parts_that_ask_for_nothing_change_nothing(sentence):
    assert steps(sentence) == steps("open the drawer")


def test_a_step_that_is_forbidden_is_not_implied():
    outcome = Dialogue().answer("put the red cube in the drawer without opening it", room())
    assert isinstance(outcome, Refusal)
    assert "open the blue drawer" in outcome.text


def test_a_thing_is_not_taken_out_of_what_it_is_not_in():
    assert not isinstance(Dialogue().answer("take the red cube out of the drawer", room()), Plan)


def test_a_place_may_come_before_its_command():
    assert steps("in the drawer: the red cube") == steps("put the red cube in the drawer")


def test_a_common_word_is_not_taken_for_a_misspelt_one():
    outcome = Dialogue().answer("put the blue books in the drawer", room())
    assert isinstance(outcome, Refusal)
    assert "books" in outcome.text
