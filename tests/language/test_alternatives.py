"""Questions that leave something out, or name two answers of which one is so."""

import pytest

from language import Answer
from tests.helpers.room_cases import DRAWER, RED, outcome_of, room


def told(question, **facts):
    outcome = outcome_of(question, room(**facts))
    assert isinstance(outcome, Answer), outcome
    return outcome.text


@pytest.mark.parametrize(
    "question",
    [
        "which cubes are on the table apart from the blue one?",
        "what is on the table besides the blue cube?",
        "Except for the blue one, is there anything on the table?",
        "apart from the blue cube what else is on the table?",
        "how many cubes are on the table other than the blue one?",
    ],
)
def test_what_is_left_out_is_not_told(question):
    text = told(question)
    assert "red cube" in text
    assert "yellow cube" in text
    assert "blue cube," not in text
    assert not text.startswith(("The blue", "Three", "There are three"))


def test_nothing_else_is_in_the_drawer():
    inside = {"inside": {RED: DRAWER}, "open": frozenset({DRAWER})}
    assert told("is anything in the drawer besides the red cube?", **inside).startswith("No")
    assert told("is anything in the drawer besides the blue cube?", **inside).startswith("Yes")


@pytest.mark.parametrize(
    ("question", "starts"),
    [
        ("can you reach the yellow cube or is something on it?", "Yes: the blue cube"),
        ("is the yellow cube on the table or is it covered?", "Yes: the yellow cube is under the blue cube"),
        ("is the drawer open or is it closed?", "Yes: the blue drawer is closed"),
        ("did somebody leave the fridge open?", "No"),
        ("have I left the drawer open?", "No"),
        ("can you throw things?", "No"),
    ],
)
def test_of_two_answers_the_one_that_is_so_is_told(question, starts):
    assert told(f"put the blue cube on the yellow one / {question}").startswith(starts)


def test_no_thanks_is_no_correction_where_nothing_was_done():
    assert told("no thanks")


@pytest.mark.parametrize(
    ("turns", "starts"),
    [
        ("put blue in the drawer / is it closed now?", "No: the blue drawer is open"),
        ("is the red cube left of the yellow one? / and the blue one?", "No"),
        ("are there two things of the same colour?", "Yes"),
        ("what colours do you have?", "There are the yellow cube, the blue cube and the red cube"),
        ("touch the red cube and then the blue cube / which one did you touch last?", "The blue cube"),
        ("open the drawer / what did you put inside?", "Nothing"),
    ],
)
def test_what_is_asked_about_what_was_spoken_of(turns, starts):
    assert told(turns).startswith(starts)
