"""Commands for a later time are refused with that reason, and times within other sentences change nothing."""

import pytest

from language import Dialogue, Plan, Refusal
from tests.helpers.room_cases import larger_room


@pytest.mark.parametrize(
    ("sentence", "when"),
    [
        ("open the drawer tomorrow", "tomorrow"),
        ("press the button later", "later"),
        ("in five minutes close the fridge", "in five minutes"),
        ("Wait ten seconds, then open the drawer.", "wait ten seconds"),
        ("we can take the yellow cube on Monday", "on monday"),
        ("open the drawer when I say so", "when i say so"),
        ("press the button as soon as my brother comes back", "as soon as my brother comes back"),
        ("turn the wheel every hour", "every hour"),
        ("open the fridge at 5 o'clock", "at 5 o'clock"),
    ],
)
def test_a_command_for_later_is_refused_and_says_why(sentence, when):
    outcome = Dialogue().answer(sentence, larger_room())
    assert isinstance(outcome, Refusal)
    assert outcome.reason == "impossible"
    assert f"do not wait until then ('{when}')" in outcome.text


@pytest.mark.parametrize(
    "sentence",
    [
        "put the red cube in the drawer for later",
        "touch the red cube and later the yellow cube",
        "open the drawer when you like",
        "in the second picture the red cube is to the left of the orange cube",
        "open the drawer after touching the lever",
    ],
)
def test_other_sentences_with_such_words_are_carried_out(sentence):
    outcome = Dialogue().answer(sentence, larger_room())
    assert isinstance(outcome, Plan)
    assert outcome.steps
