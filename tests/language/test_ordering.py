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


@pytest.mark.parametrize(
    ("sentence", "steps"),
    [
        ("I want the red cube in the drawer first and then the yellow one in the fridge", "red yellow"),
        ("the red cube in the drawer first, then the yellow one in the fridge", "red yellow"),
        ("first the red cube goes in the drawer, second the yellow one goes in the fridge", "red yellow"),
        ("I want red in the drawer, and next I want yellow in the fridge", "red yellow"),
        ("before the yellow cube goes in the fridge, put the red cube in the drawer", "red yellow"),
        ("put the red cube in the drawer and after that yellow goes in the fridge", "red yellow"),
        ("put yellow in the fridge, but put red in the drawer before you do that", "red yellow"),
    ],
)
def test_what_comes_first_is_said_before_or_after_its_words(sentence, steps):
    order = {"red": [("open", DRAWER), ("put_in", RED)], "yellow": [("open", FRIDGE), ("put_in", YELLOW)]}
    assert done(sentence) == [step for name in steps.split() for step in order[name]]


@pytest.mark.parametrize(
    ("sentence", "steps"),
    [
        ("put red in the drawer. close the drawer. close the fridge.", [DRAWER, FRIDGE]),
        ("press the button, next the fridge is closed, last the drawer is closed", [FRIDGE, DRAWER]),
        ("close the drawer, but close the fridge first", [FRIDGE, DRAWER]),
        ("shut the fridge first, then the drawer", [FRIDGE, DRAWER]),
        ("put the fridge's lid down and after that push the drawer in", [FRIDGE, DRAWER]),
        ("close the fridge, I still need the drawer open", [FRIDGE]),
        ("shut the drawer, the fridge stays as it is", [DRAWER]),
        ("shut the drawer, I need the fridge open", [DRAWER]),
        ("don't close the fridge, but close the drawer first", [DRAWER]),
    ],
)
def test_every_container_that_is_to_be_closed_is_closed_and_no_other(sentence, steps):
    acts = done(sentence, open={DRAWER, FRIDGE})
    assert [thing for verb, thing in acts if verb == "close"] == steps
    assert "open" not in dict(acts)


@pytest.mark.parametrize("join", [" and", ", then", ", and don't forget to"])
def test_a_wish_to_have_a_thing_out_of_a_container_counts_beside_a_command(join):
    acts = done(f"let me have the red cube from the drawer{join} close the drawer", inside={RED: DRAWER}, open={DRAWER})
    assert [verb for verb, _ in acts] == ["hand_over", "close"]


def test_a_thing_out_of_a_container_is_taken_and_stays_in_the_gripper():
    assert done("the red cube out of the drawer, please", inside={RED: DRAWER}, open={DRAWER}) == [("take_out", RED)]


def test_a_thing_out_of_a_container_goes_to_the_place_that_follows():
    acts = done("the red cube out of the drawer, next to the yellow one", inside={RED: DRAWER}, open={DRAWER})
    assert [verb for verb, _ in acts] == ["pick_and_place"]
