"""Statements that command nothing: what people do not know, what must not be done, and what somebody did."""

import pytest

from language import Answer
from tests.helpers.room_cases import outcome_of


def answer(sentence):
    outcome = outcome_of(sentence)
    assert isinstance(outcome, Answer), outcome
    return outcome.text


@pytest.mark.parametrize(
    ("embedded", "direct"),
    [
        ("I wonder whether the drawer is open", "is the drawer open?"),
        ("can you tell me if the red cube is on the table", "is the red cube on the table?"),
        ("I can't remember whether the fridge is closed", "is the fridge closed?"),
        ("I'm not sure where the red cube is", "where is the red cube?"),
        ("I have no idea how many cubes there are", "how many cubes are there?"),
        ("I keep forgetting which cube is in the drawer", "which cube is in the drawer?"),
    ],
)
def test_an_embedded_question_is_answered_as_the_direct_one(embedded, direct):
    assert answer(embedded) == answer(direct)


@pytest.mark.parametrize(
    "said",
    [
        "you must not touch the red cube",
        "the robot must never press the button",
        "hands off the blue cube",
        "the red cube is fine where it is",
        "the blue cube must not be moved",
        "the drawer must not be opened",
        "the drawer can not be opened",
        "the button should never be pressed",
        "the red cube is not supposed to be moved",
    ],
)
def test_what_must_not_be_done_is_not_done(said):
    assert answer(said).startswith("All right, I do not")


@pytest.mark.parametrize(
    "said",
    [
        "I have already pressed the button myself",
        "I moved the blue cube before you came",
        "my brother opened the drawer yesterday",
    ],
)
def test_a_report_of_what_people_did_moves_nothing(said):
    assert answer(said)
