"""Requests of many persons in a room: polite and foreign forms, what is said beside them, things that are fixed."""

import pytest

from language import Answer, Dialogue, Plan, Refusal, Signal
from tests.helpers.sets_room import FACTS, done, room, said


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        ("take the cubes out of the drawer and the fridge", "I", ["pick_and_place red", "pick_and_place yellow"]),
        ("both cubes out of the fridge and the drawer, please", "I", ["pick_and_place yellow", "pick_and_place red"]),
        ("get everything out of the drawer and the fridge", "I", ["pick_and_place red", "pick_and_place yellow"]),
        (
            "the cubes in the drawer and the fridge go on the table",
            "I",
            ["pick_and_place red", "pick_and_place yellow"],
        ),
    ],
)
def test_two_containers_are_emptied_onto_the_table(sentence, state, steps):
    assert [step for step in done(sentence, state) if not step.startswith("take_out")] == steps


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        (
            "put cyan in the drawer and see to it that the drawer is closed afterwards",
            "B",
            ["put_in cyan drawer", "close drawer"],
        ),
        ("put the red cube in the fridge, which has to be opened first", "A", ["open fridge", "put_in red fridge"]),
        (
            "red goes into the drawer, which naturally must be opened beforehand",
            "A",
            ["open drawer", "put_in red drawer"],
        ),
        ("I need the fridge opened and the drawer as well", "A", ["open fridge", "open drawer"]),
        ("open drawer -> put cyan in -> close drawer", "A", ["open drawer", "put_in cyan drawer", "close drawer"]),
        ("leave the drawer, just shut the fridge", "BF", ["close fridge"]),
        ("no no don't drop it just um give it to me", "D", ["hand_over red hand"]),
        ("take the orange one back and put it on the blue one", "H", ["stack orange blue"]),
        ("the orange one goes in the drawer, then close it", "B", ["put_in orange drawer", "close drawer"]),
        ("throw the cyan cube into the drawer and shut it", "B", ["put_in cyan drawer", "close drawer"]),
    ],
)
def test_what_is_said_of_a_container_or_of_what_shall_not_be_done_is_no_step_too_many(sentence, state, steps):
    assert done(sentence, state) == steps


@pytest.mark.parametrize(
    ("sentence", "steps"),
    [
        ("Would you be so good as to stack the red cube on the yellow one?", ["stack red yellow"]),
        ("In that case I should like you to press the button, if it is no trouble.", ["press button"]),
        ("We'd love to see you switch the lever", ["switch lever"]),
        ("relax and lift the red cube", ["lift red"]),
        ("Show the class how the lever works", ["switch lever"]),
        ("show our guests how you stack red on yellow", ["stack red yellow"]),
        ("could you demonstrate the wheel, please", ["turn wheel"]),
        ("open the drawer comma please period", ["open drawer"]),
        ("I can't get to the lever from here, please switch it for me", ["switch lever"]),
        ("hand me one of those cubes, the blue will do", ["hand_over blue hand"]),
        ("pull the lever for the crowd", ["switch lever"]),
        ("chuck the cyan block on top of the yeller one", ["stack cyan yellow"]),
        ("set the orange on the gray, nice and square", ["stack orange gray"]),
        ("Make a tower! Put the blue block on the red block!", ["stack blue red"]),
        ("that gadget on the right, the lever, give it a tug", ["switch lever"]),
    ],
)
def test_politeness_and_what_is_said_beside_a_request_change_nothing(sentence, steps):
    assert done(sentence) == steps


@pytest.mark.parametrize("begun", ["press the but the button", "pr press the button", "press the b button"])
def test_a_word_that_is_begun_twice_is_one_word(begun):
    assert done(begun) == ["press button"]


@pytest.mark.parametrize(
    "sentence",
    [
        "move the wheel to the left of the lever",
        "put the lever next to the button",
        "place the wheel behind the gray cube",
    ],
)
def test_a_device_is_not_operated_where_a_place_is_said_to_which_it_shall_go(sentence):
    outcome = said(sentence)
    assert isinstance(outcome, Refusal)
    assert "fixed" in outcome.text


def test_two_things_do_not_go_into_a_container_for_one():
    assert isinstance(said("take the orange cube and the blue cube and put them in the drawer", "B"), Refusal)


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ("which one's still open", "drawer"),
        ("Could you check what's in the drawer for me?", "Nothing"),
        ("where's the orange cube? I can't see it", "orange cube is on the table"),
        ("Kindly confirm whether the fridge is currently open or closed.", "closed"),
        ("what colour is the lever, honey?", "cyan"),
        ("what colour is that lever over there?", "cyan"),
        ("have I still got anything in the drawer?", "nothing is in"),
        ("And the drawer, is that closed as well?", "open"),
        ("What's the distance between you and the red cube?", "42 cm"),
        ("could you carry two of these at once?", "one thing at a time"),
    ],
)
def test_questions_with_other_words_beside_them_are_answered(asked, told):
    outcome = said(asked, "B")
    assert isinstance(outcome, Answer)
    assert told in outcome.text


def test_going_back_to_the_start_is_a_signal():
    outcome = said("relax, go back to your start position")
    assert isinstance(outcome, Signal)
    assert outcome.control == "home"


def test_praise_after_a_deed_takes_nothing_back():
    dialogue = Dialogue()
    plan = dialogue.answer("hand me the blue cube", room(FACTS["A"]))
    assert isinstance(plan, Plan)
    assert plan.result is not None
    for praise in ("much nicer, thank you very much", "that's much tidier"):
        assert isinstance(dialogue.answer(praise, plan.result), Answer)
