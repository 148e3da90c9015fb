"""What is said beside a command and asks for nothing is left out; what may change its meaning is not."""

import pytest

from language import Answer, Dialogue, Plan, Question, Refusal
from tests.helpers.room_cases import MARK, NAMES, OBJECTS, YELLOW
from tests.helpers.room_cases import room as room_of


def answer(*turns, **facts):
    dialogue = Dialogue()
    for turn in turns:
        outcome = dialogue.answer(turn, room_of(OBJECTS[:MARK], **facts))
    return outcome


def steps(outcome):
    assert isinstance(outcome, Plan), outcome
    return [(step.verb, NAMES[step.object]) for step in outcome.steps]


@pytest.mark.parametrize(
    ("sentence", "verb", "thing"),
    [
        ("i think it is enough open the drawer", "open", "drawer"),
        ("open the drawer that would be lovely", "open", "drawer"),
        ("someone left the fridge open again", "close", "fridge"),
        ("press the bottom i mean the button", "press", "button"),
        ("could you make some room here? i want to put my cup there, so just press the button", "press", "button"),
    ],
)
def test_an_aside_is_left_out(sentence, verb, thing):
    facts = {"open": frozenset({NAMES.index("fridge")})} if "fridge" in sentence else {}
    assert steps(answer(sentence, **facts)) == [(verb, thing)]


@pytest.mark.parametrize(
    "sentence",
    [
        "i need the red cube kept upright",
        "hold the red and the blue cube at the same time",
        "pick up the pen next to the blue cube",
        "put the red cube under the table",
        "you are doing great",
        "grab the greenish one",
    ],
)
def test_what_is_half_understood_is_not_carried_out(sentence):
    assert isinstance(answer(sentence), Refusal | Question | Answer)


def test_a_correction_names_the_part_that_was_wrong():
    outcome = answer("put the red cube on the blue cube", "oh i meant the yellow cube not the blue one")
    assert ("stack", "red") in steps(outcome)
    assert outcome.steps[-1].goal == YELLOW


@pytest.mark.parametrize(
    ("question", "words"),
    [
        ("how far is the red cube from you", "cm from my base"),
        ("can the drawer hold two cubes", "holds one thing at a time"),
        ("confirm that the drawer is closed", "Yes: the blue drawer is closed"),
        ("count the cubes", "There are"),
    ],
)
def test_questions_in_other_forms_are_answered(question, words):
    assert words in answer(question).message
