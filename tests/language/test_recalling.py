"""Things and places that are told by what was done before: "the first one you moved", "where it was", and by names."""

import pytest

from language import Answer, Dialogue, Question, Refusal
from tests.helpers.room_cases import NAMES, RED, outcome_of, room


def steps(turns):
    return [(step.verb, NAMES[step.object]) for step in outcome_of(turns).steps]


TWO = "put the red cube on the yellow one / touch the blue cube / "


@pytest.mark.parametrize(
    ("turns", "moved"),
    [
        (TWO + "pick up the first one you moved", "red"),
        (TWO + "pick up the one you just touched", "blue"),
        (TWO + "give me the cube you moved earlier", "red"),
        (TWO + "pick up the last one that you touched", "blue"),
        ("touch the red cube / put the cube in the drawer / the one I had you touch", "red"),
        ("touch the red cube / pick up the cube / the same one as before", "red"),
    ],
)
def test_a_thing_is_told_by_what_was_done_with_it(turns, moved):
    assert ("lift", moved) in steps(turns)


def test_the_first_and_the_second_are_those_of_two_that_were_spoken_of():
    assert steps("touch the blue cube / touch the yellow cube / put the first on the second") == [
        ("lift", "blue"),
        ("stack", "blue"),
    ]


def test_the_last_two_go_back():
    turns = "move the red cube right / put the blue cube on the yellow one / put the last two back to where they were"
    assert {name for _, name in steps(turns)} == {"red", "blue"}


def test_a_place_is_told_by_what_stood_there():
    last = outcome_of("put the red cube on the blue one / put the yellow cube where the red one was").steps[-1]
    assert NAMES[last.object] == "yellow"
    assert last.place == pytest.approx((0.37, 0.18), abs=0.01)


def test_what_stood_on_another_thing_leaves_that_as_the_place():
    turns = "put the red cube on the blue one / put the red cube down / put the yellow cube where the red one was"
    assert NAMES[outcome_of(turns).steps[-1].goal] == "blue"


@pytest.mark.parametrize(
    ("turns", "expected"),
    [
        ("call the red cube Bob / put Bob on the yellow one", [("lift", "red"), ("stack", "red")]),
        ("touch the red cube / this one is called Sam / give me Sam", [("lift", "red"), ("hand_over", "red")]),
        ("touch the red cube / its name is Sam / pick up the cube / Sam", [("lift", "red")]),
        ("touch the red cube / let's call it Bob / call the blue cube Bob / pick up Bob", [("lift", "blue")]),
    ],
)
def test_a_name_that_was_given_means_the_thing(turns, expected):
    assert steps(turns) == expected


def test_a_name_may_mean_a_place():
    turns = "pick up red / call this spot base / put it in the middle / put the blue cube at base"
    last = outcome_of(turns).steps[-1]
    assert NAMES[last.object] == "blue"
    assert last.place == pytest.approx((0.37, 0.18), abs=0.05)


@pytest.mark.parametrize("question", ["who is Bob?", "what is Bob?", "where is Bob?"])
def test_a_name_is_asked_about(question):
    assert "red cube" in outcome_of("call the red cube Bob / " + question).text.lower()


def test_a_copy_of_a_dialogue_keeps_the_names_it_has():
    dialogue = Dialogue()
    dialogue.answer("call the red cube Bob", room())
    dialogue.copy().answer("call the blue cube Bob")
    assert [NAMES[step.object] for step in dialogue.answer("pick up Bob").steps] == ["red"]


@pytest.mark.parametrize("sentence", ["call it a day", "call me Bob", "name the cubes", "call it a red cube"])
def test_what_gives_no_name_teaches_none(sentence):
    dialogue = Dialogue()
    dialogue.answer("touch the red cube", room())
    dialogue.answer(sentence)
    assert not dialogue.names


def test_what_is_held_was_picked_up_last():
    assert [step.object for step in outcome_of("put the last one you picked up down", room(held=RED)).steps] == [RED]


def test_without_a_thing_there_is_no_name():
    outcome = outcome_of("call it Bob")
    assert isinstance(outcome, Question | Answer) or outcome.text


@pytest.mark.parametrize(
    "turns", ["pick up the first one you moved", "open the drawer / give me the cube you moved earlier"]
)
def test_a_deed_that_was_not_done_tells_no_thing(turns):
    outcome = outcome_of(turns)
    assert isinstance(outcome, Refusal)
    assert "nothing like that" in outcome.text


@pytest.mark.parametrize(
    "told", ["the one that was under it", "the cube it was standing on", "the block that the red cube stood on"]
)
def test_what_a_thing_stood_on_is_told_by_that(told):
    turns = f"put the red cube on the yellow one / put the red cube on the right side / pick up {told}"
    assert steps(turns) == [("lift", "yellow")]
