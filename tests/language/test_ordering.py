"""Clauses of time: what is done first is done first, wherever the sentence says it."""

from dataclasses import replace

import pytest

from language import Dialogue, Plan
from tests.helpers.room_cases import BUTTON, DRAWER, FRIDGE, LEVER, RED, WHEEL, YELLOW, asked_steps, larger_room


def done(sentence, **fields):
    """What is done with which thing."""
    outcome = Dialogue().answer(sentence, replace(larger_room(), **fields))
    assert isinstance(outcome, Plan), outcome
    return asked_steps(outcome)


@pytest.mark.parametrize(
    "sentence",
    [
        "push the button once you have closed the fridge",
        "once you've closed the fridge push the button",
        "after closing the fridge, press the button",
        "press the button as soon as the fridge is shut",
        "press the button, but only after closing the fridge",
        "don't press the button until the fridge has been closed",
        "press the button, but not until you have shut the fridge",
        "close the fridge before you press the button",
        "before pressing the button close the fridge",
        "after the fridge has been closed, but not earlier, press the button",
        "upon closing the fridge press the button",
    ],
)
def test_a_clause_of_time_says_what_is_done_first(sentence):
    assert done(sentence, open={FRIDGE}) == [("close", FRIDGE), ("press", BUTTON)]


@pytest.mark.parametrize(
    ("sentence", "steps"),
    [
        ("turn the wheel once the red cube is in the drawer", [("open", DRAWER), ("put_in", RED), ("turn", WHEEL)]),
        ("having opened the drawer, put the red cube in it", [("open", DRAWER), ("put_in", RED)]),
        (
            "when you have put the red cube in the drawer close it",
            [("open", DRAWER), ("put_in", RED), ("close", DRAWER)],
        ),
        ("press the button after the wheel", [("turn", WHEEL), ("press", BUTTON)]),
        ("open the drawer and after that press the button", [("open", DRAWER), ("press", BUTTON)]),
        ("open the drawer and after press the button", [("open", DRAWER), ("press", BUTTON)]),
        ("turn the wheel once and then switch the lever", [("turn", WHEEL), ("switch", LEVER)]),
    ],
)
def test_clauses_of_time_tell_deeds_results_and_devices(sentence, steps):
    assert done(sentence) == steps


@pytest.mark.parametrize(
    ("sentence", "steps"),
    [
        ("switch the lever twice and then turn the wheel", [("switch", LEVER)] * 2 + [("turn", WHEEL)]),
        ("turn the wheel once, then switch the lever two times", [("turn", WHEEL)] + [("switch", LEVER)] * 2),
        ("touch the red cube twice, then the yellow one three times", [("reach", RED)] * 2 + [("reach", YELLOW)] * 3),
        ("switch the lever twice", [("switch", LEVER)] * 2),
    ],
)
def test_each_clause_is_done_as_often_as_it_says(sentence, steps):
    assert done(sentence) == steps
