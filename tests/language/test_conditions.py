"""Conditions within sequences: each is compared with the world that the steps before it leave."""

from dataclasses import replace

import pytest

from language import Answer, Dialogue, Plan, Refusal
from tests.helpers.room_cases import BUTTON, DRAWER, FRIDGE, RED, YELLOW, room


def done(sentence, **fields):
    """What is done with which thing, without what is only taken to be put somewhere."""
    outcome = Dialogue().answer(sentence, replace(room(), **fields))
    assert isinstance(outcome, Plan), outcome
    found = outcome.steps
    kept = [s for s, after in zip(found, [*found[1:], None], strict=True) if not s.takes or not after]
    return [(step.verb, step.object) for step in kept], outcome.notes


@pytest.mark.parametrize(
    ("sentence", "open", "steps"),
    [
        (
            "press the button and after that close the fridge if it's open",
            [FRIDGE],
            [("press", BUTTON), ("close", FRIDGE)],
        ),
        ("press the button and after that close the fridge if it's open", [], [("press", BUTTON)]),
        ("close the fridge if it's open and then press the button", [], [("press", BUTTON)]),
        ("open the drawer if it is closed, then put the red cube in", [DRAWER], [("put_in", RED)]),
        ("open the drawer if it is closed, then put the red cube in", [], [("open", DRAWER), ("put_in", RED)]),
        ("open the drawer and if it is empty put the red cube in it", [], [("open", DRAWER), ("put_in", RED)]),
        ("put the red cube in the drawer and if the fridge is open close it", [DRAWER], [("put_in", RED)]),
        (
            "press the button unless it's pressed already and then open the drawer",
            [],
            [("press", BUTTON), ("open", DRAWER)],
        ),
        ("if you hold something put it down, then open the drawer", [], [("open", DRAWER)]),
        ("if the drawer is closed and the fridge is closed press the button", [], [("press", BUTTON)]),
    ],
)
def test_only_the_steps_whose_conditions_hold_are_done(sentence, open, steps):
    assert done(sentence, open=frozenset(open))[0] == steps


def test_a_plan_says_what_it_leaves_out_and_why():
    _, notes = done("press the button and then close the fridge if it is open")
    assert any("close fridge" in note and "closed" in note for note in notes)


def test_a_condition_sees_what_the_steps_before_it_have_done():
    steps, _ = done("put the yellow cube in the fridge and if the fridge is empty put the red cube in it")
    assert steps == [("open", FRIDGE), ("put_in", YELLOW)]


def test_a_condition_that_nobody_can_tell_is_named_and_nothing_is_done():
    outcome = Dialogue().answer("press the button, and if the moon is full open the drawer", room())
    assert isinstance(outcome, Refusal)
    assert "moon is full" in outcome.text
    assert len(outcome.suggestions) == 2


def test_a_sentence_whose_only_condition_does_not_hold_is_answered():
    outcome = Dialogue().answer("close the fridge if it is open", room())
    assert isinstance(outcome, Answer)
    assert "closed" in outcome.text
